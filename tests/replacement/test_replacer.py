"""A whole replacement, in a photo of which everything is known."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import Photo
from cadpose.replacement.replacer import Replacement, Replacer
from tests.replacement.scenes import CHAIR, VAN, SmearInpainter, Street, cad_id, street


@pytest.fixture(scope="module")
def scene(small_library: Library) -> Street:
    return street(small_library)


@pytest.fixture(scope="module")
def replacer(small_library: Library) -> Replacer:
    return Replacer(small_library, inpainter=SmearInpainter())


@pytest.fixture(scope="module")
def replaced(scene: Street, replacer: Replacer, small_library: Library) -> Replacement:
    van = small_library.get(cad_id(small_library, VAN))
    return replacer.replace(scene.photo, scene.annotation, van)


def test_nothing_changes_outside_object_and_shadow(scene: Street, replaced: Replacement) -> None:
    touched = replaced.removed | (replaced.coverage > 0) | (replaced.shadow > 0)
    assert 0.05 < touched.mean() < 0.9
    assert (replaced.picture[~touched] == scene.photo.rgb[~touched]).all()
    assert (replaced.background[~replaced.removed] == scene.photo.rgb[~replaced.removed]).all()
    assert replaced.removed[scene.shot.mask].all()


def test_the_new_model_is_seen_and_the_old_one_is_not(scene: Street, replaced: Replacement) -> None:
    inside = replaced.coverage > 0.99
    red, _, blue = replaced.picture[inside].mean(axis=0)
    assert blue > red + 30  # the van is blue, the car was red
    old_only = scene.shot.mask & ~(replaced.coverage > 0)
    if old_only.any():
        red, green, _ = replaced.picture[old_only].mean(axis=0)
        assert red < green + 10


def test_rotation_is_kept_and_it_stands_on_the_same_row(scene: Street, replaced: Replacement) -> None:
    assert replaced.pose.rotation == scene.annotation.pose.rotation
    rows = np.flatnonzero((replaced.coverage > 0.5).any(axis=1))
    assert rows[-1] + 1 == pytest.approx(scene.shot.box.y1, abs=2)


def test_edges_are_smooth(replaced: Replacement) -> None:
    between = (replaced.coverage > 0.05) & (replaced.coverage < 0.95)
    assert between.sum() > 100


def test_the_shadow_does_not_lie_on_the_object(
    scene: Street, replacer: Replacer, replaced: Replacement
) -> None:
    without = replacer.replace(scene.photo, scene.annotation, replaced.cad, shadow=False)
    whole = replaced.coverage > 0.999
    assert (without.picture[whole] == replaced.picture[whole]).all()
    assert not without.shadow.any()
    ground = (replaced.shadow > 0.1) & (replaced.coverage == 0)
    assert ground.sum() > 200
    assert (replaced.picture[ground] < without.picture[ground]).mean() > 0.95


def test_a_pose_that_is_given_is_taken_as_it_is(
    scene: Street, replacer: Replacer, replaced: Replacement
) -> None:
    pose = Pose4Dof(Rotation(200.0, 5.0), 300.0, (120.0, 100.0))
    assert replacer.replace(scene.photo, scene.annotation, replaced.cad, pose).pose == pose


def test_light_that_is_not_wanted_is_not_guessed(
    scene: Street, replacer: Replacer, small_library: Library
) -> None:
    chair = small_library.get(cad_id(small_library, CHAIR))
    told = replacer.replace(scene.photo, scene.annotation, chair, light=False).light
    assert not told.guessed and told.colour == (1.0, 1.0, 1.0)


def test_the_same_seed_gives_the_same_picture(
    scene: Street, replacer: Replacer, replaced: Replacement
) -> None:
    again = replacer.replace(scene.photo, scene.annotation, replaced.cad)
    assert (again.picture == replaced.picture).all()


def test_the_scene_holds_backdrop_camera_and_model(replaced: Replacement) -> None:
    scene = trimesh.load(io.BytesIO(replaced.scene_glb()), file_type="glb")
    assert isinstance(scene, trimesh.Scene)
    assert len(scene.geometry) >= 2
    names = " ".join(scene.graph.nodes_geometry)
    assert "photo" in names and "model" in names
    picture = scene.geometry["photo"].visual.material.baseColorTexture
    assert picture.size == (400, 300)


def test_a_mask_is_needed(scene: Street, replacer: Replacer, replaced: Replacement) -> None:
    bare = replace(scene.annotation, detection=replace(scene.annotation.detection, mask=None))
    with pytest.raises(InputError, match=r"has no mask.*--masks network"):
        replacer.replace(scene.photo, bare, replaced.cad)
    empty = replace(
        scene.annotation, detection=replace(scene.annotation.detection, mask=np.zeros((300, 400), np.bool_))
    )
    with pytest.raises(InputError, match="is empty"):
        replacer.replace(scene.photo, empty, replaced.cad)


def test_another_photo_is_refused(scene: Street, replacer: Replacer, replaced: Replacement) -> None:
    with pytest.raises(InputError, match="is not the photo"):
        replacer.replace(Photo(np.zeros((30, 40, 3), np.uint8)), scene.annotation, replaced.cad)


def test_a_place_outside_the_photo_is_refused(
    scene: Street, replacer: Replacer, replaced: Replacement
) -> None:
    away = Pose4Dof(Rotation(0.0, 0.0), 300.0, (9000.0, 100.0))
    with pytest.raises(InputError, match="outside"):
        replacer.replace(scene.photo, scene.annotation, replaced.cad, away)


def test_a_photo_that_is_all_object(
    small_library: Library, replacer: Replacer, replaced: Replacement
) -> None:
    scene = street(small_library, mask=np.ones((300, 400), np.bool_))
    assert replacer.replace(scene.photo, scene.annotation, replaced.cad).picture.shape == (300, 400, 3)
