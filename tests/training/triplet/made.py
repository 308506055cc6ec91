"""Photos of a small library's models with masks and labels, and a recipe that learns them in seconds."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from cadpose.similarity.triplet_framing import Framing
from cadpose.training.triplet.recipe import Recipe
from tests.small_library import save, shoot

#: Everything small; a high rate and all blocks trained, for it starts from random weights.
TINY = Recipe(
    negatives=3,
    mined=2,
    rate=2e-3,
    batch_size=2,
    framing=Framing(side=48, longer=40),
    trained_blocks=5,
    epochs=3,
    width=4,
)


def write_photos(library: Library, folder: Path, each: int = 1, **more: object) -> Path:
    """So many photos of each model from different sides, with masks, and their label file."""
    entries = []
    for i, cad in enumerate(library.models()):
        for k in range(each):
            turn = Rotation(25 + 60 * k + 7 * i, 12, 3)
            shot = shoot(library, cad.id, turn, size=(160, 120), middle=(84, 56), focal_px=160)
            name = f"{i}-{k}"
            save(folder / f"{name}.png", shot.photo.rgb)
            save(folder / f"{name}-mask.png", np.where(shot.mask, 255, 0).astype(np.uint8))
            entries.append(
                {
                    "photo": f"{name}.png",
                    "mask": f"{name}-mask.png",
                    "category": cad.category,
                    "cad": cad.id,
                    "box": list(shot.box.to_tuple()),
                    "azimuth": turn.azimuth,
                    "elevation": turn.elevation,
                    "inplane": turn.inplane,
                    **more,
                }
            )
    path = folder / "labels.jsonl"
    path.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    return path
