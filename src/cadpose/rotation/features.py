"""What rotation estimation sees of an image: cells of two Lite0 maps, standardised by channel.

The stride-16 map sees outlines and parts where they are, the stride-32 map what they mean: together they
confuse front and back far less than either alone.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import CHANNELS16, CHANNELS32, SIDE, Lite0

#: int8 steps a standard deviation: values are kept to ±6.35 deviations.
STEPS = 20.0


@dataclass(frozen=True, slots=True)
class Level:
    """One of the encoder's maps of a 224 px square."""

    name: str
    stride: int
    channels: int

    @property
    def side(self) -> int:
        """Cells along a side."""
        return SIDE // self.stride

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.side**2


LEVELS = (Level("stride16", 16, CHANNELS16), Level("stride32", 32, CHANNELS32))


@dataclass(frozen=True, eq=False)
class Described:
    """N described images, one array a level of :data:`LEVELS`.

    Attributes:
        cells: (N, level.cells, level.channels) int8 standardised values, times :data:`STEPS`.
        cover: (N, level.cells) float32 share of each cell that the object covers, in [0, 1].
    """

    cells: tuple[NDArray[np.int8], ...]
    cover: tuple[NDArray[np.float32], ...]

    def __post_init__(self) -> None:
        n = len(self.cells[0])
        for level, cells, cover in zip(LEVELS, self.cells, self.cover, strict=True):
            if cells.shape != (n, level.cells, level.channels) or cells.dtype != np.int8:
                raise ValueError(f"{level.name}: cells of shape {cells.shape} and type {cells.dtype}")
            if cover.shape != (n, level.cells) or cover.dtype != np.float32:
                raise ValueError(f"{level.name}: cover of shape {cover.shape} and type {cover.dtype}")

    def __len__(self) -> int:
        return len(self.cells[0])

    @classmethod
    def joined(cls, parts: Sequence[Described]) -> Described:
        """All images in order."""
        return cls(
            tuple(np.concatenate(level) for level in zip(*(p.cells for p in parts), strict=True)),
            tuple(np.concatenate(level) for level in zip(*(p.cover for p in parts), strict=True)),
        )


def describe(encoder: Lite0, images: NDArray[np.uint8], alpha: NDArray[np.uint8] | None = None) -> Described:
    """Describe square images.

    Args:
        encoder: The Lite0 encoder.
        images: (N, 224, 224, 3) uint8 RGB.
        alpha: (N, 224, 224) uint8 coverage by the object; everywhere if None.
    """
    covered = np.full(images.shape[:3], 255, np.uint8) if alpha is None else alpha
    stride16 = encoder.stride16(images)
    maps = (stride16, encoder.stride32(stride16))
    return Described(
        tuple(standardised(m, level) for m, level in zip(maps, LEVELS, strict=True)),
        tuple(cell_cover(covered, level) for level in LEVELS),
    )


def cell_cover(alpha: NDArray[np.uint8], level: Level) -> NDArray[np.float32]:
    """(N, 224, 224) coverage 0..255 to the (N, cells) share of each cell, in [0, 1]."""
    n, s, k = len(alpha), level.side, level.stride
    shares = alpha.reshape(n, s, k, s, k).mean(axis=(2, 4), dtype=np.float32) / np.float32(255.0)
    return np.ascontiguousarray(shares.reshape(n, s * s), np.float32)


@lru_cache(maxsize=1)
def cell_statistics() -> dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Mean and spread of every level's channels over what renders of the library cover.

    Measured by scripts/measure_cell_statistics.py; here they only set the scale of the int8 values.
    """
    told = json.loads((files("cadpose") / "data" / "cell-statistics.json").read_text(encoding="utf-8"))
    return {
        level.name: (
            np.array(told[level.name]["mean"], np.float32),
            np.array(told[level.name]["spread"], np.float32),
        )
        for level in LEVELS
    }


def standardised(maps: NDArray[np.float32], level: Level) -> NDArray[np.int8]:
    """(N, C, side, side) maps of a level to (N, cells, C) values, standardised by channel, times STEPS."""
    n, c = maps.shape[:2]
    mean, spread = cell_statistics()[level.name]
    values = (maps.reshape(n, c, -1).transpose(0, 2, 1) - mean) * (np.float32(STEPS) / spread)
    return np.ascontiguousarray(np.clip(np.rint(values), -127, 127), np.int8)
