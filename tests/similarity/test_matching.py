from __future__ import annotations

import numpy as np
import pytest

from cadpose.similarity.local_features import unit
from cadpose.similarity.matching import mutual_nearest, nearest_within


def descriptors(n: int, d: int = 16, seed: int = 0) -> np.ndarray:
    return unit(np.random.default_rng(seed).normal(size=(n, d)).astype(np.float32))


def test_mutual_nearest_finds_a_permutation() -> None:
    a = descriptors(30)
    order = np.random.default_rng(1).permutation(30)
    pairs = mutual_nearest(a, a[order])
    assert len(pairs) == 30
    np.testing.assert_array_equal(order[pairs[:, 1]], pairs[:, 0])


def test_mutual_nearest_is_symmetric_and_one_to_one() -> None:
    a, b = descriptors(40), descriptors(25, seed=2)
    forth = {tuple(p) for p in mutual_nearest(a, b)}
    back = {(j, i) for i, j in mutual_nearest(b, a)}
    assert forth == back
    assert len({i for i, _ in forth}) == len({j for _, j in forth}) == len(forth)


def test_nearest_within_is_one_directional_with_a_distance() -> None:
    b = np.eye(3, dtype=np.float32)
    a = unit(np.array([[1, 0.1, 0], [1, 0, 0.2], [1, 1, 1]], np.float32))
    np.testing.assert_array_equal(nearest_within(a, b, 0.8), [[0, 0], [1, 0]])
    # (1, 1, 1) is sqrt(2 - 2/sqrt 3) = 0.919 away from each.
    assert len(nearest_within(a, b, 0.92)) == 3
    assert len(mutual_nearest(a, b)) < 3


@pytest.mark.parametrize("distance", [0.6, 0.8, 0.9])
def test_nearest_within_finds_what_delfs_kd_tree_finds(distance: float) -> None:
    spatial = pytest.importorskip("scipy.spatial")
    rng = np.random.default_rng(4)
    b = descriptors(300, d=40, seed=5)
    a = unit((b[rng.integers(0, 300, 500)] + 0.12 * rng.normal(size=(500, 40))).astype(np.float32))
    found, nearest = spatial.cKDTree(b).query(a, distance_upper_bound=distance)
    rows = np.flatnonzero(np.isfinite(found))
    assert 0 < len(rows) < 500
    np.testing.assert_array_equal(nearest_within(a, b, distance), np.stack([rows, nearest[rows]], axis=1))


def test_nothing_to_match() -> None:
    none, some = np.empty((0, 16), np.float32), descriptors(3)
    for match in (mutual_nearest, nearest_within):
        assert match(none, some).shape == (0, 2)
        assert match(some, none).shape == (0, 2)
