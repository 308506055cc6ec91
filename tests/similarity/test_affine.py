from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cadpose.similarity.affine import ransac_affine


def scene(seed: int, n: int = 60, outliers: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    matrix = np.eye(3)
    matrix[:2] = np.array([[1.1, 0.1, -8.0], [-0.15, 0.9, 12.0]]) + rng.normal(0, 0.05, (2, 3))
    source = rng.uniform(0, 224, (n + outliers, 2))
    target = source @ matrix[:2, :2].T + matrix[:2, 2]
    target[n:] += rng.choice([-1, 1], (outliers, 2)) * rng.uniform(60, 300, (outliers, 2))
    return source, target, matrix


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_finds_the_map_under_forty_percent_outliers(seed: int) -> None:
    source, target, matrix = scene(seed)
    fit = ransac_affine(source, target, residual_px=3.0)
    assert fit.matrix is not None
    np.testing.assert_allclose(fit.matrix, matrix, atol=1e-6)
    assert fit.inliers[:60].all()
    assert fit.count == 60


def test_same_seed_same_answer_other_seed_may_differ() -> None:
    rng = np.random.default_rng(5)
    source, target = rng.uniform(0, 224, (2, 80, 2))
    first = ransac_affine(source, target, residual_px=20.0, trials=50, seed=1)
    again = ransac_affine(source, target, residual_px=20.0, trials=50, seed=1)
    other = ransac_affine(source, target, residual_px=20.0, trials=50, seed=2)
    assert first.matrix is not None and again.matrix is not None and other.matrix is not None
    np.testing.assert_array_equal(first.matrix, again.matrix)
    np.testing.assert_array_equal(first.inliers, again.inliers)
    assert not np.array_equal(first.matrix, other.matrix)


def test_inliers_lie_within_the_residual() -> None:
    rng = np.random.default_rng(9)
    source = rng.uniform(0, 224, (70, 2))
    target = source + rng.normal(0, 15, (70, 2))
    fit = ransac_affine(source, target, residual_px=20.0)
    assert fit.matrix is not None
    distance = np.linalg.norm(source @ fit.matrix[:2, :2].T + fit.matrix[:2, 2] - target, axis=1)
    np.testing.assert_array_equal(fit.inliers, distance <= 20.0)
    assert 0 < fit.count < 70


@pytest.mark.parametrize("n", [0, 1, 2])
def test_fewer_than_three_matches_give_no_map(n: int) -> None:
    points = np.arange(2.0 * n).reshape(n, 2)
    fit = ransac_affine(points, points, residual_px=5.0)
    assert fit.matrix is None
    assert fit.inliers.shape == (n,)
    assert fit.count == 0


def test_points_on_a_line_give_no_map() -> None:
    line = np.stack([np.arange(20.0), 2 * np.arange(20.0)], axis=1)
    assert ransac_affine(line, line, residual_px=5.0).matrix is None


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="points"):
        ransac_affine(np.zeros((4, 2)), np.zeros((5, 2)), residual_px=1.0)
