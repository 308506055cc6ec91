"""Detectors whose answers are told beforehand, and miniature data sets to try them on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from cadpose.geometry.boxes import Box
from cadpose.records import Detection, Photo

#: What is true: file name to (category, box), all of 40 x 50 pixels or more but for the cup.
TRUTH: dict[str, list[tuple[str, tuple[float, float, float, float]]]] = {
    "a.png": [("car", (10, 10, 60, 60)), ("car", (100, 10, 160, 60)), ("cup", (80, 80, 90, 90))],
    "b.png": [("chair", (20, 20, 120, 110))],
    "c.png": [],
}
SIZE = (200, 120)
COCO_WORDS = {"car": "car", "cup": "cup", "chair": "chair", "person": "person", "kite": "kite"}


class Says:
    """A detector that answers by file name; those below ``min_score`` are kept back."""

    name = "says"

    def __init__(self, answers: Mapping[str, Sequence[Detection]], min_score: float = 0.3) -> None:
        self.answers = answers
        self.min_score = min_score
        self.asked: list[tuple[str, float]] = []

    def detect(self, photo: Photo) -> list[Detection]:
        name = Path(photo.name).name
        self.asked.append((name, self.min_score))
        return [d for d in self.answers.get(name, ()) if d.score >= self.min_score]


def perfect(score: float = 0.9) -> dict[str, list[Detection]]:
    """Every object, where it is."""
    return {
        name: [Detection(Box(*box), category, score) for category, box in some]
        for name, some in TRUTH.items()
    }


def shifted() -> dict[str, list[Detection]]:
    """Every object, as far aside as it is wide."""
    return {
        name: [
            Detection(Box(box[0] + box[2] - box[0], *box[1:2], 2 * box[2] - box[0], box[3]), category, 0.9)
            for category, box in some
        ]
        for name, some in TRUTH.items()
    }


def write_coco(folder: Path, more: Sequence[dict[str, Any]] = ()) -> Path:
    """``TRUTH`` as COCO's JSON, outlines as the boxes; ``more`` are further annotations of a.png."""
    names = sorted(TRUTH)
    ids = {category: i for i, category in enumerate(COCO_WORDS, 1)}
    annotations = []
    for i, name in enumerate(names):
        Image.fromarray(np.full((SIZE[1], SIZE[0], 3), 90 + 20 * i, np.uint8)).save(folder / name)
        for category, (x0, y0, x1, y1) in TRUTH[name]:
            annotations.append(
                {
                    "image_id": i,
                    "category_id": ids[category],
                    "bbox": [x0, y0, x1 - x0, y1 - y0],
                    "segmentation": [[x0, y0, x1, y0, x1, y1, x0, y1]],
                }
            )
    content = {
        "images": [
            {"id": i, "file_name": n, "width": SIZE[0], "height": SIZE[1]} for i, n in enumerate(names)
        ],
        "categories": [{"id": i, "name": COCO_WORDS[c]} for c, i in ids.items()],
        "annotations": [*annotations, *({"image_id": 0} | a for a in more)],
    }
    path = folder / "coco.json"
    path.write_text(json.dumps(content))
    return path
