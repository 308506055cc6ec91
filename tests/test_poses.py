from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation

rotations = st.builds(Rotation, st.floats(0, 359), st.floats(-80, 80), st.floats(-179, 179))
pixels = st.tuples(st.floats(0, 640), st.floats(0, 480))
poses = st.builds(Pose4Dof, rotations, st.floats(50, 3000), pixels, st.floats(1.0, 20.0))
cameras = st.builds(PhotoCamera, st.floats(200, 5000), st.tuples(st.floats(200, 440), st.floats(140, 340)))
POINTS = np.array([[0, 0, 0], [0.3, 0.1, -0.2], [-0.2, 0.2, 0.3], [0.1, -0.3, 0.1]])


@given(poses, cameras)
def test_four_numbers_come_back_from_six(pose: Pose4Dof, camera: PhotoCamera) -> None:
    back = Pose6Dof.from_4dof(pose, camera).to_4dof(pose.t_z)
    assert back.rotation.error_to(pose.rotation) < 1e-5
    assert back.focal_px == pytest.approx(pose.focal_px, rel=1e-9)
    assert back.principal_px == pytest.approx(pose.principal_px, abs=1e-6)


@given(rotations, cameras, st.tuples(st.floats(-2, 2), st.floats(-1, 1), st.floats(2, 30)))
def test_six_numbers_come_back_from_four(
    rotation: Rotation, camera: PhotoCamera, t: tuple[float, float, float]
) -> None:
    pose = Pose6Dof(rotation.to_matrix(), np.array(t), camera, diagonal_m=2.5)
    back = Pose6Dof.from_4dof(pose.to_4dof(), camera)
    np.testing.assert_allclose(back.R_cv_from_s, pose.R_cv_from_s, atol=1e-8)
    np.testing.assert_allclose(back.t_cv, pose.t_cv, rtol=1e-9, atol=1e-9)


@given(poses, cameras)
def test_the_origin_falls_on_the_principal_point(pose: Pose4Dof, camera: PhotoCamera) -> None:
    whole = Pose6Dof.from_4dof(pose, camera)
    np.testing.assert_allclose(whole.project(np.zeros((1, 3)))[0], pose.principal_px, atol=1e-6)


def test_on_the_axis_at_the_virtual_distance_both_are_one_camera() -> None:
    pose = Pose4Dof(Rotation(30.0, 10.0, 2.0), 800.0, (320.0, 240.0))
    whole = Pose6Dof.from_4dof(pose, PhotoCamera(800.0, (320.0, 240.0)))
    np.testing.assert_allclose(whole.t_cv, [0.0, 0.0, 2.0])
    np.testing.assert_allclose(whole.project(POINTS), pose.project(POINTS), atol=1e-9)


def test_a_longer_lens_puts_the_object_further_away_at_the_same_size() -> None:
    pose = Pose4Dof(Rotation(30.0, 10.0), 400.0, (320.0, 240.0))
    whole = Pose6Dof.from_4dof(pose, PhotoCamera(4000.0, (320.0, 240.0)), diagonal_m=4.5)
    assert whole.t_cv[2] == pytest.approx(20.0)
    assert whole.to_T_cam_obj(metric=True)[2, 3] == pytest.approx(90.0)
    step = np.array([[0.0, 0.0, 0.0], [0.0, 0.001, 0.0]])
    sizes = [np.ptp(one.project(step)[:, 1]) for one in (pose, whole)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-3)


def test_off_the_axis_pixels_agree_to_first_order() -> None:
    camera = PhotoCamera(700.0, (320.0, 240.0))
    pose = Pose4Dof(Rotation(200.0, 5.0), 500.0, (600.0, 100.0))
    whole = Pose6Dof.from_4dof(pose, camera)
    small = 1e-4 * np.vstack([np.eye(3), -np.eye(3)])
    virtual, real = pose.project(small), whole.project(small)
    areas = [np.prod(np.ptp(points, axis=0)) for points in (virtual, real)]
    assert areas[0] == pytest.approx(areas[1], rel=0.1)


def test_metres_need_the_models_size() -> None:
    pose = Pose6Dof.from_4dof(Pose4Dof(Rotation(0, 0), 1.0, (0.0, 0.0)), PhotoCamera(1.0, (0.0, 0.0)))
    with pytest.raises(ValueError, match="size is unknown"):
        pose.to_T_cam_obj(metric=True)
    assert pose.to_T_cam_obj().shape == (4, 4)


def test_exif_tells_the_angle_of_view_along_the_diagonal() -> None:
    camera = PhotoCamera.from_35mm(50.0, 3600, 2400)
    assert camera.focal_px == pytest.approx(5000.0)
    assert camera.principal_px == (1800.0, 1200.0)
    assert PhotoCamera.from_35mm(50.0, 2400, 3600).focal_px == pytest.approx(5000.0)
    assert camera.source == "exif"
    np.testing.assert_allclose(camera.to_matrix(), [[5000, 0, 1800], [0, 5000, 1200], [0, 0, 1]])
