from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import azimuth_error, rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray, R_p_from_s
from cadpose.geometry.labels import from_pascal3d, from_pix3d, to_pascal3d, to_pix3d
from tests.geometry.strategies import azimuths, elevations, inplanes, points, rotations


def pascal3d_projection(
    points_p: FloatArray,
    azimuth: float,
    elevation: float,
    theta: float,
    distance: float,
    focal: float,
    principal: tuple[float, float],
) -> FloatArray:
    """PASCAL3D+'s own projection, step by step from its description; angles in degrees.

    The camera sits at C and looks at the origin; the drawing is then turned by theta in a plane whose
    y axis points up, and last the y axis is flipped.
    """
    a, e, t = np.deg2rad([azimuth, elevation, theta])
    centre = distance * np.array([np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
    b, d = -a, -(np.pi / 2 - e)
    Rz = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
    Rx = np.array([[1, 0, 0], [0, np.cos(d), -np.sin(d)], [0, np.sin(d), np.cos(d)]])
    X = (points_p - centre) @ (Rx @ Rz).T
    drawing = focal * X[:, :2] / -X[:, 2:]
    drawing = drawing @ np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]).T
    return np.asarray(drawing * [1.0, -1.0] + principal)


@given(azimuths, elevations, inplanes, st.floats(1.0, 10.0), points())
def test_pascal3d_projects_to_the_same_pixels(
    azimuth: float, elevation: float, theta: float, distance: float, object_points: FloatArray
) -> None:
    R = rotation_from_angles(*from_pascal3d(azimuth, elevation, theta))
    ours = Cameras.from_rotations(
        R, focal_px=3000.0, principal_px=(250.0, 180.0), width=500, height=375, t_z=distance
    ).project(object_points)[0]
    theirs = pascal3d_projection(
        object_points @ R_p_from_s.T, azimuth, elevation, theta, distance, 3000.0, (250.0, 180.0)
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


@given(st.floats(-720.0, 720.0), elevations, st.floats(-360.0, 360.0))
def test_pascal3d_goes_there_and_back(azimuth: float, elevation: float, theta: float) -> None:
    ours = from_pascal3d(azimuth, elevation, theta)
    assert from_pascal3d(*to_pascal3d(*ours)) == ours
    assert azimuth_error(ours[0], azimuth) < 1e-9
    assert azimuth_error(ours[2], theta) < 1e-9


@given(
    rotations,
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(1.0, 4.0)),
    st.floats(200.0, 3000.0),
)
def test_pix3d_goes_there_and_back(R: FloatArray, t: tuple[float, float, float], focal: float) -> None:
    label = to_pix3d(R, np.array(t), focal, 640)
    camera = from_pix3d(
        np.array(label["rot_mat"]),
        np.array(label["trans_mat"]),
        float(str(label["focal_length"])),
        (640, 480),
        np.array(label["cam_position"]),
    )
    np.testing.assert_allclose(camera.R_cv_from_s, R, atol=1e-12)
    np.testing.assert_allclose(camera.t_cv, t, atol=1e-12)
    assert camera.focal_px == pytest.approx(focal)
    assert camera.principal_px == (320.0, 240.0)


@given(azimuths, st.floats(-89.0, 89.0), inplanes, st.floats(1.0, 4.0))
def test_pix3d_angles_are_ours_where_the_camera_looks_at_the_object(
    azimuth: float, elevation: float, inplane: float, distance: float
) -> None:
    R = rotation_from_angles(azimuth, elevation, inplane)
    label = to_pix3d(R, np.array([0.0, 0.0, distance]), 500.0, 640)
    camera = from_pix3d(
        np.array(label["rot_mat"]),
        np.array(label["trans_mat"]),
        float(str(label["focal_length"])),
        (640, 480),
        np.array(label["cam_position"]),
    )
    assert azimuth_error(camera.azimuth, azimuth) < 1e-6
    assert camera.elevation == pytest.approx(elevation, abs=1e-6)


@given(rotations, points())
def test_pix3d_label_projects_by_its_own_formula(R: FloatArray, object_points: FloatArray) -> None:
    """X_cv = diag(-1, -1, 1)(R·X + t), f_px = focal_mm / 32 · width."""
    t = np.array([0.1, -0.05, 2.0])
    label = to_pix3d(R, t, 500.0, 640)
    rot, trans = np.array(label["rot_mat"]), np.array(label["trans_mat"])
    X = (object_points @ rot.T + trans) * [-1.0, -1.0, 1.0]
    focal = float(str(label["focal_length"])) / 32.0 * 640
    told = focal * X[:, :2] / X[:, 2:] + [320.0, 240.0]
    ours = Cameras(R[None], t[None], np.array([500.0]), np.array([[320.0, 240.0]]), 640, 480)
    np.testing.assert_allclose(ours.project(object_points)[0], told, atol=1e-9)
