"""Points on a mesh's surface (the paper's CloudCompare step) and the shape descriptor made from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.library.mesh import FloatArray, Mesh

_CELLS = 10
_DESCRIPTOR_POINTS = 8192
_BLOCK = 256
_MOST_CENTRES = 10_000
"""The most typical row is looked for among so many: the time grows with their number times all."""


def sample_surface(mesh: Mesh, count: int, seed: int = 0) -> NDArray[np.float32]:
    """Points drawn uniformly by area.

    Args:
        mesh: Any mesh with some area.
        count: Number of points.
        seed: Same seed, same points.

    Returns:
        (count, 3) float32 in the mesh's axes.
    """
    return sample_faces(mesh, count, seed)[0]


def sample_faces(
    mesh: Mesh, count: int, seed: int = 0
) -> tuple[NDArray[np.float32], NDArray[np.intp], FloatArray]:
    """`sample_surface`, and where on the mesh each point lies.

    Returns:
        (count, 3) float32 points, (count,) the triangle of each, (count, 3) its barycentric coordinates.
    """
    rng = np.random.default_rng(seed)
    triangles = mesh.vertices.astype(np.float64)[mesh.faces]
    edge1, edge2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    cumulative = np.cumsum(np.linalg.norm(np.cross(edge1, edge2), axis=1))
    pick = np.searchsorted(cumulative, rng.random(count) * cumulative[-1], side="right")
    pick = np.minimum(pick, len(cumulative) - 1)
    u, v = rng.random((2, count))
    over = u + v > 1.0
    u[over], v[over] = 1.0 - u[over], 1.0 - v[over]
    points = triangles[pick, 0] + u[:, None] * edge1[pick] + v[:, None] * edge2[pick]
    return np.asarray(points, dtype=np.float32), pick, np.stack([1.0 - u - v, u, v], axis=1)


def shape_descriptor(mesh: Mesh) -> NDArray[np.float32]:
    """What a normalised model's shape is like, for comparing models of one category.

    The square roots of a blurred 10 x 10 x 10 histogram of surface points in the cube of side 1, so that
    the Euclidean distance is Hellinger's (0 for equal shapes, sqrt 2 for disjoint ones), followed by the
    three box sides, which tell proportions more sharply than the cells do.

    Returns:
        (1003,) float32.
    """
    points = sample_surface(mesh, _DESCRIPTOR_POINTS, seed=0)
    cell = np.clip(((points + 0.5) * _CELLS).astype(np.int64), 0, _CELLS - 1)
    flat = (cell[:, 0] * _CELLS + cell[:, 1]) * _CELLS + cell[:, 2]
    grid = np.bincount(flat, minlength=_CELLS**3).reshape((_CELLS,) * 3).astype(np.float64)
    grid = _blurred(grid)
    low, high = mesh.bounds
    return np.concatenate([np.sqrt(grid / grid.sum()).ravel(), high - low]).astype(np.float32)


def _blurred(grid: FloatArray) -> FloatArray:
    """A Gaussian of 0.6 cells along each axis, the border going on, so that a nudge changes little."""
    side, middle = np.exp(-0.5 / 0.6**2), 1.0
    for axis in range(grid.ndim):
        padded = np.pad(grid, [(1, 1) if i == axis else (0, 0) for i in range(grid.ndim)], mode="edge")
        before, after = (np.roll(padded, shift, axis) for shift in (1, -1))
        blurred = (middle * padded + side * (before + after)) / (middle + 2.0 * side)
        grid = np.take(blurred, np.arange(1, padded.shape[axis] - 1), axis)
    return grid


def _mean_distances(rows: FloatArray) -> FloatArray:
    """Mean Euclidean distance of the first rows to all rows: matrix products, a few megabytes at a time."""
    square = np.einsum("ij,ij->i", rows, rows)
    mean = np.empty(min(len(rows), _MOST_CENTRES))
    for start in range(0, len(mean), _BLOCK):
        block = slice(start, min(start + _BLOCK, len(mean)))
        table = rows[block] @ rows.T
        table *= -2.0
        table += square
        table += square[block, None]
        mean[block] = np.sqrt(np.maximum(table, 0.0, out=table), out=table).mean(axis=1)
    return mean


def farthest_points(descriptors: NDArray[np.float32], count: int, least: float = 0.0) -> list[int]:
    """The most typical row, then always the row farthest from those chosen.

    Args:
        descriptors: (N, D).
        count: How many to choose at most.
        least: Stop when no row is farther than this from all chosen ones: no near duplicates.

    Returns:
        Row numbers in the order chosen; ties go to the lowest number.
    """
    if not len(descriptors):
        return []
    rows = descriptors.astype(np.float64)
    mean = _mean_distances(rows)
    # Rounding differs from one processor to the next; what it alone parts counts as a tie.
    chosen = [int(np.argmax(mean <= mean.min() + 1e-6))]
    nearest = np.linalg.norm(rows - rows[chosen[0]], axis=1)
    while len(chosen) < min(count, len(rows)):
        best = int(nearest.argmax())
        if nearest[best] <= least:
            break
        chosen.append(best)
        nearest = np.minimum(nearest, np.linalg.norm(rows - rows[best], axis=1))
    return chosen
