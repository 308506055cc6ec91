from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry import frames
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from tests.geometry.strategies import points, rotations

RIGHT, UP, FRONT = np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2]
CONSTANTS = [name for name in dir(frames) if name.startswith("R_")]
FOCAL, CX, CY = 300.0, 210.0, 90.0


@st.composite
def extrinsics(draw: st.DrawFn) -> FloatArray:
    """(4, 4) OpenCV extrinsics of an object in front of the camera, not on the optical axis."""
    T = np.eye(4)
    T[:3, :3] = draw(rotations)
    T[:3, 3] = draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.5, 0.5)), draw(st.floats(1.5, 4.0))
    return T


def pixels(T_cv_from_s: FloatArray, object_points: FloatArray) -> FloatArray:
    cameras = Cameras(
        R_cv_from_s=T_cv_from_s[None, :3, :3],
        t_cv=T_cv_from_s[None, :3, 3],
        focal_px=np.array([FOCAL]),
        principal_px=np.array([[CX, CY]]),
        width=400,
        height=200,
    )
    return np.asarray(cameras.project(object_points)[0])


@pytest.mark.parametrize("name", CONSTANTS)
def test_every_constant_is_a_rotation_that_cannot_be_written_to(name: str) -> None:
    R = getattr(frames, name)
    np.testing.assert_array_equal(R @ R.T, np.eye(3))
    assert np.linalg.det(R) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="read-only"):
        R[0, 0] = 5.0


@pytest.mark.parametrize("pair", ["p s", "cv gl", "p3d cv", "b s"])
def test_the_two_directions_undo_each_other(pair: str) -> None:
    a, b = pair.split()
    there, back = getattr(frames, f"R_{a}_from_{b}"), getattr(frames, f"R_{b}_from_{a}")
    np.testing.assert_array_equal(there @ back, np.eye(3))


def test_the_axes_of_the_table() -> None:
    """What the module's docstring says of each frame, on vectors."""
    x, y, z = np.eye(3)
    np.testing.assert_array_equal(frames.R_p_from_s @ UP, z)
    np.testing.assert_array_equal(frames.R_p_from_s @ FRONT, -y)
    np.testing.assert_array_equal(frames.R_p_from_s @ -RIGHT, x)
    np.testing.assert_array_equal(frames.R_b_from_s @ UP, z)
    np.testing.assert_array_equal(frames.R_b_from_s @ FRONT, y)
    np.testing.assert_array_equal(frames.R_b_from_s @ RIGHT, x)
    np.testing.assert_array_equal(frames.R_s_from_front_plus_z @ z, FRONT)
    np.testing.assert_array_equal(frames.R_s_from_front_plus_z @ y, UP)
    # Cameras: image right, image up, viewing direction.
    np.testing.assert_array_equal(frames.R_gl_from_cv @ [x, -y, z], np.array([x, y, -z]).T @ np.eye(3))
    for right, up, forward, R in [
        (x, y, -z, frames.R_gl_from_cv),
        (-x, y, z, frames.R_p3d_from_cv),
    ]:
        np.testing.assert_array_equal(R @ x, right)
        np.testing.assert_array_equal(R @ -y, up)
        np.testing.assert_array_equal(R @ z, forward)


@given(extrinsics(), points())
def test_opengl_goes_there_and_back_and_projects_the_same(T: FloatArray, object_points: FloatArray) -> None:
    T_gl = frames.extrinsics_to_opengl(T)
    np.testing.assert_allclose(frames.extrinsics_from_opengl(T_gl), T, atol=1e-12)
    X = object_points @ T_gl[:3, :3].T + T_gl[:3, 3]
    assert (X[:, 2] < 0).all(), "OpenGL looks along -z"
    told = np.stack([CX + FOCAL * X[:, 0] / -X[:, 2], CY - FOCAL * X[:, 1] / -X[:, 2]], axis=-1)
    np.testing.assert_allclose(told, pixels(T, object_points), atol=1e-9)


@given(extrinsics(), points())
def test_pytorch3d_goes_there_and_back_and_projects_the_same(
    T: FloatArray, object_points: FloatArray
) -> None:
    R_rows, T_rows = frames.extrinsics_to_pytorch3d(T)
    np.testing.assert_allclose(frames.extrinsics_from_pytorch3d(R_rows, T_rows), T, atol=1e-12)
    X = object_points @ R_rows + T_rows  # row vectors, as PyTorch3D multiplies
    # PyTorch3D, in_ndc=False: the screen's x and y run against the camera's (x left, y up).
    told = np.stack([CX - FOCAL * X[:, 0] / X[:, 2], CY - FOCAL * X[:, 1] / X[:, 2]], axis=-1)
    np.testing.assert_allclose(told, pixels(T, object_points), atol=1e-9)


@given(rotations, points(), st.floats(1.0, 5.0))
def test_blender_projects_the_same(R: FloatArray, object_points: FloatArray, t_z: float) -> None:
    matrix_world = frames.blender_camera_matrix_world(R, t_z)
    np.testing.assert_allclose(matrix_world[:3, :3] @ matrix_world[:3, :3].T, np.eye(3), atol=1e-12)
    # Blender's importer stores the OBJ's (x, y, z) as (x, -z, y).
    x, y, z = object_points.T
    world = np.stack([x, -z, y, np.ones(len(x))])
    X = (np.linalg.inv(matrix_world) @ world)[:3].T
    assert (X[:, 2] < 0).all(), "Blender's cameras look along -z"
    told = np.stack([CX + FOCAL * X[:, 0] / -X[:, 2], CY - FOCAL * X[:, 1] / -X[:, 2]], axis=-1)
    T = np.eye(4)
    T[:3, :3], T[2, 3] = R, t_z
    np.testing.assert_allclose(told, pixels(T, object_points), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(matrix_world[:3, 3]), t_z)
