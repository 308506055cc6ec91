"""What is known of a model without drawing it: its cached views, compared with a crop cell by cell.

Scores are those of :mod:`cadpose.similarity.aligned` with a tolerance of one cell, in whole numbers and so
quick that every model can be looked at from every rotation in question.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import CHANNELS16, SIDE
from cadpose.geometry.frames import FloatArray
from cadpose.jit import kernel
from cadpose.records import CadModel
from cadpose.threads import spread

CELLS = SIDE // 16
#: The cell means count as if so many more views had shown the mean over all cells.
_PRIOR_VIEWS = 3.0
#: Whole numbers a unit-length query's 1 and a mean's 1 become. Products stay within int32:
#: 127 · √112 · 16,000 and 112 · 127 · (127 · 64).
_QUERY_STEPS, _MEAN_STEPS = 16_000.0, 64.0

Int16Array = NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class TemplateViews:
    """A model at N rotations.

    Attributes:
        cells: (N, 196, 112) int8 stride-16 maps, every channel standardised by fixed numbers.
        cover: (N, 196) float32 share of each cell that the object covers, in [0, 1].
        aspect: (N,) width / height of the object's rectangle.

    Raises:
        ValueError: shapes or types do not fit together.
    """

    cells: NDArray[np.int8]
    cover: NDArray[np.float32]
    aspect: FloatArray

    def __post_init__(self) -> None:
        n = len(self.cells)
        if self.cells.shape != (n, CELLS**2, CHANNELS16) or self.cells.dtype != np.int8:
            raise ValueError(f"cells of shape {self.cells.shape} and type {self.cells.dtype}")
        if self.cover.shape != (n, CELLS**2) or self.cover.dtype != np.float32:
            raise ValueError(f"cover of shape {self.cover.shape} and type {self.cover.dtype}")
        if self.aspect.shape != (n,) or not (self.aspect > 0).all():
            raise ValueError("a view needs an aspect above 0")

    @property
    def nbytes(self) -> int:
        """Memory taken."""
        return self.cells.nbytes + self.cover.nbytes + self.aspect.nbytes


class TemplateSource(Protocol):
    """Gives every model's views, all at the same rotations.

    Attributes:
        rotations: (N, 3, 3) ``R_cv_from_s`` of the views.
        spread: (112,) what a channel's standardised value is multiplied with to be the encoder's again.
    """

    @property
    def rotations(self) -> FloatArray:
        """See above."""
        ...

    @property
    def spread(self) -> NDArray[np.float32]:
        """See above."""
        ...

    def views(self, cad: CadModel) -> TemplateViews:
        """The model's views, from a cache or made now.

        Raises:
            LibraryError: the model cannot be drawn.
        """
        ...

    def describe(self, crop: NDArray[np.uint8]) -> NDArray[np.int8]:
        """(224, 224, 3) uint8 crop to (196, 112) cells, standardised as the views are.

        It is letterboxed over the grey level that is behind the views.
        """
        ...


def template_cosines(
    crop: NDArray[np.int8], views: Sequence[TemplateViews], near: NDArray[np.int64]
) -> FloatArray:
    """Likeness of a crop to M models at K of their rotations.

    From crop and views the mean of all compared views at that cell is taken away; a cell of a view meets
    the best of the crop's 3 x 3 cells about it.

    Args:
        crop: (196, 112) cells.
        views: M models.
        near: (K,) indices of rotations, at least one.

    Returns:
        (M, K) mean cosines over the cells that the view covers; -1 for a view that covers none.
    """
    total = np.zeros((CELLS**2, CHANNELS16), np.int32)
    for one in views:
        _add_up(one.cells, near, total)
    n = len(views) * len(near)
    everywhere = total.mean(axis=0, dtype=np.float64) / n
    mean = np.rint((total + _PRIOR_VIEWS * everywhere) / (n + _PRIOR_VIEWS) * _MEAN_STEPS) / _MEAN_STEPS
    query = crop - mean
    query /= np.maximum(np.linalg.norm(query, axis=1, keepdims=True), 1e-9)
    padded = np.zeros((CELLS + 2, CELLS + 2, CHANNELS16))
    padded[1:-1, 1:-1] = np.rint(query.reshape(CELLS, CELLS, CHANNELS16) * _QUERY_STEPS)
    around = np.stack(
        [padded[y : y + CELLS, x : x + CELLS].reshape(CELLS**2, -1) for y in range(3) for x in range(3)],
        axis=1,
    )
    whole_mean = (mean * _MEAN_STEPS).astype(np.int16)
    mean_around = np.einsum("ck,cjk->cj", mean, around)
    mean_square = np.einsum("ck,ck->c", mean, mean)
    whole = around.astype(np.int16)

    def of(one: TemplateViews) -> FloatArray:
        out = np.empty(len(near))
        _cosines(one.cells, one.cover, near, whole, whole_mean, mean_around, mean_square, out)
        return out

    return np.stack(spread(of, views))


@kernel
def _add_up(cells: NDArray[np.int8], near: NDArray[np.int64], total: NDArray[np.int32]) -> None:
    for n in near:
        for c in range(cells.shape[1]):
            for k in range(cells.shape[2]):
                total[c, k] += np.int32(cells[n, c, k])


@kernel
def _cosines(
    cells: NDArray[np.int8],
    cover: NDArray[np.float32],
    near: NDArray[np.int64],
    around: Int16Array,
    mean: Int16Array,
    mean_around: FloatArray,
    mean_square: FloatArray,
    out: FloatArray,
) -> None:
    # |t - m|² and (t - m)·q are sums of whole products, which are quicker than fractions.
    for i in range(near.shape[0]):
        n = near[i]
        total, weight = 0.0, 0.0
        for c in range(cells.shape[1]):
            w = np.float64(cover[n, c])
            if w > 0.0:
                square, with_mean = np.int32(0), np.int32(0)
                for k in range(cells.shape[2]):
                    t = np.int32(cells[n, c, k])
                    square += t * t
                    with_mean += t * np.int32(mean[c, k])
                best = -1e30
                for j in range(around.shape[1]):
                    dot = np.int32(0)
                    for k in range(cells.shape[2]):
                        dot += np.int32(cells[n, c, k]) * np.int32(around[c, j, k])
                    best = max(best, np.float64(dot) - mean_around[c, j])
                length = np.float64(square) - 2.0 * np.float64(with_mean) / _MEAN_STEPS + mean_square[c]
                total += w * best / (_QUERY_STEPS * np.sqrt(max(length, 1e-9)))
                weight += w
        out[i] = total / weight if weight > 0.0 else -1.0
