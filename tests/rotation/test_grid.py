from __future__ import annotations

import numpy as np
import pytest

from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.records import Rotation
from cadpose.rotation.grid import grid_angles, grid_distances, grid_rotations


def test_rotations_are_those_of_the_angles() -> None:
    angles, rotations = grid_angles(), grid_rotations()
    assert rotations.shape == (len(angles), 3, 3)
    for row, R in zip(angles, rotations, strict=True):
        assert Rotation(*row).error_to(Rotation.from_matrix(R)) < 1e-6


def test_distances_are_a_metric_in_degrees() -> None:
    D = grid_distances()
    assert D.shape == (len(grid_angles()),) * 2
    np.testing.assert_allclose(D, D.T, atol=1e-9)
    np.testing.assert_allclose(np.diag(D), 0.0, atol=1e-5)
    off = D[~np.eye(len(D), dtype=bool)]
    # No template is drawn twice.
    assert off.min() > 5.0
    assert off.max() <= 180.0
    rng = np.random.default_rng(0)
    i, j, k = rng.integers(len(D), size=(3, 2000))
    assert (D[i, k] <= D[i, j] + D[j, k] + 1e-6).all()


def test_distances_agree_with_the_records() -> None:
    for i, j in ((0, 1), (3, 200), (17, 17), (250, 300)):
        expected = Rotation(*grid_angles()[i]).error_to(Rotation(*grid_angles()[j]))
        assert grid_distances()[i, j] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("inplane", [-30.0, -15.0, 0.0, 15.0, 30.0])
@pytest.mark.parametrize("elevation", [0.0, 12.0, 25.0])
def test_every_usual_view_has_a_template_near(elevation: float, inplane: float) -> None:
    ring = grid_rotations()[grid_angles()[:, 2] == inplane]
    views = rotation_from_angles(np.arange(0.0, 360.0, 5.0), elevation, inplane)
    assert geodesic_degrees(views[:, None], ring).min(axis=1).max() < 16.0


def test_shared_arrays_cannot_be_changed() -> None:
    for array in (grid_angles(), grid_rotations(), grid_distances()):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
