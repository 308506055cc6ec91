"""Aligned maps and dense inliers together: the most accurate measure, and the one least hurt by the rotation.

The aligned cosine looks at fixed places and sees shape; RANSAC inliers of dense cells tolerate parts that
lie elsewhere. They err on different photos. Score: aligned + inliers / (most inliers of any candidate).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import Lite0, lite0
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask, Views
from cadpose.similarity.aligned import AlignedCosine
from cadpose.similarity.local_affine import AffineComparison, LocalAffine
from cadpose.similarity.local_features import DenseLite0


class Fused:
    """A :class:`cadpose.similarity.SimilarityMeasure`; give it one render a candidate.

    Renders of 224 px suffice; 448 px were measured no better. A render costs six times the aligned cosine.

    Args:
        encoder: The process's shared Lite0 if None.
        seed: RANSAC's seed.
    """

    name = "lite0-fused"

    def __init__(self, encoder: Lite0 | None = None, seed: int = 0) -> None:
        encoder = lite0() if encoder is None else encoder
        self.aligned = AlignedCosine(encoder)
        self.local = LocalAffine(DenseLite0(encoder=encoder), seed=seed)

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        """(N,) scores; see :class:`cadpose.similarity.SimilarityMeasure`."""
        return self.combine(
            self.aligned.score(crop, mask, views, aspect=aspect), self.compare(crop, views).scores["sm2"]
        )

    def compare(self, crop: NDArray[np.uint8], views: Views) -> AffineComparison:
        """The dense matches with the measures that rest on them."""
        return self.local.compare(crop, None, views)

    @staticmethod
    def combine(aligned: FloatArray, inliers: FloatArray) -> FloatArray:
        """(N,) aligned scores and (N,) inlier counts (SM2) of the same candidates to (N,) scores."""
        return np.asarray(aligned + share_of_most(inliers))


def share_of_most(counts: FloatArray) -> FloatArray:
    """(N,) counts as shares of the largest."""
    return np.asarray(counts / max(float(counts.max(initial=0.0)), 1.0))
