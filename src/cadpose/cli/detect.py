"""``cadpose detect``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cadpose.cli.options import Categories, DetectorName, Device, Json, Seed
from cadpose.cli.output import complain, print_json, print_table, progress_bar


def detect(
    photos: Annotated[list[str], typer.Argument(metavar="PHOTO|DIR|GLOB...", help="Photographs.")],
    category: Categories = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Draw the boxes into this folder.")] = None,
    detector: DetectorName = "embedded",
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Find the objects of photographs: boxes and categories."""
    from cadpose.annotations.boxes import draw_detections
    from cadpose.annotations.files import output_paths, spare_photos, write_atomic
    from cadpose.annotations.style import png_bytes
    from cadpose.backends import make_detector
    from cadpose.errors import CadposeError
    from cadpose.library.class_map import CATEGORIES
    from cadpose.photos import find_photos, read_photo

    unknown = [name for name in category or () if name not in CATEGORIES]
    if unknown:
        raise typer.BadParameter(f"no detector knows {unknown[0]!r}, only {', '.join(sorted(CATEGORIES))}")
    paths = find_photos(photos)
    pictures = [p.json.with_suffix(".detections.png") for p in output_paths(paths, out or Path())]
    if out is not None:
        spare_photos(pictures, paths)
    finder = make_detector(detector, category, device)
    told: list[dict[str, Any]] = []
    with progress_bar("detect", len(paths)) as bar:
        for path, picture in zip(paths, pictures, strict=True):
            try:
                photo = read_photo(path)
                found = finder.detect(photo)
                if out is not None:
                    write_atomic(picture, png_bytes(draw_detections(photo, found)))
                objects = [
                    {"category": d.category, "score": round(d.score, 4), "box": list(d.box.to_tuple())}
                    for d in found
                ]
                told.append({"photo": str(path), "error": None, "detections": objects})
            except CadposeError as error:
                complain(str(error))
                told.append({"photo": str(path), "error": str(error), "detections": []})
            bar.advance(bar.tasks[0].id)
    if json:
        print_json(told)
    else:
        rows = []
        for t in told:
            name = Path(t["photo"]).name
            if not t["detections"]:
                rows.append([name, "failed" if t["error"] else "no object found", "", ""])
            rows += [
                [name, d["category"], f"{d['score']:.2f}", " ".join(f"{v:.0f}" for v in d["box"])]
                for d in t["detections"]
            ]
        print_table(f"{len(told)} photos", ["photo", "category", "score", "box"], rows)
    if any(t["error"] for t in told):
        raise typer.Exit(1)
