"""Build the library of shapes that training draws.

    CADPOSE_BENCH=../shared python scripts/make_training_library.py DIR

It takes the Sweet Home 3D models of Debian's sweethome3d-furniture without those that
src/cadpose/data/sweethome3d-exceptions.csv calls unfit, the base meshes and IKEA models in
$CADPOSE_BENCH/cad by their tables, and parametric models: 40 a category.
Parametric models that look like a held-out one are left out. Run again, it adds what is new. What DIR holds
beside all this is removed: never name the library that you annotate with.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

from cadpose.cli.output import complain, progress_bar
from cadpose.errors import CadposeError
from cadpose.library.catalogue import Library
from cadpose.library.importing import AddReport, ImportItem
from cadpose.library.parametric.items import parametric_items
from cadpose.library.sweethome3d import installed_package
from cadpose.training.held_out import near_duplicates, read_held_out
from cadpose.training.shapes import LEFT_OUT, training_items

PARAMETRIC_A_CATEGORY = 40


def parametric() -> list[ImportItem]:
    """Seeds 0 to 39 of every category that has a generator."""
    return [i for i in parametric_items(count=PARAMETRIC_A_CATEGORY) if i.category not in LEFT_OUT]


def add(library: Library, items: list[ImportItem], workers: int) -> AddReport:
    with progress_bar("import", len(items)) as bar:

        def progress(done: int, total: int, name: str) -> None:
            bar.update(bar.tasks[0].id, completed=done, total=total)

        report = library.add(items, workers=workers, progress=progress)
    for cad_id, reason in report.failed:
        complain(f"{cad_id} left out: {reason}")
    return report


def show(library: Library) -> None:
    """Counts by category and source, and how many of a category are held out."""
    held = read_held_out()
    sources = sorted({m.source for m in library.models()})
    short = {s: s.split(":")[-1].removesuffix(".sh3f") for s in sources}
    print("category", *short.values(), "all", "held-out", sep="\t")
    for category, count in library.categories().items():
        by_source = Counter(m.source for m in library.models(category))
        kept_back = sum(m.id in held.get(category, ()) for m in library.models(category))
        print(category, *(by_source[s] for s in sources), count, kept_back, sep="\t")
    print(
        "all",
        *(sum(m.source == s for m in library.models()) for s in sources),
        len(library.models()),
        sep="\t",
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--without-parametric", action="store_true")
    told = parser.parse_args()
    bench = Path(os.environ.get("CADPOSE_BENCH", "../shared"))
    problems: list[str] = []
    items = training_items(installed_package(), bench / "cad", problems)
    for problem in problems:
        complain(problem)
    library = Library.create(told.folder)
    # What has become unfit since the last run goes.
    made = [] if told.without_parametric else parametric()
    wanted = {i.id for i in items + made}
    library.remove([m.id for m in library.models() if m.id not in wanted])
    add(library, items, told.workers)
    if made:
        add(library, made, told.workers)
        ids = {i.id for i in made}
        for category, held in read_held_out().items():
            library.remove(i for i in near_duplicates(library, category, sorted(held)) if i in ids)
    show(library)


if __name__ == "__main__":
    try:
        main()
    except CadposeError as error:
        sys.exit(str(error))
