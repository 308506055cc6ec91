"""The measure `aligned`: Lite0 stride-16 maps of crop and render compared cell by cell.

Crop and render show the object framed alike, so cell (r, c) of both looks at the same part of it. From both
maps the mean of the compared renders *at that cell* is taken away: what all candidates have in common there
(background, bodywork, wheels) cannot tell them apart. The cosine of what is left, averaged over the cells
that the render covers, is the score, less a term for boxes of different shape:

    score = mean_covered cos(photo - m, render - m) - ASPECT_WEIGHT · |ln(aspect_photo / aspect_render)|
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import CHANNELS16, SIDE, Lite0, lite0
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask, Views
from cadpose.similarity.local_features import BACKGROUND, resize_squares, unit

#: Weight of the absolute log ratio of the two boxes' aspects.
ASPECT_WEIGHT = 0.5
#: The cell means count as if so many more renders, with the mean over all cells, had been there. It keeps
#: the measure defined for one render and steady for a few.
PRIOR_RENDERS = 3.0

_CELLS = SIDE // 16


@dataclass(frozen=True, eq=False)
class ViewMaps:
    """N described renders.

    Attributes:
        maps: (N, 112, 14, 14) float32 stride-16 maps.
        cover: (N, 14, 14) float32 share of each cell that the object covers, in [0, 1].
        aspect: (N,) width / height of the object's rectangle.
    """

    maps: NDArray[np.float32]
    cover: NDArray[np.float32]
    aspect: FloatArray

    def __len__(self) -> int:
        return len(self.maps)

    @classmethod
    def joined(cls, parts: Sequence[ViewMaps]) -> ViewMaps:
        """All parts in order, for example one a CAD, each with a bracket of rotations."""
        return cls(
            np.concatenate([p.maps for p in parts]),
            np.concatenate([p.cover for p in parts]),
            np.concatenate([p.aspect for p in parts]),
        )


def describe_views(
    views: Views, encoder: Lite0 | None = None, maps: NDArray[np.float32] | None = None
) -> ViewMaps:
    """Renders of any square size to their maps; a render without a pixel gets aspect 1 and no cover.

    ``maps`` are the encoder's of the renders over :data:`BACKGROUND` at 224 px, where it was asked already.

    Raises:
        ValueError: the renders are not square.
    """
    n, h, w = views.alpha.shape
    if h != w:
        raise ValueError(f"renders must be square, got {w} x {h}")
    if maps is None:
        maps = (encoder or lite0()).stride16(resize_squares(views.over(BACKGROUND), SIDE))
    alpha = resize_squares(views.alpha, SIDE)
    cover = alpha.reshape(n, _CELLS, 16, _CELLS, 16).mean(axis=(2, 4), dtype=np.float32) / np.float32(255.0)
    aspect = np.array([mask_aspect(mask) for mask in views.mask], np.float64)
    return ViewMaps(maps, np.asarray(cover, np.float32), aspect)


def describe_crop(crop: NDArray[np.uint8], encoder: Lite0 | None = None) -> NDArray[np.float32]:
    """(S, S, 3) uint8 letterboxed crop to its (112, 14, 14) map.

    Raises:
        ValueError: the crop is not (S, S, 3) uint8.
    """
    if crop.dtype != np.uint8 or crop.ndim != 3 or crop.shape[0] != crop.shape[1] or crop.shape[2] != 3:
        raise ValueError(f"a crop must be (S, S, 3) uint8, got {crop.shape} {crop.dtype}")
    return np.asarray((encoder or lite0()).stride16(resize_squares(crop[None], SIDE))[0])


def mask_aspect(mask: Mask) -> float:
    """Width / height of the tight box of an (H, W) mask; 1 where it is empty."""
    if not mask.any():
        return 1.0
    box = Box.from_mask(mask)
    return box.width / box.height


def compare(
    photo: NDArray[np.float32], renders: ViewMaps, *, aspect: float | None = None, tolerance: int = 0
) -> FloatArray:
    """Scores of one crop against all renders that compete for it.

    Args:
        photo: (112, 14, 14) map of the crop.
        renders: N renders: all CADs, and all rotations of a bracket, at once.
        aspect: Width / height of the photo's box; None leaves the aspect term out.
        tolerance: A cell of the render may meet the best of the photo's cells so many cells away; 1 is
            the 3 x 3 neighbourhood. It forgives an inexact rotation and blurs the differences of CADs.

    Returns:
        (N,) scores, higher is better; at most 1. Comparable within one call only, because the mean that is
        taken away belongs to these renders.

    Raises:
        ValueError: a shape is wrong, there is no render, or ``aspect`` is not positive.
    """
    if photo.shape != (CHANNELS16, _CELLS, _CELLS) or not len(renders):
        raise ValueError(f"expected a ({CHANNELS16}, {_CELLS}, {_CELLS}) map and at least one render")
    if aspect is not None and not (np.isfinite(aspect) and aspect > 0):
        raise ValueError(f"aspect {aspect} must be positive")
    mean = _cell_mean(renders.maps)
    query = _unit_channels(photo[None] - mean)[0]
    templates = _unit_channels(renders.maps - mean)
    similarity = _cell_cosine(query, templates, tolerance)
    weight = renders.cover.sum(axis=(1, 2), dtype=np.float64)
    total = (similarity * renders.cover).sum(axis=(1, 2), dtype=np.float64)
    # A render that covers nothing is no match: as bad as a cosine can be.
    scores = np.where(weight > 0, total / np.maximum(weight, 1e-9), -1.0)
    if aspect is not None:
        scores = scores - ASPECT_WEIGHT * np.abs(np.log(aspect / renders.aspect))
    return np.asarray(scores, np.float64)


class AlignedCosine:
    """A :class:`cadpose.similarity.SimilarityMeasure` over :func:`compare`.

    Args:
        encoder: The process's shared Lite0 if None.
        tolerance: See :func:`compare`.
    """

    name = "lite0-aligned"

    def __init__(self, encoder: Lite0 | None = None, tolerance: int = 0) -> None:
        self.encoder = lite0() if encoder is None else encoder
        self.tolerance = tolerance

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        """(N,) scores; see :class:`cadpose.similarity.SimilarityMeasure`.

        The mask only gives the box's aspect where ``aspect`` is None: cutting the photo's background out
        was measured to cost accuracy.
        """
        if aspect is None and mask is not None and mask.any():
            aspect = mask_aspect(mask)
        photo = describe_crop(crop, self.encoder)
        renders = describe_views(views, self.encoder)
        return compare(photo, renders, aspect=aspect, tolerance=self.tolerance)


def _cell_mean(maps: NDArray[np.float32]) -> NDArray[np.float32]:
    """(112, 14, 14) mean over the renders, drawn towards the mean over all cells."""
    n = len(maps)
    everywhere = maps.mean(axis=(0, 2, 3), dtype=np.float64)[:, None, None]
    mean = (maps.sum(axis=0, dtype=np.float64) + PRIOR_RENDERS * everywhere) / (n + PRIOR_RENDERS)
    return np.asarray(mean, np.float32)


def _unit_channels(maps: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, C, 14, 14) to (N, 14, 14, C) of unit length a cell."""
    return unit(np.ascontiguousarray(maps.transpose(0, 2, 3, 1)))


def _cell_cosine(
    query: NDArray[np.float32], templates: NDArray[np.float32], tolerance: int
) -> NDArray[np.float32]:
    """(N, 14, 14) cosines; the best of the query's cells within ``tolerance``."""
    size = query.shape[0]
    padded = np.zeros((size + 2 * tolerance, size + 2 * tolerance, query.shape[2]), np.float32)
    padded[tolerance : tolerance + size, tolerance : tolerance + size] = query
    best = np.full(templates.shape[:3], -1.0, np.float32)
    for dy in range(2 * tolerance + 1):
        for dx in range(2 * tolerance + 1):
            shifted = padded[dy : dy + size, dx : dx + size]
            np.maximum(best, np.einsum("nyxc,yxc->nyx", templates, shifted), out=best)
    return best
