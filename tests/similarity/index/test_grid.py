from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.records import Rotation
from cadpose.similarity.index.grid import ViewGrid


def test_views_are_counted_and_even() -> None:
    grid = ViewGrid(6, (10.0, 40.0))
    assert len(grid) == 12 == len(grid.rotations)
    assert sorted(set(grid.angles[:, 0])) == [0, 60, 120, 180, 240, 300]


def test_the_nearest_views_lie_about_a_rotation() -> None:
    grid = ViewGrid(8, (0.0, 30.0))
    near = {tuple(a) for a in grid.angles[grid.nearest([Rotation(352.0, 12.0, 20.0)])]}
    assert near == {(0, 0), (315, 0), (0, 30), (315, 30)}


def test_without_a_rotation_all_views_take_part_and_with_two_those_of_both() -> None:
    grid = ViewGrid(8, (0.0, 30.0))
    np.testing.assert_array_equal(grid.nearest([]), np.arange(16))
    both = grid.nearest([Rotation(20.0, 10.0), Rotation(200.0, 10.0)])
    assert set(both) == set(grid.nearest([Rotation(20.0, 10.0)])) | set(grid.nearest([Rotation(200.0, 10.0)]))


@given(st.floats(0, 359.9), st.floats(0, 35))
def test_some_view_is_always_near(azimuth: float, elevation: float) -> None:
    grid = ViewGrid()
    away = min(
        Rotation(*grid.angles[view]).error_to(Rotation(azimuth, elevation))
        for view in grid.nearest([Rotation(azimuth, elevation)])
    )
    assert away <= 25.0


@pytest.mark.parametrize("azimuths, elevations", [(0, (0.0,)), (8, ()), (8, (91.0,)), (200, (0.0, 10.0))])
def test_grids_that_are_none_are_refused(azimuths: int, elevations: tuple[float, ...]) -> None:
    with pytest.raises(ValueError):
        ViewGrid(azimuths, elevations)
