from __future__ import annotations

import numpy as np
import pytest

from cadpose.records import Views
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.drawing import draw_matches
from cadpose.similarity.local_affine import LocalAffine
from cadpose.similarity.local_features import DenseLite0, Sift
from tests.similarity.shapes import figure, five_views, photo_of


@pytest.mark.parametrize("kind", [1, 2])
def test_dense_inliers_favour_the_true_figure(kind: int) -> None:
    measure: SimilarityMeasure = LocalAffine.dense()
    scores = measure.score(photo_of(kind), None, five_views())
    assert scores.shape == (5,)
    assert int(scores.argmax()) == kind


def test_comparison_holds_every_measure_and_the_matches_of_fig_9() -> None:
    views = five_views()
    one = LocalAffine.dense().compare(photo_of(2), None, views)
    again = LocalAffine.dense().compare(photo_of(2), None, views)
    assert set(one.scores) == {"sm1", "sm2", "sm3", "sm1_normalised", "sm3_normalised"}
    for name, scores in one.scores.items():
        np.testing.assert_array_equal(scores, again.scores[name])
    for k, match in enumerate(one.matches):
        assert match.crop_xy.shape == match.view_xy.shape == (len(match.fit.inliers), 2)
        assert one.scores["sm2"][k] == match.fit.count
    picture = draw_matches(photo_of(2), views.over()[2], one.matches[2])
    assert picture.shape == (448, 896, 3)
    plain = draw_matches(photo_of(2), views.over()[2], LocalAffine.sift().compare(
        np.full((224, 224, 3), 128, np.uint8), None, views).matches[2])  # fmt: skip
    changed = (picture != plain).any(axis=2)
    assert changed.any()
    # Lines are blue.
    assert picture[changed][:, 2].mean() > picture[changed][:, 0].mean()


def test_an_image_without_features_matches_nothing() -> None:
    flat = np.full((224, 224, 3), 128, np.uint8)
    comparison = LocalAffine.sift().compare(flat, None, five_views())
    np.testing.assert_array_equal(comparison.scores["sm2"], np.zeros(5))
    assert (comparison.scores["sm1"] < 0).all()
    assert all(m.fit.matrix is None for m in comparison.matches)


def test_an_empty_render_matches_nothing() -> None:
    rgb, alpha = figure(0)
    views = Views(
        rgb=np.stack([rgb, np.zeros_like(rgb)]),
        alpha=np.stack([alpha, np.zeros_like(alpha)]),
        depth=np.full((2, 224, 224), 2.0, np.float32),
    )
    scores = LocalAffine.dense().score(photo_of(0), None, views)
    assert scores[0] > 0
    assert scores[1] == 0


def test_features_lie_in_the_224_px_square_and_within_the_mask() -> None:
    view = five_views(320)
    for finder in (DenseLite0(), Sift()):
        for features, mask in zip(finder.describe(view.over(), view.mask), view.mask, strict=True):
            assert len(features) > 10
            assert features.xy.min() >= 0
            assert features.xy.max() <= 224
            rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            assert features.xy[:, 1].min() >= (rows[0] - 12) * 224 / 320
            assert features.xy[:, 0].max() <= (cols[-1] + 12) * 224 / 320
            np.testing.assert_allclose(np.linalg.norm(features.descriptors, axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize("size", [224, 448])
def test_sift_finds_a_blob_where_it_is(size: int) -> None:
    y, x = (np.mgrid[:size, :size] + 0.5) * 224 / size
    blob = 40 + 200 * np.exp(-((x - 80.0) ** 2 + (y - 120.0) ** 2) / (2 * 6.0**2))
    features = Sift().describe(np.repeat(blob[None, :, :, None], 3, axis=3).astype(np.uint8))[0]
    distance = np.linalg.norm(features.xy - (80.0, 120.0), axis=1)
    assert distance.min() < 0.3


def test_unknown_measure_is_refused() -> None:
    with pytest.raises(ValueError, match="sm4"):
        LocalAffine(Sift(), "sm4")  # type: ignore[arg-type]
