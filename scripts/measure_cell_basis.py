"""Measure in which directions the Lite0 cells of library renders of 112 px differ most.

    python scripts/measure_cell_basis.py src/cadpose/data/cell-basis.json

Every model of the default library is drawn at eight random rotations (seeded), people and models without a
category left out. The small maps of the library index are kept in these directions.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from cadpose.encoder import CHANNELS16, lite0
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.rendering.raster import Rasteriser
from cadpose.similarity.local_features import BACKGROUND
from cadpose.similarity.small_maps import CELLS, CHANNELS, SIDE

VIEWS = 8


def main() -> None:
    library, renderer, encoder = Library.open(), Rasteriser(), lite0(threads=1)
    rng = np.random.default_rng(0)
    models = [m for m in library.models() if m.category not in ("person", "other")]
    total, square, count = np.zeros(CHANNELS16), np.zeros((CHANNELS16, CHANNELS16)), 0
    for cad in models:
        mesh = library.mesh(cad)
        R = rotation_from_angles(rng.uniform(0, 360, VIEWS), rng.uniform(-5, 50, VIEWS), 0.0)
        views = renderer.render(mesh, Cameras.framing(R, mesh.hull, size=SIDE))
        cells = encoder.stride16(views.over(BACKGROUND)).transpose(0, 2, 3, 1)
        cover = views.alpha.reshape(VIEWS, CELLS, 16, CELLS, 16).mean(axis=(2, 4))
        seen = cells[cover > 0.1 * 255].astype(np.float64)
        total, square, count = total + seen.sum(axis=0), square + seen.T @ seen, count + len(seen)
    mean = total / count
    values, vectors = np.linalg.eigh(square / count - np.outer(mean, mean))
    directions = vectors[:, ::-1][:, :CHANNELS].T
    # An eigenvector's sign is chance: its largest component is made positive.
    directions *= np.sign(directions[np.arange(CHANNELS), np.abs(directions).argmax(axis=1)])[:, None]
    told = {
        "models": len(models),
        "mean": np.round(mean, 4).tolist(),
        "spread": np.round(np.sqrt(values[::-1][:CHANNELS]), 4).tolist(),
        "directions": np.round(directions, 4).tolist(),
    }
    Path(sys.argv[1]).write_text(json.dumps(told) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
