"""The paper's similarity measures SM1, SM2 and SM3 (Eq. 10-12), and size-normalised variants.

    epsilon_k = sum_ij | A_ij / max(A) - I_ij |          A: 3x3 affine map photo to k-th render
    SM1:  N_inl of the renders with the five smallest epsilon, others out
    SM2:  N_inl
    SM3:  (1 - 0.35 · sigmoid(epsilon)) · N_inl

As printed, max(A) is the largest entry of the homogeneous matrix, usually the translation in pixels, so
epsilon depends on the crop's size. epsilon >= 0 puts the sigmoid into [0.5, 1) and SM3's factor into
(0.65, 0.825]. The functions without ``normalised`` keep all that; the others first divide the translation
by the image's side, which makes max(A) about 1 and epsilon free of the unit of length.

What the paper leaves open is decided so. A render without a map has epsilon = +inf and N_inl = 0: SM2 and
SM3 are 0, SM1 never pre-selects it. Renders tied at the fifth smallest epsilon: the earlier in the list is
pre-selected. Those that SM1 leaves out score N_inl - (1 + largest N_inl) < 0, below every selected one, so
that inliers still order the places after them. max(A) is at least 1, the matrix's last entry.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cadpose.geometry.frames import FloatArray
from cadpose.similarity.affine import AffineFit

#: alpha of Eq. 12.
ALPHA = 0.35
#: How many renders SM1 pre-selects.
PRESELECTED = 5


def epsilon(matrix: FloatArray | None) -> float:
    """Eq. 10 for one (3, 3) affine matrix with pixel translation; +inf where there is none."""
    if matrix is None:
        return float("inf")
    return float(np.abs(matrix / matrix.max() - np.eye(3)).sum())


def epsilon_normalised(matrix: FloatArray | None, side: float) -> float:
    """Eq. 10 after the translation was divided by the image's side in pixels."""
    if matrix is None:
        return float("inf")
    scaled = matrix.copy()
    scaled[:2, 2] /= side
    return epsilon(scaled)


def sm1(fits: Sequence[AffineFit]) -> FloatArray:
    """Eq. 10: (N,) inliers of the five renders with the smallest epsilon; the others negative."""
    return _preselected(_counts(fits), np.array([epsilon(f.matrix) for f in fits]))


def sm2(fits: Sequence[AffineFit]) -> FloatArray:
    """Eq. 11: (N,) inliers."""
    return _counts(fits)


def sm3(fits: Sequence[AffineFit]) -> FloatArray:
    """Eq. 12: (N,) inliers weakened by the map's distance from the identity."""
    return _weakened(_counts(fits), np.array([epsilon(f.matrix) for f in fits]))


def sm1_normalised(fits: Sequence[AffineFit], side: float) -> FloatArray:
    """SM1 with the translation in image sides."""
    return _preselected(_counts(fits), np.array([epsilon_normalised(f.matrix, side) for f in fits]))


def sm3_normalised(fits: Sequence[AffineFit], side: float) -> FloatArray:
    """SM3 with the translation in image sides."""
    return _weakened(_counts(fits), np.array([epsilon_normalised(f.matrix, side) for f in fits]))


def _counts(fits: Sequence[AffineFit]) -> FloatArray:
    return np.array([float(f.count) for f in fits], np.float64)


def _preselected(counts: FloatArray, eps: FloatArray) -> FloatArray:
    selected = np.zeros(len(counts), np.bool_)
    selected[np.argsort(eps, kind="stable")[:PRESELECTED]] = True
    # A render without a map cannot be pre-selected, even where fewer than five have one.
    selected &= np.isfinite(eps)
    return np.where(selected, counts, counts - (1.0 + counts.max(initial=0.0)))


def _weakened(counts: FloatArray, eps: FloatArray) -> FloatArray:
    return (1.0 - ALPHA / (1.0 + np.exp(-eps))) * counts
