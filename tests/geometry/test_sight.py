from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import geodesic_degrees
from cadpose.geometry.sight import allocentric_rotation, egocentric_rotation, turn_to_sight
from tests.geometry.strategies import rotations

pixels = st.tuples(st.floats(-2000, 4000), st.floats(-2000, 4000))


@given(pixels, st.floats(50, 5000))
def test_the_turn_puts_the_line_of_sight_on_the_axis(pixel: tuple[float, float], focal: float) -> None:
    turn = turn_to_sight(pixel, focal, (500, 400))
    sight = np.array([pixel[0] - 500, pixel[1] - 400, focal])
    np.testing.assert_allclose(turn @ sight, np.array([0, 0, np.linalg.norm(sight)]), atol=1e-6)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    # No turn that does so is smaller: it is the angle off the axis.
    off_axis = np.rad2deg(np.arctan2(np.hypot(sight[0], sight[1]), focal))
    assert geodesic_degrees(turn, np.eye(3)) == pytest.approx(off_axis, abs=1e-5)


@given(rotations, pixels, st.floats(50, 5000))
def test_there_and_back(R: np.ndarray, pixel: tuple[float, float], focal: float) -> None:
    turned = allocentric_rotation(R, pixel, focal, (500, 400))
    np.testing.assert_allclose(egocentric_rotation(turned, pixel, focal, (500, 400)), R, atol=1e-9)


def test_an_object_in_the_middle_is_seen_as_it_is() -> None:
    np.testing.assert_allclose(turn_to_sight((500, 400), 700.0, (500, 400)), np.eye(3))
    # For an object at the right the camera turns to the right: its old x axis now points forward, too.
    assert (turn_to_sight((600, 400), 100.0, (500, 400)) @ [1, 0, 0])[2] > 0.7


@pytest.mark.parametrize("focal", [0.0, -1.0, np.nan, np.inf])
def test_a_focal_length_that_is_none(focal: float) -> None:
    with pytest.raises(ValueError, match="no line of sight"):
        turn_to_sight((1, 2), focal, (0, 0))
