from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.annotations.scenes.layout import (
    ASSUMED_35MM,
    Layout,
    diagonal_metres,
    lay_out,
    photo_camera,
    turns_and_scales,
)
from cadpose.errors import InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.poses import PhotoCamera, Pose6Dof
from cadpose.records import Pose4Dof, Rotation
from tests.annotations.factory import make_photo
from tests.annotations.scenes.made import BLOCK, OTHER, POSES, annotated

CUBE = np.random.default_rng(3).uniform(-0.28, 0.28, (40, 3))

rotations = st.builds(Rotation, st.floats(0, 359), st.floats(-90, 90), st.floats(-179, 180))
poses = st.builds(
    Pose4Dof,
    rotations,
    st.floats(5.0, 5000.0),
    st.tuples(st.floats(-200.0, 400.0), st.floats(-200.0, 400.0)),
)


def in_scene(T: FloatArray, points: FloatArray) -> FloatArray:
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def pixels(layout: Layout, number: int) -> FloatArray:
    return layout.camera.project(in_scene(layout.models[number].T_scene_from_s, CUBE))


@given(st.lists(poses, min_size=1, max_size=4), st.booleans())
def test_every_model_falls_on_the_pixels_of_its_annotation(found: list[Pose4Dof], centred: bool) -> None:
    photo = make_photo()
    layout = lay_out(annotated(photo, [BLOCK] * len(found), found), photo, centred=centred)
    for number, pose in enumerate(found):
        assert pixels(layout, number) == pytest.approx(pose.project(CUBE), rel=1e-9, abs=1e-6)


@given(st.lists(poses, min_size=1, max_size=3))
def test_models_stand_between_the_near_plane_and_the_backdrop(found: list[Pose4Dof]) -> None:
    photo = make_photo()
    layout = lay_out(annotated(photo, [BLOCK] * len(found), found), photo)
    depths = np.concatenate([-in_scene(m.T_scene_from_s, CUBE)[:, 2] for m in layout.models])
    backdrop = -layout.backdrop[:, 2]
    assert layout.camera.near < depths.min()
    assert depths.max() < backdrop.min() == backdrop.max() < layout.camera.far


@pytest.mark.parametrize("centred", [True, False])
def test_the_backdrop_fills_the_frame(centred: bool) -> None:
    photo = make_photo()
    layout = lay_out(annotated(photo), photo, centred=centred)
    corners = [[0.0, 80.0], [120.0, 80.0], [120.0, 0.0], [0.0, 0.0]]
    assert layout.camera.project(layout.backdrop) == pytest.approx(np.array(corners), abs=1e-9)


@given(poses)
def test_one_object_keeps_its_shape_where_the_principal_point_may_be_chosen(pose: Pose4Dof) -> None:
    photo = make_photo()
    model = lay_out(annotated(photo, [BLOCK], [pose]), photo, centred=False).models[0]
    assert model.stretch == pytest.approx((1.0, 1.0, 1.0))


def test_one_object_is_leant_by_its_distance_from_the_middle_and_not_stretched() -> None:
    photo = make_photo()
    straight = Pose4Dof(Rotation(40, 20), 90.0, (60.0, 40.0))
    model = lay_out(annotated(photo, [BLOCK], [straight]), photo).models[0]
    assert model.stretch == pytest.approx((1.0, 1.0, 1.0))
    aside = replace(straight, principal_px=(60.0 + 9.0, 40.0))
    model = lay_out(annotated(photo, [BLOCK], [aside]), photo).models[0]
    # A lean of 0.1 has these lengths: the roots of s^2 - (2 + 0.1^2) s + 1, squared.
    assert model.stretch[1] == pytest.approx(1.0)
    assert model.stretch[0] * model.stretch[2] == pytest.approx(1.0)
    assert model.stretch[2] - model.stretch[0] == pytest.approx(0.1)


def test_the_scene_is_in_metres_where_the_size_is_known() -> None:
    photo = make_photo()
    known, unknown = lay_out(annotated(photo, [BLOCK, OTHER], POSES[:2]), photo).models
    length = float(np.hypot(np.hypot(0.30, 0.86), 0.40))
    assert diagonal_metres(known.annotation) == pytest.approx(length)
    assert known.unit == pytest.approx(length)
    assert diagonal_metres(unknown.annotation) is None
    assert unknown.unit == 1.0
    whole = Pose6Dof.from_4dof(POSES[0], PhotoCamera(100.0, (60.0, 40.0)), 2.5)
    assert diagonal_metres(replace(known.annotation, pose_6dof=whole)) == 2.5


@given(st.lists(poses, min_size=1, max_size=3))
def test_rigid_models_keep_their_shape_and_stand_as_the_photos_camera_sees_them(
    found: list[Pose4Dof],
) -> None:
    photo = replace(make_photo(), focal_35mm=50.0)
    layout = lay_out(annotated(photo, [BLOCK] * len(found), found), photo, placement="rigid")
    camera = PhotoCamera.from_35mm(50.0, photo.width, photo.height)
    assert layout.camera.focal_px == pytest.approx(camera.focal_px)
    for number, pose in enumerate(found):
        assert layout.models[number].stretch == pytest.approx((1.0, 1.0, 1.0))
        whole = Pose6Dof.from_4dof(pose, camera)
        if whole.t_cv[2] > 0.5:
            assert pixels(layout, number) == pytest.approx(whole.project(CUBE), rel=1e-6, abs=1e-6)


def test_a_pose_that_is_known_in_the_photos_camera_is_taken_as_it_is() -> None:
    photo = make_photo()
    camera = PhotoCamera(130.0, (66.0, 41.0))
    whole = Pose6Dof(rotation_from_angles(10.0, 20.0, 30.0), np.array([0.4, -0.2, 3.0]), camera)
    annotation = replace(annotated(photo, [BLOCK], POSES[:1])[0], pose_6dof=whole)
    assert photo_camera(photo, [annotation]) is camera
    for centred in (True, False):
        layout = lay_out([annotation], photo, placement="rigid", centred=centred)
        assert pixels(layout, 0) == pytest.approx(whole.project(CUBE), abs=1e-9)
    assert layout.camera.principal_px == camera.principal_px
    assert layout.models[0].stretch == pytest.approx((1.0, 1.0, 1.0))


def test_a_lens_that_nothing_tells_is_assumed() -> None:
    photo = make_photo()
    assert photo_camera(photo, []) == PhotoCamera.from_35mm(ASSUMED_35MM, 120, 80)


def test_a_photo_without_objects_is_a_scene_too() -> None:
    layout = lay_out([], make_photo())
    assert layout.models == ()
    assert layout.camera.project(layout.backdrop)[0] == pytest.approx([0.0, 80.0])


def test_what_has_no_place_is_refused() -> None:
    photo = make_photo()
    pose = Pose4Dof(Rotation(0, 0), 1e-300, (1e300, 40.0))
    with pytest.raises(InputError, match=r"street\.jpg is out of range"):
        lay_out(annotated(photo, [BLOCK], [pose]), photo)


def test_a_model_may_reach_behind_the_camera() -> None:
    photo = make_photo()
    pose = Pose4Dof(Rotation(0, 0), 50.0, (60.0, 40.0), t_z=0.4)
    camera = lay_out(annotated(photo, [BLOCK], [pose]), photo).camera
    assert 0.0 < camera.near < camera.far


@given(st.integers(0, 2**32 - 1), st.floats(0.2, 5.0), st.floats(-2.0, 2.0))
def test_turns_and_scales_make_the_map_again(seed: int, stretch: float, lean: float) -> None:
    R = rotation_from_angles(*np.random.default_rng(seed).uniform(-80, 80, 3))
    T = np.array([[1, 0, lean], [0, 1, 0.3], [0, 0, stretch]]) @ R
    outer, scales, inner = turns_and_scales(T)
    assert (outer * scales) @ inner == pytest.approx(T)
    for turn in (outer, inner):
        assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1.0)


def test_a_rigid_map_is_one_turn_and_a_mirror_none() -> None:
    R = rotation_from_angles(40.0, 20.0, 10.0)
    outer, scales, inner = turns_and_scales(2.0 * R)
    assert outer == pytest.approx(R)
    assert scales == pytest.approx([2.0, 2.0, 2.0])
    assert (inner == np.eye(3)).all()
    with pytest.raises(ValueError, match="left and right"):
        turns_and_scales(np.diag([1.0, 1.0, -1.0]))
