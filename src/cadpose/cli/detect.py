"""``cadpose detect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cadpose.cli.options import Categories, DetectorName, Device, Json, MasksName, Seed
from cadpose.cli.output import complain, print_json, print_table, progress_bar

if TYPE_CHECKING:
    from cadpose.batch.detect import PhotoDetections
    from cadpose.records import Detection


def detect(
    photos: Annotated[list[str], typer.Argument(metavar="PHOTO|DIR|GLOB...", help="Photographs.")],
    category: Categories = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Draw masks and boxes into this folder.")
    ] = None,
    coco: Annotated[Path | None, typer.Option("--coco", help="Write this COCO JSON file.")] = None,
    detector: DetectorName = "embedded",
    masks: MasksName = "network",
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Find the objects of photographs: boxes, categories and masks."""
    from cadpose.backends import make_detector, make_masks
    from cadpose.batch.detect import detect_photos
    from cadpose.library.class_map import CATEGORIES
    from cadpose.photos import find_photos

    # A network of the user's has classes of its own.
    own = detector.startswith("onnx:")
    unknown = [name for name in category or () if name not in CATEGORIES]
    if unknown and not own:
        raise typer.BadParameter(f"no detector knows {unknown[0]!r}, only {', '.join(sorted(CATEGORIES))}")
    paths = find_photos(photos)
    # Nobody would see them in the table.
    shown = masks != "none" and (json or out is not None or coco is not None)
    estimator = make_masks(masks, device, seed) if shown else None
    finder = make_detector(detector, category, device)
    rows: list[list[str]] = []
    told: list[dict[str, Any]] = []
    failed = drawn = False
    with progress_bar("detect", len(paths)) as bar:
        for found in detect_photos(finder, estimator, paths, out=out, coco=coco):
            failed |= bool(found.error)
            drawn |= found.picture is not None
            if found.error:
                complain(found.error)
            if json:
                told.append(_told(found))
            rows += _rows(found)
            bar.advance(bar.tasks[0].id)
    if json:
        print_json(told)
    else:
        print_table(f"{len(paths)} photos", ["photo", "category", "score", "box", "flags"], rows)
        if out is not None and drawn:
            typer.echo(f"Pictures: {out / 'index.html'}")
    if failed:
        raise typer.Exit(1)


def _told(found: PhotoDetections) -> dict[str, Any]:
    from cadpose.detection.coco_writing import compressed_mask

    return {
        "photo": str(found.photo),
        "error": found.error or None,
        "picture": None if found.picture is None else str(found.picture),
        "detections": [
            {
                "category": d.category,
                "score": round(d.score, 4),
                "box": list(d.box.to_tuple()),
                "alternatives": [{"category": c, "score": round(s, 4)} for c, s in d.alternatives],
                "truncated": d.truncated,
                "tiny": d.tiny,
                "unsure": d.unsure,
                "mask": None if d.mask is None else compressed_mask(d.mask),
            }
            for d in found.detections
        ],
    }


def _rows(found: PhotoDetections) -> list[list[str]]:
    name = found.photo.name
    if not found.detections:
        return [[name, "failed" if found.error else "no object found", "", "", ""]]
    return [[name, *_row(d)] for d in found.detections]


def _row(d: Detection) -> list[str]:
    from cadpose.annotations.style import category_text, flags_of

    return [
        category_text(d.category, (name for name, _ in d.alternatives), d.unsure),
        f"{d.score:.2f}",
        " ".join(f"{v:.0f}" for v in d.box.to_tuple()),
        " ".join(flags_of(d)),
    ]
