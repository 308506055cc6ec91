"""Pairs of local features whose descriptors are near one another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatMatrix = NDArray[np.float32]
Pairs = NDArray[np.int64]


def mutual_nearest(a: FloatMatrix, b: FloatMatrix) -> Pairs:
    """Pairs that are each other's nearest by inner product.

    Args:
        a: (P, D) descriptors of unit length.
        b: (Q, D) descriptors of unit length.

    Returns:
        (M, 2) indices into ``a`` and ``b``; of equally near ones the first counts.
    """
    if not len(a) or not len(b):
        return np.empty((0, 2), np.int64)
    similarity = a @ b.T
    forth, back = similarity.argmax(axis=1), similarity.argmax(axis=0)
    rows = np.flatnonzero(back[forth] == np.arange(len(a)))
    return np.stack([rows, forth[rows]], axis=1).astype(np.int64)


def nearest_within(a: FloatMatrix, b: FloatMatrix, max_distance: float = 0.8) -> Pairs:
    """Every descriptor of ``a`` with its nearest of ``b``, if that is near: how DELF's script matches.

    Args:
        a: (P, D) descriptors of unit length.
        b: (Q, D) descriptors of unit length; one of them may be matched often.
        max_distance: Largest Euclidean distance (0.8 there).

    Returns:
        (M, 2) indices into ``a`` and ``b``.
    """
    if not len(a) or not len(b):
        return np.empty((0, 2), np.int64)
    similarity = a @ b.T
    nearest = similarity.argmax(axis=1)
    rows = np.arange(len(a))
    # For unit vectors |a - b|² = 2 - 2 a·b.
    near = 2.0 - 2.0 * similarity[rows, nearest] <= max_distance**2
    return np.stack([rows[near], nearest[near]], axis=1).astype(np.int64)


def ratio_test(a: FloatMatrix, b: FloatMatrix, max_ratio: float = 0.8) -> Pairs:
    """Every descriptor of ``a`` whose nearest of ``b`` is clearly nearer than its second (Lowe's test).

    Returns:
        (M, 2) indices into ``a`` and ``b``; empty where ``b`` has fewer than two descriptors.
    """
    if not len(a) or len(b) < 2:
        return np.empty((0, 2), np.int64)
    squared = 2.0 - 2.0 * np.sort(a @ b.T, axis=1)[:, -2:]
    nearest = (a @ b.T).argmax(axis=1)
    clear = squared[:, 1] < max_ratio**2 * squared[:, 0]
    rows = np.flatnonzero(clear)
    return np.stack([rows, nearest[rows]], axis=1).astype(np.int64)
