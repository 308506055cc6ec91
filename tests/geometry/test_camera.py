from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import T_Z, Cameras, projected_rectangle, require_rotation
from cadpose.geometry.frames import FloatArray
from tests.geometry.strategies import points, rotations

focals = st.floats(50.0, 5000.0)


def camera(R: FloatArray, **changes: object) -> Cameras:
    options: dict[str, object] = {"focal_px": 300.0, "width": 400, "height": 200} | changes
    return Cameras.from_rotations(R, **options)  # type: ignore[arg-type]


def test_equations_4_to_9_against_numbers_worked_by_hand() -> None:
    """P_W = (right, up, -front) in ShapeNet axes; P'_W = R·P_W; P_C = P'_W + (0, 0, 2)."""
    # Azimuth 0: right to image left, up to -y, front nearer: P_C = (-0.1, -0.2, 1.6),
    # p = (300·-0.1/1.6 + 200, 300·-0.2/1.6 + 100).
    front = camera(rotation_from_angles(0.0, 0.0))
    np.testing.assert_allclose(front.project(np.array([[0.1, 0.2, -0.4]]))[0, 0], [181.25, 62.5])
    # Azimuth 90: front to image left, own left towards the camera: P'_W = (-0.4, -0.2, 0.1).
    side = camera(rotation_from_angles(90.0, 0.0))
    np.testing.assert_allclose(
        side.project(np.array([[0.1, 0.2, -0.4]]))[0, 0],
        [200.0 - 300.0 * 0.4 / 2.1, 100.0 - 300.0 * 0.2 / 2.1],
    )
    # Elevation 90, from above: front to the image's bottom, own right to image left, up to the camera.
    above = camera(rotation_from_angles(0.0, 90.0))
    np.testing.assert_allclose(
        above.project(np.array([[0.1, 0.2, -0.4]]))[0, 0],
        [200.0 - 300.0 * 0.1 / 1.8, 100.0 + 300.0 * 0.4 / 1.8],
    )


@given(rotations, points(), focals, st.tuples(st.floats(-50, 450), st.floats(-50, 250)))
def test_projection_is_the_corrected_equation_8(
    R: FloatArray, object_points: FloatArray, focal: float, principal: tuple[float, float]
) -> None:
    seen = camera(R, focal_px=focal, principal_px=principal).project(object_points)[0]
    turned = object_points @ R.T
    ox, oy = principal
    np.testing.assert_allclose(seen[:, 0], focal * turned[:, 0] / (turned[:, 2] + 2.0) + ox, atol=1e-8)
    np.testing.assert_allclose(seen[:, 1], focal * turned[:, 1] / (turned[:, 2] + 2.0) + oy, atol=1e-8)


@given(rotations, points(), focals)
def test_intrinsics_of_equation_2_give_the_same_pixels(
    R: FloatArray, object_points: FloatArray, focal: float
) -> None:
    cameras = camera(R, focal_px=focal, principal_px=(120.0, 30.0))
    s_p = cameras.K[0] @ (cameras.R_cv_from_s[0] @ object_points.T + cameras.t_cv[0][:, None])
    np.testing.assert_allclose(cameras.project(object_points)[0], (s_p[:2] / s_p[2]).T, atol=1e-8)


@given(rotations)
def test_the_origin_lands_on_the_principal_point(R: FloatArray) -> None:
    np.testing.assert_allclose(camera(R, principal_px=(7.0, 9.0)).project(np.zeros((1, 3)))[0, 0], [7.0, 9.0])


def test_the_principal_point_defaults_to_the_middle_and_t_z_to_two() -> None:
    cameras = camera(np.eye(3))
    np.testing.assert_array_equal(cameras.principal_px, [[200.0, 100.0]])
    np.testing.assert_array_equal(cameras.t_cv, [[0.0, 0.0, 2.0]])
    assert T_Z == 2.0


@given(rotations, points(), st.floats(0.2, 5.0))
def test_focal_length_scales_the_picture_about_the_principal_point(
    R: FloatArray, object_points: FloatArray, factor: float
) -> None:
    principal = np.array([60.0, 140.0])
    once = camera(R, principal_px=principal).project(object_points) - principal
    more = camera(R, principal_px=principal, focal_px=300.0 * factor).project(object_points) - principal
    np.testing.assert_allclose(more, once * factor, atol=1e-8)


def test_points_at_or_behind_the_camera_have_no_pixel() -> None:
    R = rotation_from_angles(0.0, 0.0)
    depths = np.array([[0.0, 0.0, -1.9], [0.0, 0.0, -2.0], [0.0, 0.0, -2.1]])
    seen = camera(R).project(depths)[0]
    assert np.isfinite(seen[0]).all()
    assert np.isnan(seen[1:]).all()
    with pytest.raises(ValueError, match="behind the camera"):
        projected_rectangle(R, depths)


@given(st.lists(rotations, min_size=1, max_size=4), points(), st.integers(16, 512), st.floats(0.0, 0.3))
def test_framing_fills_the_square(
    turns: list[FloatArray], object_points: FloatArray, size: int, margin: float
) -> None:
    cameras = Cameras.framing(np.stack(turns), object_points, size=size, margin=margin)
    assert (cameras.width, cameras.height, len(cameras)) == (size, size, len(turns))
    seen = cameras.project(object_points)
    low, high = seen.min(axis=1), seen.max(axis=1)
    np.testing.assert_allclose((high - low).max(axis=1), size * (1 - 2 * margin), rtol=1e-9)
    np.testing.assert_allclose((low + high) / 2, size / 2, rtol=1e-9)


@given(rotations, points(), focals)
def test_projected_rectangle_times_f_is_the_rectangle_of_the_pixels(
    R: FloatArray, object_points: FloatArray, focal: float
) -> None:
    seen = camera(R, focal_px=focal, principal_px=(0.0, 0.0)).project(object_points)[0]
    rectangle = projected_rectangle(R, object_points)
    assert rectangle.shape == (1, 4)
    np.testing.assert_allclose(
        rectangle[0] * focal, np.concatenate([seen.min(axis=0), seen.max(axis=0)]), atol=1e-8
    )


@given(rotations, st.integers(0, 2**32 - 1))
def test_corners_of_triangles_hold_the_extremes_of_their_surface(R: FloatArray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.288, 0.288, (3, 3))
    surface = rng.dirichlet([1.0, 1.0, 1.0], 500) @ corners
    outer, inner = projected_rectangle(R, corners)[0], projected_rectangle(R, surface)[0]
    assert (inner[:2] >= outer[:2] - 1e-12).all()
    assert (inner[2:] <= outer[2:] + 1e-12).all()


def test_indexing_keeps_batches() -> None:
    R = rotation_from_angles([0.0, 90.0, 180.0], 10.0)
    cameras = camera(R, focal_px=[1.0, 2.0, 3.0])
    kept: list[tuple[Cameras, list[float]]] = [
        (cameras[1], [2.0]),
        (cameras[-1], [3.0]),
        (cameras[np.argmax([5, 1, 2])], [1.0]),
        (cameras[1:], [2.0, 3.0]),
        (cameras[np.array([2, 0])], [3.0, 1.0]),
        (cameras[np.array([True, False, True])], [1.0, 3.0]),
    ]
    for part, focal in kept:
        np.testing.assert_array_equal(part.focal_px, focal)
        assert len(part) == len(focal)
        np.testing.assert_array_equal(part.R_cv_from_s, R[np.array(focal, int) - 1])
    with pytest.raises(IndexError):
        cameras[3]


def test_arrays_cannot_be_written_to() -> None:
    cameras = camera(np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        cameras.focal_px[0] = 1.0


GOOD: dict[str, object] = {
    "R_cv_from_s": np.eye(3)[None],
    "t_cv": np.array([[0.0, 0.0, 2.0]]),
    "focal_px": np.array([100.0]),
    "principal_px": np.array([[50.0, 50.0]]),
    "width": 100,
    "height": 100,
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"R_cv_from_s": np.eye(3)}, r"R_cv_from_s has shape \(3, 3\), expected \(1, 3, 3\)"),
        ({"t_cv": np.zeros((2, 3))}, "t_cv has shape"),
        ({"principal_px": np.zeros(2)}, "principal_px has shape"),
        ({"focal_px": np.array([np.nan])}, "focal_px holds a value that is not finite"),
        ({"t_cv": np.array([[0.0, np.inf, 2.0]])}, "t_cv holds a value that is not finite"),
        ({"focal_px": np.array([0.0])}, "must be positive"),
        ({"focal_px": np.array([-5.0])}, "must be positive"),
        ({"width": 0}, "positive image size"),
        ({"height": -1}, "positive image size"),
        ({"R_cv_from_s": np.diag([1.0, 1.0, -1.0])[None]}, "not a rotation"),
        ({"R_cv_from_s": 2.0 * np.eye(3)[None]}, "not a rotation"),
    ],
)
def test_refuses_what_is_no_camera(change: dict[str, object], message: str) -> None:
    Cameras(**GOOD)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        Cameras(**(GOOD | change))  # type: ignore[arg-type]


def test_require_rotation_looks_at_every_matrix() -> None:
    require_rotation(rotation_from_angles([1.0, 2.0], 3.0), "R")
    with pytest.raises(ValueError, match="R is not a rotation"):
        require_rotation(np.stack([np.eye(3), np.diag([-1.0, 1.0, 1.0])]), "R")
    shear = np.eye(3)
    shear[0, 1] = math.sin(0.01)
    with pytest.raises(ValueError, match="R is not a rotation"):
        require_rotation(shear, "R")
