from __future__ import annotations

import numpy as np

from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.aligned import AlignedCosine
from cadpose.similarity.fused import Fused
from tests.similarity.shapes import five_views, photo_of


def test_fused_is_aligned_plus_the_share_of_inliers() -> None:
    measure: SimilarityMeasure = Fused()
    scores = measure.score(photo_of(1), None, five_views(), aspect=1.4)
    assert int(scores.argmax()) == 1
    inliers = Fused().compare(photo_of(1), five_views()).scores["sm2"]
    aligned = AlignedCosine().score(photo_of(1), None, five_views(), aspect=1.4)
    np.testing.assert_allclose(scores, aligned + inliers / inliers.max())


def test_without_any_inlier_the_aligned_score_is_left() -> None:
    aligned = np.array([0.2, -0.1])
    np.testing.assert_array_equal(Fused.combine(aligned, np.zeros(2)), aligned)
