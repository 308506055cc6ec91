from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.alignment.refinement.steps import in_photo_camera, in_virtual_camera, observable, stepped
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.poses import PhotoCamera, Pose4Dof, Rotation

POSE = Pose4Dof(Rotation(30.0, 15.0, 5.0), 700.0, (320.0, 250.0))
small = st.tuples(*[st.floats(-0.5, 0.5)] * 6).map(np.array)


def test_no_step_is_the_same_pose() -> None:
    same = stepped(POSE, np.zeros(6), 200.0)
    assert same.rotation.error_to(POSE.rotation) < 1e-6
    assert (same.focal_px, same.principal_px, same.t_z) == (POSE.focal_px, POSE.principal_px, POSE.t_z)


@given(small)
def test_a_step_turns_by_its_length_and_scales_and_shifts(step: np.ndarray) -> None:
    there = stepped(POSE, step, 200.0)
    turned = np.degrees(np.linalg.norm(step[:3]))
    assert there.rotation.error_to(POSE.rotation) == pytest.approx(turned, abs=1e-4)
    assert np.log(there.focal_px / POSE.focal_px) == pytest.approx(step[3], abs=1e-9)
    np.testing.assert_allclose(
        np.subtract(there.principal_px, POSE.principal_px), 200.0 * step[4:], atol=1e-9
    )


def test_a_turn_about_the_line_of_sight_is_an_in_plane_turn() -> None:
    there = stepped(POSE, np.array([0.0, 0.0, np.radians(10.0), 0.0, 0.0, 0.0]), 1.0)
    # OpenCV's z points away from the viewer: a positive turn about it is clockwise.
    assert there.rotation.inplane == pytest.approx(POSE.rotation.inplane - 10.0)
    assert there.rotation.azimuth == pytest.approx(POSE.rotation.azimuth)


def test_what_a_symmetry_hides_is_left_as_it_is() -> None:
    step = np.array([0.1, -0.2, 0.05, 0.01, 0.02, 0.03])
    bottle = SymmetryGroup.revolution()
    seen = observable(step, POSE, bottle)
    axis_cv = POSE.rotation.to_matrix() @ [0.0, 1.0, 0.0]
    assert abs(seen[:3] @ axis_cv) < 1e-12
    np.testing.assert_allclose(seen[:3], step[:3] - (step[:3] @ axis_cv) * axis_cv)
    np.testing.assert_array_equal(seen[3:], step[3:])
    np.testing.assert_array_equal(observable(step, POSE, SymmetryGroup.sphere())[:3], np.zeros(3))
    for plain in (None, SymmetryGroup.trivial(), SymmetryGroup.cyclic(4)):
        np.testing.assert_array_equal(observable(step, POSE, plain), step)


def test_both_cameras_see_the_origin_at_the_principal_point() -> None:
    origin = np.zeros((1, 3))
    for seen in (in_virtual_camera, in_photo_camera(PhotoCamera(900.0, (320.0, 240.0)))):
        np.testing.assert_allclose(seen(POSE).project(origin)[0, 0], POSE.principal_px, atol=1e-9)
