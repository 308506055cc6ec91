"""Copy a CAD library with fewer faces and smaller textures, so that drawing a training set is quick.

    python scripts/simplify_library.py DIR_IN DIR_OUT

Ids, categories and descriptors stay; what is in DIR_OUT already is replaced. These numbers were used for the
shipped network: at 256 pixels the copies can hardly be told from the originals.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cadpose.cli.output import progress_bar
from cadpose.errors import CadposeError, InputError
from cadpose.library.catalogue import Library
from cadpose.training.simplify import simplify_library

# Spokes, hulls and grilles need more faces than furniture does.
FACES = {
    "": 6000,
    "car": 30000,
    "motorbike": 16000,
    "truck": 16000,
    "bus": 16000,
    "bicycle": 12000,
    "airplane": 12000,
    "piano": 12000,
    "tv": 10000,
    "boat": 10000,
}
TEXTURE_SIDE = 96


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, metavar="DIR_IN")
    parser.add_argument("folder", type=Path, metavar="DIR_OUT")
    told = parser.parse_args()
    if told.folder.resolve() == told.source.resolve():
        raise InputError("DIR_OUT must not be DIR_IN: the meshes there would be lost.")
    library = Library.open(told.source)
    ids = [m.id for m in library.models()]
    with progress_bar("simplify", len(ids)) as bar:
        small = simplify_library(
            library, told.folder, ids, FACES, TEXTURE_SIDE, on_done=lambda _: bar.advance(bar.tasks[0].id)
        )
    before, after = (sum(m.face_count for m in lib.models()) for lib in (library, small))
    print(f"{len(ids)} models, {before} faces -> {after}")


if __name__ == "__main__":
    try:
        main()
    except CadposeError as error:
        sys.exit(str(error))
