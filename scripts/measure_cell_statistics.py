"""Measure mean and spread of the Lite0 channels over the covered cells of library renders.

    python scripts/measure_cell_statistics.py src/cadpose/data/cell-statistics.json

Every model of the default library is drawn once at a random rotation (seeded), people and models without
a category left out. Rotation estimation standardises photographs and renders alike with these numbers.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from cadpose.encoder import SIDE, lite0
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.rendering.raster import Rasteriser
from cadpose.rotation.features import LEVELS, cell_cover


def main() -> None:
    library, renderer, encoder = Library.open(), Rasteriser(), lite0()
    rng = np.random.default_rng(0)
    sums = {level.name: [np.zeros(level.channels), np.zeros(level.channels), 0.0] for level in LEVELS}
    models = [m for m in library.models() if m.category not in ("person", "other")]
    for cad in models:
        mesh = library.mesh(cad)
        R = rotation_from_angles(rng.uniform(0, 360), rng.uniform(-5, 50), rng.normal(0, 8))
        views = renderer.render(mesh, Cameras.framing(R[None], mesh.hull, size=SIDE))
        stride16 = encoder.stride16(views.over(255))
        for level, maps in zip(LEVELS, (stride16, encoder.stride32(stride16)), strict=True):
            cells = maps[0].reshape(level.channels, -1).astype(np.float64)
            cover = cell_cover(views.alpha, level)[0].astype(np.float64)
            for i, value in enumerate((cells @ cover, cells**2 @ cover, cover.sum())):
                sums[level.name][i] = sums[level.name][i] + value
    told: dict[str, object] = {"models": len(models)}
    for name, (total, square, weight) in sums.items():
        mean = total / weight
        spread = np.sqrt(square / weight - mean**2)
        told[name] = {"mean": np.round(mean, 4).tolist(), "spread": np.round(spread, 4).tolist()}
    Path(sys.argv[1]).write_text(json.dumps(told) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
