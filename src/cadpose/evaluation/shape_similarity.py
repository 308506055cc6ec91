"""How alike two shapes are: Chamfer distance and F-score between points on their surfaces.

The F-score at a threshold is the harmonic mean of precision (points of the one shape that lie within the
threshold of the other) and recall (Tatarchenko et al., What Do Single-view 3D Reconstruction Networks Learn?,
CVPR 2019). Lengths are in diagonals of the bounding box, to which all models of a library are scaled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cadpose.library.catalogue import Library
from cadpose.library.sampling import sample_surface

#: Points a shape.
POINTS = 4096
#: Distance within which a point counts as met. Two samples of one surface are closer than half of it.
THRESHOLD = 0.02
_BLOCK = 512


@dataclass(frozen=True, slots=True)
class ShapeSimilarity:
    """How alike two shapes are.

    Attributes:
        fscore: At `THRESHOLD`, in [0, 1]; higher is more alike.
        chamfer: Mean of both directions' mean distance to the nearest point, in diagonals.
    """

    fscore: float
    chamfer: float


class Shapes:
    """Compares models of a library, each sampled once.

    Args:
        library: Where the models are.
        seed: Of the points.
    """

    def __init__(self, library: Library, seed: int = 0) -> None:
        def sampled(cad: str) -> NDArray[np.float32]:
            return sample_surface(library.mesh(cad), POINTS, seed)

        self._points = lru_cache(maxsize=1024)(sampled)
        self._similarity = lru_cache(maxsize=1 << 16)(self._compared)

    def similarity(self, a: str, b: str) -> ShapeSimilarity:
        """How alike two models are, the same either way round.

        Raises:
            LibraryError: there is no such model, or its mesh is damaged.
        """
        return self._similarity(min(a, b), max(a, b))

    def _compared(self, a: str, b: str) -> ShapeSimilarity:
        return compare_points(self._points(a), self._points(b))


def compare_points(
    a: NDArray[np.float32], b: NDArray[np.float32], threshold: float = THRESHOLD
) -> ShapeSimilarity:
    """(N, 3) and (M, 3) points on two surfaces.

    Raises:
        ValueError: there is no point.
    """
    if not len(a) or not len(b):
        raise ValueError("shapes are compared by at least one point each")
    nearest_a, nearest_b = _nearest(a, b)
    precision, recall = float((nearest_a <= threshold).mean()), float((nearest_b <= threshold).mean())
    fscore = 2.0 * precision * recall / (precision + recall) if precision + recall else 0.0
    return ShapeSimilarity(fscore, float(nearest_a.mean() + nearest_b.mean()) / 2.0)


def _nearest(
    a: NDArray[np.float32], b: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance of each point to the nearest one of the other shape, a few megabytes at a time."""
    square_b = np.einsum("ij,ij->i", b, b)
    from_a, from_b = np.empty(len(a)), np.full(len(b), np.inf)
    for first in range(0, len(a), _BLOCK):
        part = a[first : first + _BLOCK]
        squares = square_b - 2.0 * (part @ b.T) + np.einsum("ij,ij->i", part, part)[:, None]
        from_a[first : first + _BLOCK] = squares.min(axis=1)
        np.minimum(from_b, squares.min(axis=0), out=from_b)
    return np.sqrt(np.maximum(from_a, 0.0)), np.sqrt(np.maximum(from_b, 0.0))
