from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cadpose.evaluation.shape_similarity import THRESHOLD, Shapes, compare_points
from cadpose.library.catalogue import Library


def test_both_measures_are_what_a_tree_says() -> None:
    rng = np.random.default_rng(0)
    a, b = (rng.uniform(-0.3, 0.3, (n, 3)).astype(np.float32) for n in (700, 1300))
    from_a, from_b = (np.asarray(cKDTree(there).query(here)[0]) for here, there in ((a, b), (b, a)))
    told = compare_points(a, b, 0.05)
    assert told.chamfer == pytest.approx((from_a.mean() + from_b.mean()) / 2, rel=1e-4)
    precision, recall = (float(np.mean(away <= 0.05)) for away in (from_a, from_b))
    assert told.fscore == pytest.approx(2 * precision * recall / (precision + recall), abs=2e-3)


def test_extremes() -> None:
    points = np.random.default_rng(1).random((50, 3), np.float32)
    same, far = compare_points(points, points), compare_points(points, points + np.float32(5.0))
    assert same.fscore == 1.0 and same.chamfer < 1e-3
    assert far.fscore == 0.0 and far.chamfer > 5.0
    with pytest.raises(ValueError):
        compare_points(points, points[:0])


def test_models_of_a_library(small_library: Library) -> None:
    shapes = Shapes(small_library)
    cars, chairs = ([m.id for m in small_library.models(name)] for name in ("car", "chair"))
    alike, other = shapes.similarity(cars[0], cars[1]), shapes.similarity(cars[0], chairs[0])
    assert shapes.similarity(cars[1], cars[0]) == alike
    assert alike.fscore > other.fscore and alike.chamfer < other.chamfer
    # Two samples of one surface meet each other within the threshold.
    again = Shapes(small_library, seed=1)._points(cars[0])
    assert compare_points(shapes._points(cars[0]), again, THRESHOLD).fscore > 0.9
