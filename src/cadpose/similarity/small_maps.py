"""The aligned measure in small: Lite0 maps of 112 px squares, in few channels, kept as bytes.

As :mod:`cadpose.similarity.aligned`, cell meets cell of a crop and a render that show the object alike. The
squares are half as wide, so that there are 7 x 7 cells; of their 112 channels the 24 directions are kept in
which renders of the library differ most. A described view takes 1.2 kB, so those of a whole library fit on
disk, and ranking draws nothing.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import CHANNELS16, Lite0
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask, Views
from cadpose.similarity.aligned import ASPECT_WEIGHT, PRIOR_RENDERS, mask_aspect
from cadpose.similarity.local_features import BACKGROUND, unit

#: Side of the squares in pixels.
SIDE = 112
#: Cells along a side.
CELLS = SIDE // 16
#: Channels that are kept.
CHANNELS = 24
#: int8 steps a standard deviation of a channel.
_STEPS = 30.0


@dataclass(frozen=True, eq=False)
class SmallMaps:
    """N described views.

    Attributes:
        cells: (N, 7, 7, 25) int8: 24 channels, and last the share that the object covers, 0 to 127.
        aspect: (N,) float32 width / height of the object's rectangle.
    """

    cells: NDArray[np.int8]
    aspect: NDArray[np.float32]

    def __post_init__(self) -> None:
        if self.cells.shape[1:] != (CELLS, CELLS, CHANNELS + 1) or self.cells.dtype != np.int8:
            raise ValueError(f"SmallMaps.cells: {self.cells.shape} {self.cells.dtype}")
        if self.aspect.shape != (len(self.cells),):
            raise ValueError(f"SmallMaps.aspect: {self.aspect.shape} for {len(self.cells)} views")

    def __len__(self) -> int:
        return len(self.cells)


@dataclass(frozen=True, eq=False)
class _Basis:
    mean: NDArray[np.float32]
    directions: NDArray[np.float32]
    spread: NDArray[np.float32]
    digest: str


@lru_cache(maxsize=1)
def _basis() -> _Basis:
    """Measured by scripts/measure_cell_basis.py over renders of the library."""
    data = (files("cadpose") / "data" / "cell-basis.json").read_bytes()
    told = json.loads(data)
    mean, directions, spread = (np.array(told[key], np.float32) for key in ("mean", "directions", "spread"))
    if directions.shape != (CHANNELS, CHANNELS16):
        raise ValueError(f"cell-basis.json has directions of shape {directions.shape}")
    return _Basis(mean, directions, spread, hashlib.sha256(data).hexdigest()[:16])


def basis_digest() -> str:
    """Part of the key of kept maps."""
    return _basis().digest


def describe_views(views: Views, encoder: Lite0) -> SmallMaps:
    """N renders of 112 px to their maps; a render without a pixel gets aspect 1 and no cover.

    Raises:
        ValueError: the renders are of another size.
    """
    n = len(views)
    if views.alpha.shape[1:] != (SIDE, SIDE):
        raise ValueError(f"renders must be {SIDE} x {SIDE}, got {views.alpha.shape[1:]}")
    cells = np.empty((n, CELLS, CELLS, CHANNELS + 1), np.int8)
    values = _projected(encoder.stride16(views.over(BACKGROUND))) * (_STEPS / _basis().spread)
    cells[..., :CHANNELS] = np.clip(np.rint(values), -127, 127)
    cover = views.alpha.reshape(n, CELLS, 16, CELLS, 16).mean(axis=(2, 4), dtype=np.float32)
    cells[..., CHANNELS] = np.rint(cover * np.float32(127.0 / 255.0))
    return SmallMaps(cells, np.array([mask_aspect(mask) for mask in views.mask], np.float32))


def describe_crop(crop: NDArray[np.uint8], encoder: Lite0) -> NDArray[np.float32]:
    """(112, 112, 3) uint8 crop, letterboxed on grey 128, to its (7, 7, 24) map.

    Raises:
        ValueError: the crop has another shape or type.
    """
    if crop.shape != (SIDE, SIDE, 3) or crop.dtype != np.uint8:
        raise ValueError(f"a crop must be ({SIDE}, {SIDE}, 3) uint8, got {crop.shape} {crop.dtype}")
    return np.asarray(_projected(encoder.stride16(crop[None]))[0])


def compare(photo: NDArray[np.float32], renders: SmallMaps, aspect: float, tolerance: int = 1) -> FloatArray:
    """Scores of one crop against all renders that compete for it.

    Args:
        photo: (7, 7, 24) map of the crop.
        renders: N views, one or more a model.
        aspect: Width / height of the photo's box.
        tolerance: A cell of the render may meet the photo's cells so many cells away: kept views are some
            degrees off. 0 for renders at the photo's own rotation.

    Returns:
        (N,) scores, at most 1, comparable within one call only: what all renders have in common at a cell is
        taken away first, as in :func:`cadpose.similarity.aligned.compare`.

    Raises:
        ValueError: there is no render, or ``aspect`` is not positive.
    """
    if not len(renders) or not aspect > 0:
        raise ValueError(f"expected at least one render and a positive aspect, got {len(renders)}, {aspect}")
    maps = renders.cells[..., :CHANNELS] * (_basis().spread / np.float32(_STEPS))
    cover = renders.cells[..., CHANNELS].astype(np.float32)
    everywhere = maps.mean(axis=(0, 1, 2))
    mean = (maps.sum(axis=0) + np.float32(PRIOR_RENDERS) * everywhere) / np.float32(len(maps) + PRIOR_RENDERS)
    templates = unit(maps - mean)
    t = tolerance
    query = np.zeros((CELLS + 2 * t, CELLS + 2 * t, CHANNELS), np.float32)
    query[t : CELLS + t, t : CELLS + t] = unit(photo - mean)
    best = np.full(templates.shape[:3], -1.0, np.float32)
    for dy in range(2 * t + 1):
        for dx in range(2 * t + 1):
            there = query[dy : dy + CELLS, dx : dx + CELLS]
            np.maximum(best, np.einsum("nyxc,yxc->nyx", templates, there), out=best)
    weight = cover.sum(axis=(1, 2), dtype=np.float64)
    total = (best * cover).sum(axis=(1, 2), dtype=np.float64)
    scores = np.where(weight > 0, total / np.maximum(weight, 1e-9), -1.0)
    return np.asarray(scores - ASPECT_WEIGHT * np.abs(np.log(aspect / renders.aspect)), np.float64)


class SmallAligned:
    """A :class:`cadpose.similarity.SimilarityMeasure` of 112 px squares, see :func:`compare`."""

    name = "lite0-small"

    def __init__(self, encoder: Lite0) -> None:
        self.encoder = encoder

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        """(N,) scores; the mask only gives the box's aspect where that is None."""
        if aspect is None:
            aspect = 1.0 if mask is None else mask_aspect(mask)
        photo = describe_crop(crop, self.encoder)
        return compare(photo, describe_views(views, self.encoder), aspect, tolerance=0)


def _projected(maps: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, 112, 7, 7) maps to (N, 7, 7, 24)."""
    basis = _basis()
    return np.asarray((maps.transpose(0, 2, 3, 1) - basis.mean) @ basis.directions.T, np.float32)
