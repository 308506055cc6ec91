"""Replace an object in five photos of $CADPOSE_BENCH/photos, or in the demo's two, and put them on one sheet.

    python scripts/replace_five.py OUT [--demo FOLDER] [--library FOLDER]

OUT gets three pictures of each photo side by side, and sheet.png with all of them. The photos of the bench
are for evaluation only: their sheet is for looking at, not for publishing. The demo's are scikit-image's.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from cadpose import Annotator, Library
from cadpose.photos import read_photo
from cadpose.replacement.choosing import chosen_object, model_named
from cadpose.replacement.replacer import Replacer
from cadpose.replacement.sheet import before_and_after


@dataclass(frozen=True)
class Job:
    """One photo, which of its objects goes, and what comes."""

    photo: str
    category: str
    cad: str


FIVE = (
    Job("n03770679_minivan.JPEG", "car", "KatorLegaz/katorlegaz/VW-new-beetle/VW-new-beetle.obj"),
    Job("n04099969_rocking_chair.JPEG", "chair", "BlendSwap-CC-0/blendswap-cc-0/oakChair/oakChair.obj"),
    Job("n04404412_television.JPEG", "sofa", "Scopia/scopia/beige_sofa_2seats/beige_sofa_2seats.obj"),
    Job("n03791053_motor_scooter.JPEG", "motorbike", "Scopia/scopia/yamaha-yzr-r6/yamaha-yzr-r6.obj"),
    Job("n04557648_water_bottle.JPEG", "bottle", "Scopia/scopia/wine_bottle/wine_bottle.obj"),
)
DEMO = (
    Job("motorcycle.png", "motorbike", "KatorLegaz/katorlegaz/scooter/scooter.obj"),
    Job("coffee.png", "cup", "KatorLegaz/katorlegaz/coffee-mug/coffee-mug.obj"),
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument(
        "--demo", type=Path, help="folder of scripts/demo_photos.py instead of the five photos"
    )
    parser.add_argument("--library", type=Path)
    args = parser.parse_args()
    if args.demo is None and "CADPOSE_BENCH" not in os.environ:
        parser.error("set CADPOSE_BENCH to the folder that holds photos/, or use --demo")
    folder = args.demo or Path(os.environ["CADPOSE_BENCH"]) / "photos"
    args.out.mkdir(parents=True, exist_ok=True)
    library = Library.open(args.library)
    annotator, replacer = Annotator(library.path), Replacer(library)
    rows = []
    for job in DEMO if args.demo else FIVE:
        photo = read_photo(folder / job.photo)
        annotations = annotator.annotate(photo)
        chosen = chosen_object(annotations, photo.name, category=job.category)
        begun = time.perf_counter()
        made = replacer.replace(photo, chosen, model_named(library, job.cad), others=annotations)
        took = time.perf_counter() - begun
        stages = " ".join(f"{stage} {seconds:.2f}" for stage, seconds in made.seconds.items())
        light = made.light
        lamp = "guessed" if light.guessed else "default"
        print(f"{job.photo} {photo.width}x{photo.height} {took:.1f} s: {stages}; light {lamp}")
        print(f"  confidence {light.confidence:.2f}, direction {light.direction}, verdict {chosen.verdict}")
        rows.append(before_and_after(photo, made))
        rows[-1].save(args.out / f"{Path(job.photo).stem}.png")
        Image.fromarray(made.picture).save(args.out / f"{Path(job.photo).stem}.picture.png")
    sheet = Image.new(
        "RGB", (max(row.width for row in rows), sum(row.height for row in rows)), (255, 255, 255)
    )
    top = 0
    for row in rows:
        sheet.paste(row, (0, top))
        top += row.height
    sheet.save(args.out / "sheet.png")


if __name__ == "__main__":
    main()
