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

    The script asks a kd-tree, which finds the same. In 40 dimensions a tree has to look at nearly all
    descriptors, so that one product of matrices is the quicker way.

    Args:
        a: (P, D) descriptors of unit length.
        b: (Q, D) descriptors of unit length; one of them may be matched often.
        max_distance: Largest Euclidean distance (0.8 there, 0.9 where it reranks retrieved images).

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
