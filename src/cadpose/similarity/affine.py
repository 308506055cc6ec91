"""A 2-D affine map between matched points by seeded RANSAC, and its inliers.

Our own loop rather than cv2.estimateAffine2D: the same answer on every machine and OpenCV version, a
count of trials and a residual as DELF's script has them, and degenerate triples refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.jit import kernel

_SAMPLE = 3
# A triple whose triangle is smaller than this (px²) in either image says nothing about a map.
_MIN_TRIANGLE = 1.0


@dataclass(frozen=True, eq=False)
class AffineFit:
    """The affine map with the most inliers.

    Attributes:
        matrix: (3, 3) homogeneous, source pixels (x, y, 1) to target pixels; None where fewer than
            three matches, or only degenerate triples, were there.
        inliers: (M,) bool over the matches; none set where there is no map.
    """

    matrix: FloatArray | None
    inliers: NDArray[np.bool_]

    @property
    def count(self) -> int:
        """Number of inliers, the paper's N_inl."""
        return int(np.count_nonzero(self.inliers))


def ransac_affine(
    source: FloatArray, target: FloatArray, *, residual_px: float, trials: int = 1000, seed: int = 0
) -> AffineFit:
    """The affine map, of those through three matches, that brings most source points near their targets.

    Among maps with equally many inliers the one with the smaller sum of squared residuals wins, then the
    first drawn. The winner is fitted once more to all its inliers by least squares, and kept if that
    loses none.

    Args:
        source: (M, 2) points (x, y).
        target: (M, 2) their matches.
        residual_px: A match is an inlier at this distance or less.
        trials: Triples drawn.
        seed: The same seed, points and trials give the same answer.

    Raises:
        ValueError: the shapes do not fit together.
    """
    source, target = np.asarray(source, np.float64), np.asarray(target, np.float64)
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] != 2:
        raise ValueError(f"points must be two (M, 2) arrays, got {source.shape} and {target.shape}")
    m = len(source)
    nothing = AffineFit(None, np.zeros(m, np.bool_))
    if m < _SAMPLE:
        return nothing
    triples = _triples(m, trials, np.random.default_rng(seed))
    triples = triples[_spread(source[triples]) & _spread(target[triples])]
    if not len(triples):
        return nothing
    # (3, 2): rows of [x y 1] times the map's transpose give the target.
    transpose = np.empty((_SAMPLE, 2))
    _best_map(np.ascontiguousarray(source), np.ascontiguousarray(target), triples, residual_px**2, transpose)
    homogeneous = np.concatenate([source, np.ones((m, 1))], axis=1)

    def within(map_transpose: FloatArray) -> NDArray[np.bool_]:
        return np.asarray(((homogeneous @ map_transpose - target) ** 2).sum(axis=1) <= residual_px**2)

    inliers = within(transpose)
    refined = np.linalg.lstsq(homogeneous[inliers], target[inliers], rcond=None)[0]
    if (refined_inliers := within(refined)).sum() >= inliers.sum():
        transpose, inliers = refined, refined_inliers
    matrix = np.eye(3)
    matrix[:2] = transpose.T
    return AffineFit(matrix, inliers)


@kernel
def _best_map(
    source: FloatArray, target: FloatArray, triples: NDArray[np.int64], most: float, out: FloatArray
) -> None:
    """The (3, 2) map with the most points whose squared residual is ``most`` or less; see above for ties."""
    best_count, best_cost = -1, 0.0
    one = np.empty((3, 2))
    for t in range(triples.shape[0]):
        i, j, k = triples[t, 0], triples[t, 1], triples[t, 2]
        # The linear part sends two sides of one triangle to those of the other.
        ax, ay = source[j, 0] - source[i, 0], source[j, 1] - source[i, 1]
        bx, by = source[k, 0] - source[i, 0], source[k, 1] - source[i, 1]
        area = ax * by - ay * bx
        for c in range(2):
            a, b = target[j, c] - target[i, c], target[k, c] - target[i, c]
            one[0, c] = (a * by - b * ay) / area
            one[1, c] = (b * ax - a * bx) / area
            one[2, c] = target[i, c] - one[0, c] * source[i, 0] - one[1, c] * source[i, 1]
        count, cost = 0, 0.0
        for p in range(source.shape[0]):
            x = source[p, 0] * one[0, 0] + source[p, 1] * one[1, 0] + one[2, 0] - target[p, 0]
            y = source[p, 0] * one[0, 1] + source[p, 1] * one[1, 1] + one[2, 1] - target[p, 1]
            squared = x * x + y * y
            if squared <= most:
                count += 1
                cost += squared
        if count > best_count or (count == best_count and cost < best_cost):
            best_count, best_cost = count, cost
            out[:] = one


def _triples(m: int, trials: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """(T, 3) indices, distinct within a row."""
    first = rng.integers(0, m, trials)
    second = rng.integers(0, m - 1, trials)
    second += second >= first
    low, high = np.minimum(first, second), np.maximum(first, second)
    third = rng.integers(0, m - 2, trials)
    third += third >= low
    third += third >= high
    return np.stack([first, second, third], axis=1)


def _spread(triangles: FloatArray) -> NDArray[np.bool_]:
    """(T, 3, 2) corners to (T,): does the triangle have an area?"""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2.0 >= _MIN_TRIANGLE
