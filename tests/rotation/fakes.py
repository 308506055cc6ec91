"""A made-up car of coloured boxes, and an encoder that sees only the colours of its cells."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import CHANNELS16, CHANNELS32, Lite0
from cadpose.library.mesh import Material, Mesh
from cadpose.records import CadModel
from cadpose.rotation.features import LEVELS, Described, cell_statistics
from tests.rendering.shapes import mesh_of

Colour = tuple[float, float, float]
#: Low and high corner in metres (front -z, up +y), and the colour.
Part = tuple[Colour, Colour, Colour]

_CAR: tuple[Part, ...] = (
    ((-0.9, 0.3, -2.2), (0.9, 0.8, 2.2), (0.75, 0.1, 0.1)),
    ((-0.8, 0.8, -0.6), (0.8, 1.45, 1.9), (0.15, 0.15, 0.2)),
    ((-0.75, 1.45, -0.4), (0.75, 1.5, 1.8), (0.75, 0.1, 0.1)),
    ((-0.85, 0.5, -2.25), (-0.5, 0.7, -2.2), (1.0, 1.0, 0.8)),
    ((0.5, 0.5, -2.25), (0.85, 0.7, -2.2), (1.0, 1.0, 0.8)),
    ((-0.85, 0.5, 2.2), (0.85, 0.65, 2.25), (0.3, 0.0, 0.0)),
    # What tells left from right: a yellow tank on the object's own right (+x).
    ((0.9, 0.5, 0.3), (1.1, 0.75, 1.2), (0.9, 0.8, 0.1)),
)
_WHEELS: tuple[Part, ...] = tuple(
    ((x, 0.0, z), (x + 0.25, 0.65, z + 0.65), (0.05, 0.05, 0.05)) for x in (-0.9, 0.65) for z in (-1.75, 1.1)
)
_VAN: tuple[Part, ...] = (
    ((-0.9, 0.3, -2.0), (0.9, 1.1, 2.2), (0.2, 0.4, 0.7)),
    ((-0.85, 1.1, -1.4), (0.85, 2.1, 2.2), (0.9, 0.9, 0.9)),
    ((-0.8, 1.1, -1.45), (0.8, 1.7, -1.4), (0.1, 0.1, 0.1)),
)


def blocks(parts: Iterable[Part]) -> Mesh:
    """Boxes of one colour each, centred, the bounding box's diagonal 1."""
    listed = list(parts)
    corners = np.concatenate([_box(np.array(low), np.array(high)) for low, high, _ in listed])
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    corners = (corners - (low + high) / 2) / np.linalg.norm(high - low)
    return mesh_of(
        corners,
        tuple(Material((*colour, 1.0)) for _, _, colour in listed),
        np.repeat(np.arange(len(listed)), 12),
    )


def car() -> Mesh:
    """A saloon whose four sides all look different."""
    return blocks(_CAR + _WHEELS)


def van() -> Mesh:
    """Higher, of other colours."""
    return blocks(_VAN + _WHEELS)


def cad(name: str, sha256: str = "0") -> CadModel:
    return CadModel(name, name, "car", sha256=sha256)


def random_described(count: int, seed: int) -> Described:
    rng = np.random.default_rng(seed)
    return Described(
        tuple(rng.integers(-40, 41, (count, v.cells, v.channels)).astype(np.int8) for v in LEVELS),
        tuple(rng.random((count, v.cells), np.float32) for v in LEVELS),
    )


class ColourEncoder(Lite0):
    """Maps that are a fixed mix of each cell's mean colour: quick, without weights, of real shape."""

    def __init__(self) -> None:
        super().__init__()
        rng = np.random.default_rng(7)
        self._mix16 = rng.normal(size=(3, CHANNELS16)).astype(np.float32)
        self._mix32 = rng.normal(size=(CHANNELS16, CHANNELS32)).astype(np.float32) / 10
        self.images = 0

    def stride16(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        self.images += len(images)
        n, side = len(images), images.shape[1] // 16
        cells = images.reshape(n, side, 16, side, 16, 3).mean(axis=(2, 4), dtype=np.float32)
        mean, spread = cell_statistics()["stride16"]
        mixed: NDArray[np.float32] = ((cells / 128 - 1) @ self._mix16) * spread + mean
        return mixed.transpose(0, 3, 1, 2)

    def stride32(self, stride16: NDArray[np.float32]) -> NDArray[np.float32]:
        n, c, h, w = stride16.shape
        pooled = stride16.reshape(n, c, h // 2, 2, w // 2, 2).mean(axis=(3, 5)).transpose(0, 2, 3, 1)
        (mean16, spread16), (mean, spread) = (cell_statistics()[v.name] for v in LEVELS)
        mixed: NDArray[np.float32] = ((pooled - mean16) / spread16 @ self._mix32) * spread + mean
        return mixed.transpose(0, 3, 1, 2)


def _box(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """(12, 3, 3) triangles, counter-clockwise from outside."""
    triangles = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end, order in ((low, (0, 2, 1)), (high, (0, 1, 2))):
            quad = np.tile(end, (4, 1))
            quad[:, u] = [low[u], high[u], high[u], low[u]]
            quad[:, v] = [low[v], low[v], high[v], high[v]]
            triangles += [quad[list(order)], quad[[0, *(k + 1 for k in order[1:])]]]
    return np.array(triangles)
