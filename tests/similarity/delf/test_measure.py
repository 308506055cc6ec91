from __future__ import annotations

import numpy as np
import pytest

from cadpose.errors import DependencyError
from cadpose.similarity.affine import ransac_affine
from cadpose.similarity.delf import features as module
from cadpose.similarity.delf.features import Delf
from cadpose.similarity.delf.parameters import Parameters
from cadpose.similarity.local_affine import LocalAffine
from cadpose.similarity.local_features import BACKGROUND, unit
from cadpose.similarity.measures import epsilon
from tests.similarity.shapes import five_views

pytest.importorskip("torch")


def test_the_scripts_numbers_in_pixels_of_the_enlarged_image(made: Parameters) -> None:
    measure = LocalAffine.delf("sm1", seed=3, features=Delf(made))
    assert (measure.name, measure.measure, measure.seed) == ("made-up-sm1", "sm1", 3)
    assert (measure.residual_px, measure.trials) == (20.0 * 224 / 512, 1000)
    assert LocalAffine.delf(features=Delf(made, side=1024)).residual_px == 20.0 * 224 / 1024
    again = LocalAffine.delf(features=Delf(made), reranking=True)
    assert again.residual_px == 10.0 * 224 / 512
    # 0.85 away: too far for match_images.py, near enough for image_reranking.py.
    angle = 2 * np.arcsin(0.85 / 2)
    a, b = np.array([[1, 0]], np.float32), unit(np.array([[np.cos(angle), np.sin(angle)]], np.float32))
    assert len(measure.matcher(a, b)) == 0 and len(again.matcher(a, b)) == 1
    assert len(measure.matcher(a, a)) == 1
    # One-directional: several may find the same.
    assert len(measure.matcher(np.repeat(a, 3, axis=0), a)) == 3


def test_without_the_weights_it_is_refused() -> None:
    with pytest.raises(DependencyError, match="delf_gld_20190411"):
        LocalAffine.delf()


def test_a_view_matches_itself_best(made: Parameters, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SCALES", (0.5,))
    views = five_views().take([0, 1])
    measure = LocalAffine.delf(features=Delf(made, least_score=0.0))
    comparison = measure.compare(views.over(BACKGROUND)[1], views.mask[1], views)
    scores = comparison.scores["sm2"]
    assert scores[1] > scores[0] and scores[1] > 20
    same = comparison.matches[1]
    np.testing.assert_array_equal(same.crop_xy, same.view_xy)
    assert same.fit.inliers.all() and same.fit.matrix is not None
    np.testing.assert_allclose(same.fit.matrix, np.eye(3), atol=1e-6)


def test_row_and_column_may_be_exchanged() -> None:
    """DELF's scripts have (row, column), we (x, y): the same inliers, the same epsilon."""
    rng = np.random.default_rng(0)
    a = rng.uniform(0, 224, (60, 2))
    b = a @ np.array([[0.9, 0.2], [-0.3, 1.1]]) + (12.0, -5.0) + rng.normal(0, 3, (60, 2))
    one = ransac_affine(a, b, residual_px=8.75)
    other = ransac_affine(a[:, ::-1], b[:, ::-1], residual_px=8.75)
    np.testing.assert_array_equal(one.inliers, other.inliers)
    assert epsilon(one.matrix) == pytest.approx(epsilon(other.matrix))
