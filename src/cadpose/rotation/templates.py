"""The templates of a category: the galleries of its CAD models, made comparable with a photograph.

Channels are standardised over what the category's renders cover, so that what all its models share in
all views ("it is a car") drops out; the photograph is standardised with the same numbers, its own
background would shift any of its own. Every cell is scaled to unit length and kept as int8.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.jit import kernel
from cadpose.rotation.features import LEVELS, STEPS, Described
from cadpose.threads import shares, spread

#: Unit-length cells stay below this in each component; int8 covers [-_RANGE, _RANGE].
_RANGE = 0.6


class Templates:
    """M models at N rotations, compared with images.

    Args:
        galleries: One a model, all at the same N rotations.

    Raises:
        ValueError: there is no gallery, or their lengths differ.
    """

    def __init__(self, galleries: Sequence[Described]) -> None:
        if not galleries or len({len(g) for g in galleries}) != 1:
            raise ValueError("templates need at least one gallery, all of the same rotations")
        self.models, self.rotations = len(galleries), len(galleries[0])
        self._levels = []
        for i in range(len(LEVELS)):
            cover = np.concatenate([g.cover[i] for g in galleries])
            mean, spread = _statistics([g.cells[i] for g in galleries], [g.cover[i] for g in galleries])
            cells = np.concatenate([_unit(g.cells[i], mean, spread) for g in galleries])
            self._levels.append((cells, cover, mean, spread))

    @property
    def nbytes(self) -> int:
        """Memory taken."""
        return sum(cells.nbytes + cover.nbytes for cells, cover, _, _ in self._levels)

    def cosines(self, query: Described) -> FloatArray:
        """Cell-wise cosine of one image and every template over the cells that the template covers.

        Returns:
            (M, N) mean over the levels, in [-1, 1].

        Raises:
            ValueError: ``query`` is not one image.
        """
        if len(query) != 1:
            raise ValueError(f"expected one described image, got {len(query)}")
        return np.asarray(self.cosines_of_each(query)[0])

    def cosines_of_each(self, queries: Described) -> FloatArray:
        """(Q, M, N) :meth:`cosines` of Q images.

        Templates are far larger than caches: read once, they serve all images in little more time.
        """
        total = np.zeros((len(queries), self.models * self.rotations))
        for photos, (cells, cover, mean, deviation) in zip(queries.cells, self._levels, strict=True):
            query = _unit(photos, mean, deviation)
            parts = spread(partial(_cosines_of_some, query, cells, cover), shares(len(cells)))
            total += np.concatenate(parts, axis=1)
        total *= (_RANGE / 127.0) ** 2 / len(LEVELS)
        return total.reshape(len(queries), self.models, self.rotations)


def _cosines_of_some(
    query: NDArray[np.int8], cells: NDArray[np.int8], cover: NDArray[np.float32], part: slice
) -> NDArray[np.float32]:
    """(Q, part) cosines before they are scaled."""
    some = cells[part]
    out = np.empty((len(query), len(some)), np.float32)
    _covered_cosines(query, some, cover[part], out)
    return out


def _statistics(
    cells: Sequence[NDArray[np.int8]], cover: Sequence[NDArray[np.float32]]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(C,) mean and spread in standard deviations of the library, weighted by cover."""
    channels = cells[0].shape[2]
    total, square, weight = np.zeros(channels), np.zeros(channels), 0.0
    for c, w in zip(cells, cover, strict=True):
        _add_up(c, w, total, square)
        weight += float(w.sum(dtype=np.float64))
    weight = max(weight, 1e-6)
    mean = total / weight
    # Below one int8 step there is only rounding: a constant channel must not outweigh the others.
    spread = np.sqrt(np.maximum(square / weight - mean**2, 1.0))
    return (mean / STEPS).astype(np.float32), (spread / STEPS).astype(np.float32)


def _unit(
    cells: NDArray[np.int8], mean: NDArray[np.float32], spread: NDArray[np.float32]
) -> NDArray[np.int8]:
    out = np.empty_like(cells)
    _scale_cells(cells, mean, np.float32(1.0) / spread, out)
    return out


@kernel
def _add_up(
    cells: NDArray[np.int8], cover: NDArray[np.float32], total: FloatArray, square: FloatArray
) -> None:
    for n in range(cells.shape[0]):
        for cell in range(cells.shape[1]):
            w = np.float64(cover[n, cell])
            if w > 0.0:
                for c in range(cells.shape[2]):
                    v = np.float64(cells[n, cell, c])
                    total[c] += w * v
                    square[c] += w * v * v


@kernel
def _scale_cells(
    cells: NDArray[np.int8],
    mean: NDArray[np.float32],
    inverse_spread: NDArray[np.float32],
    out: NDArray[np.int8],
) -> None:
    step = np.float32(1.0 / STEPS)
    row = np.empty(cells.shape[2], np.float32)
    for n in range(cells.shape[0]):
        for cell in range(cells.shape[1]):
            length = np.float32(1e-12)
            for c in range(cells.shape[2]):
                v = (np.float32(cells[n, cell, c]) * step - mean[c]) * inverse_spread[c]
                row[c] = v
                length += v * v
            scale = np.float32(127.0 / _RANGE) / np.sqrt(length)
            for c in range(cells.shape[2]):
                v = min(max(row[c] * scale, np.float32(-127.0)), np.float32(127.0))
                out[n, cell, c] = np.int8(np.rint(v))


@kernel
def _covered_cosines(
    queries: NDArray[np.int8],
    templates: NDArray[np.int8],
    cover: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    totals = np.empty(queries.shape[0], np.float32)
    for n in range(templates.shape[0]):
        totals[:] = np.float32(0.0)
        weight = np.float32(1e-6)
        for cell in range(templates.shape[1]):
            w = cover[n, cell]
            if w > 0.0:
                for q in range(queries.shape[0]):
                    dot = np.int32(0)
                    for c in range(templates.shape[2]):
                        dot += np.int32(queries[q, cell, c]) * np.int32(templates[n, cell, c])
                    totals[q] += w * np.float32(dot)
                weight += w
        for q in range(queries.shape[0]):
            out[q, n] = totals[q] / weight
