from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from cadpose.geometry.angles import (
    angles_from_rotation,
    azimuth_error,
    flip_angles,
    geodesic_degrees,
    rotation_from_angles,
    wrap180,
    wrap360,
)
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from tests.geometry.strategies import azimuths, elevations, inplanes, points, rotations

RIGHT, UP, FRONT = np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2]


def project(
    point: FloatArray, azimuth: float, elevation: float = 0.0, inplane: float = 0.0, size: int = 200
) -> FloatArray:
    """Pixels of one small step along ``point``, seen in the middle of a square image."""
    cameras = Cameras.from_rotations(
        rotation_from_angles(azimuth, elevation, inplane), focal_px=size, width=size, height=size
    )
    return np.asarray(cameras.project(np.atleast_2d(point) * 0.3)[0] - size / 2)


@given(rotations)
def test_is_a_proper_rotation(R: FloatArray) -> None:
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-12)


def test_broadcasts_over_batches() -> None:
    R = rotation_from_angles([[0.0], [90.0]], [10.0, 20.0, 30.0], 5.0)
    assert R.shape == (2, 3, 3, 3)
    np.testing.assert_allclose(R[1, 2], rotation_from_angles(90.0, 30.0, 5.0), atol=1e-15)
    azimuth, elevation, inplane = angles_from_rotation(R)
    np.testing.assert_allclose(azimuth, [[0.0] * 3, [90.0] * 3], atol=1e-9)
    np.testing.assert_allclose(elevation, [[10.0, 20.0, 30.0]] * 2)
    np.testing.assert_allclose(inplane, 5.0)


# The axioms of the convention, each on a point that anyone can picture.


def test_azimuth_0_is_the_front_view() -> None:
    x, y = project(RIGHT, 0.0)[0]
    assert x < -20 and y == pytest.approx(0.0, abs=1e-9), "the object's own right appears at image left"
    assert (rotation_from_angles(0.0, 0.0) @ FRONT)[2] < -0.99, "the front faces the camera"


def test_azimuth_90_shows_the_own_left_side() -> None:
    x, y = project(FRONT, 90.0)[0]
    assert x < -20 and y == pytest.approx(0.0, abs=1e-9), "the front points to image left"
    assert (rotation_from_angles(90.0, 0.0) @ -RIGHT)[2] < -0.99, "the own left side faces the camera"


def test_azimuth_180_is_the_back_view() -> None:
    assert project(RIGHT, 180.0)[0, 0] > 20
    assert (rotation_from_angles(180.0, 0.0) @ FRONT)[2] > 0.99, "the front faces away"


def test_azimuth_270_shows_the_own_right_side() -> None:
    assert project(FRONT, 270.0)[0, 0] > 20, "the front points to image right"
    assert (rotation_from_angles(270.0, 0.0) @ RIGHT)[2] < -0.99, "the own right side faces the camera"


@given(azimuths, st.floats(-89.0, 89.0))
def test_up_is_up_in_the_picture(azimuth: float, elevation: float) -> None:
    x, y = project(UP, azimuth, elevation)[0]
    assert x == pytest.approx(0.0, abs=1e-9)
    assert y < 0


@given(azimuths, st.floats(0.5, 90.0))
def test_positive_elevation_shows_the_top(azimuth: float, elevation: float) -> None:
    assert (rotation_from_angles(azimuth, elevation) @ UP)[2] < 0, "the top's normal points to the camera"
    assert (rotation_from_angles(azimuth, -elevation) @ UP)[2] > 0
    # In the object's frame the camera is above: its centre is -Rᵀt.
    centre = -rotation_from_angles(azimuth, elevation).T @ np.array([0.0, 0.0, 2.0])
    assert centre[1] == pytest.approx(2.0 * math.sin(math.radians(elevation)))


@given(azimuths, elevations, inplanes, st.floats(-180.0, 180.0), points())
def test_inplane_turns_the_pixels_counter_clockwise(
    azimuth: float, elevation: float, inplane: float, turn: float, object_points: FloatArray
) -> None:
    before = project(object_points, azimuth, elevation, inplane)
    after = project(object_points, azimuth, elevation, inplane + turn)
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    # Counter-clockwise for the eye; y points down, hence the signs.
    np.testing.assert_allclose(after, before @ np.array([[c, s], [-s, c]]).T, atol=1e-9)


@pytest.mark.parametrize("turn", [20.0, -35.0, 90.0, 150.0])
def test_inplane_turns_the_image_as_pil_does(turn: float) -> None:
    size = 201
    x, y = project(np.array([0.5, 0.25, 0.0]), 30.0, 10.0, size=size)[0] + size / 2
    image = np.zeros((size, size), np.uint8)
    image[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2] = 255
    turned = np.asarray(Image.fromarray(image).rotate(turn, Image.Resampling.BILINEAR)).astype(float)
    rows, cols = np.mgrid[:size, :size] + 0.5
    seen = np.array([(cols * turned).sum(), (rows * turned).sum()]) / turned.sum()
    told = project(np.array([0.5, 0.25, 0.0]), 30.0, 10.0, turn, size=size)[0] + size / 2
    np.testing.assert_allclose(seen, told, atol=1.0)
    assert np.hypot(*(told - (x, y))) > 5, "the turn must be visible for this test to mean anything"


# The inverse.


@given(azimuths, st.floats(-89.9, 89.9), inplanes)
def test_angles_come_back(azimuth: float, elevation: float, inplane: float) -> None:
    a, e, i = angles_from_rotation(rotation_from_angles(azimuth, elevation, inplane))
    assert azimuth_error(a, azimuth) < 1e-7
    assert e == pytest.approx(elevation, abs=1e-7)
    assert azimuth_error(i, inplane) < 1e-7
    assert 0.0 <= a < 360.0
    assert -180.0 < i <= 180.0


@given(rotations)
def test_rotation_comes_back(R: FloatArray) -> None:
    back = rotation_from_angles(*angles_from_rotation(R))
    np.testing.assert_allclose(back, R, atol=1e-6)


@pytest.mark.parametrize("elevation", [90.0, -90.0])
@given(azimuth=azimuths, inplane=inplanes)
def test_straight_above_and_below_inplane_is_zero(elevation: float, azimuth: float, inplane: float) -> None:
    R = rotation_from_angles(azimuth, elevation, inplane)
    a, e, i = angles_from_rotation(R)
    assert i == 0.0
    assert e == pytest.approx(elevation, abs=1e-9)
    np.testing.assert_allclose(rotation_from_angles(a, e, i), R, atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("off", [1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-4, 1e-2])
def test_next_to_straight_above_the_rotation_comes_back(sign: float, off: float) -> None:
    R = rotation_from_angles(33.0, sign * (90.0 - off), 21.0)
    np.testing.assert_allclose(rotation_from_angles(*angles_from_rotation(R)), R, atol=1e-6)


# The horizontal flip.


@given(azimuths, elevations, inplanes, points())
def test_flip_is_exact_for_the_mirrored_model(
    azimuth: float, elevation: float, inplane: float, object_points: FloatArray
) -> None:
    seen = project(object_points, azimuth, elevation, inplane)
    a, e, i = (float(angle) for angle in flip_angles(azimuth, elevation, inplane))
    mirrored = project(object_points * [-1.0, 1.0, 1.0], a, e, i)
    np.testing.assert_allclose(mirrored, seen * [-1.0, 1.0], atol=1e-9)


@given(azimuths, elevations, inplanes)
def test_flipping_twice_changes_nothing(azimuth: float, elevation: float, inplane: float) -> None:
    twice = flip_angles(*flip_angles(azimuth, elevation, inplane))
    assert geodesic_degrees(
        rotation_from_angles(*twice), rotation_from_angles(azimuth, elevation, inplane)
    ) == pytest.approx(0.0, abs=1e-9)


# The geodesic error.


@given(rotations, rotations, rotations)
def test_geodesic_is_a_metric(A: FloatArray, B: FloatArray, C: FloatArray) -> None:
    ab, bc, ac = geodesic_degrees(A, B), geodesic_degrees(B, C), geodesic_degrees(A, C)
    assert ab == pytest.approx(float(geodesic_degrees(B, A)), abs=1e-9)
    assert 0.0 <= ab <= 180.0
    assert ac <= ab + bc + 1e-9


@given(rotations, rotations, rotations)
def test_geodesic_forgets_the_frame(A: FloatArray, B: FloatArray, Q: FloatArray) -> None:
    assert geodesic_degrees(Q @ A, Q @ B) == pytest.approx(float(geodesic_degrees(A, B)), abs=1e-6)


@given(rotations, st.floats(0.0, 180.0), st.integers(0, 2**32 - 1))
def test_geodesic_is_the_angle_of_the_turn(R: FloatArray, degrees: float, seed: int) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    radians = math.radians(degrees)
    turn = np.eye(3) + math.sin(radians) * cross + (1.0 - math.cos(radians)) * cross @ cross
    # Tight at both ends, where acos of the trace alone would lose seven digits.
    assert geodesic_degrees(R, R @ turn) == pytest.approx(degrees, abs=1e-9)


@given(rotations)
def test_geodesic_is_exact_at_both_ends(R: FloatArray) -> None:
    half_turn = np.diag([1.0, -1.0, -1.0])
    assert geodesic_degrees(R, R) == pytest.approx(0.0, abs=1e-12)
    assert geodesic_degrees(np.eye(3), half_turn) == 180.0
    assert geodesic_degrees(R, R @ half_turn) == pytest.approx(180.0, abs=1e-12)


def test_geodesic_equals_the_published_formula() -> None:
    A, B = rotation_from_angles(10.0, 20.0, 5.0), rotation_from_angles(50.0, -5.0, -12.0)
    published = math.degrees(math.acos((np.trace(A.T @ B) - 1.0) / 2.0))
    assert geodesic_degrees(A, B) == pytest.approx(published, abs=1e-9)


def test_geodesic_of_a_turn_about_the_vertical_is_the_azimuth_error() -> None:
    a, b = rotation_from_angles([0.0, 350.0, 10.0], 0.0), rotation_from_angles([90.0, 20.0, 200.0], 0.0)
    np.testing.assert_allclose(geodesic_degrees(a, b), [90.0, 30.0, 170.0], atol=1e-9)
    np.testing.assert_allclose(azimuth_error([0.0, 350.0, 10.0], [90.0, 20.0, 200.0]), [90.0, 30.0, 170.0])


# Wrapping.


@given(st.floats(-1e6, 1e6))
def test_wrapped_angles_stay_in_range_and_mean_the_same(degrees: float) -> None:
    full, half = float(wrap360(degrees)), float(wrap180(degrees))
    assert 0.0 <= full < 360.0
    assert -180.0 < half <= 180.0
    for wrapped in (full, half):
        turns = (degrees - wrapped) / 360.0
        assert turns == pytest.approx(round(turns), abs=1e-9)


def test_wrap_at_the_seams() -> None:
    assert wrap360(360.0) == 0.0
    assert wrap360(-1e-17) == 0.0
    assert wrap180(180.0) == 180.0
    assert wrap180(-180.0) == 180.0
    assert wrap180(540.0) == 180.0
