"""Choose the models that training must not draw: src/cadpose/training/data/held-out.json.

    python scripts/choose_held_out.py LIBRARY src/cadpose/training/data/held-out.json

LIBRARY is what scripts/make_training_library.py --without-parametric builds. The choice among the Sweet Home
3D models is told in cadpose.training.held_out; models of other sources that look like a chosen one are
listed with it. Cars need no rule of their own: all in the category are passenger cars and a van.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from cadpose.errors import CadposeError
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.training.held_out import (
    FEWEST,
    LEAST_MODELS,
    MOST,
    NEAR_DUPLICATE,
    SHARE,
    choose,
    descriptors,
    near_duplicates,
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("library", type=Path)
    parser.add_argument("out", type=Path)
    told = parser.parse_args()
    library = Library.open(told.library)
    categories: dict[str, dict[str, object]] = {}
    for category in library.categories():
        models = [m for m in library.models(category) if m.source.startswith("sweethome3d:")]
        if len(models) < LEAST_MODELS:
            continue
        held = choose([m.id for m in models], descriptors(library, models))
        alike = near_duplicates(library, category, held)
        categories[category] = {"models": len(models), "held_out": held, "lookalikes": alike}
        print(category, len(models), len(held), len(alike), sep="\t")
    rule = {
        "least_models": LEAST_MODELS,
        "share": SHARE,
        "fewest": FEWEST,
        "most": MOST,
        "near_duplicate": NEAR_DUPLICATE,
        "order": "groups of look-alikes by the SHA-256 of their first id",
    }
    text = json.dumps({"rule": rule, "categories": categories}, indent=1, ensure_ascii=False)
    write_atomic(told.out, (text + "\n").encode())


if __name__ == "__main__":
    try:
        main()
    except CadposeError as error:
        sys.exit(str(error))
