"""Photo-like views: the same silhouettes as the rasteriser's, lit by an environment, over a ground."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Material
from cadpose.rendering.blender import blender_python
from cadpose.rendering.blender_photo import BlenderPhotographer, Surface, check_environment
from cadpose.rendering.blender_worker_photo import mean_radiance
from cadpose.rendering.raster import Rasteriser
from cadpose.rendering.scene import build_scene
from tests.rendering.shapes import QUAD_UV, cube, mesh_of, quad, sphere


@pytest.fixture(scope="module")
def blender() -> Iterator[BlenderPhotographer]:
    try:
        blender_python()
    except DependencyError as error:
        pytest.skip(str(error))
    with BlenderPhotographer(samples=8, threads=1) as renderer:
        renderer.light(np.ones((16, 32, 3), np.float32))
        yield renderer


def camera_of(elevation: float = 25.0, size: int = 128) -> Cameras:
    R = rotation_from_angles(30.0, elevation, 8.0)
    return Cameras.from_rotations(R, focal_px=size * 1.2, principal_px=(60.0, 66.0), width=size, height=size)


def test_the_mean_counts_by_solid_angle_above_the_horizon() -> None:
    light = np.zeros((64, 128, 3), np.float32)
    light[:32] = 0.5
    assert mean_radiance(light) == pytest.approx(0.5)
    # A cap of 30 degrees about the zenith: 1 - cos 30 of the upper half.
    cap = np.zeros((180, 36, 3), np.float32)
    cap[:30] = 1.0
    assert mean_radiance(cap) == pytest.approx(1.0 - np.cos(np.deg2rad(30.0)), rel=0.01)
    for dark in (np.zeros((8, 16, 3)), np.full((8, 16, 3), np.nan)):
        with pytest.raises(ValueError, match="no light"):
            mean_radiance(dark)


def test_files_that_are_no_environment(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"x")
    for name in ("a.jpg", "missing.hdr"):
        with pytest.raises(InputError, match=r"no \.hdr or \.exr"):
            check_environment(tmp_path / name)


def test_surfaces_are_in_range() -> None:
    with pytest.raises(ValueError, match=r"must be in \[0, 1\]"):
        Surface(roughness=1.2)


@pytest.mark.slow
def test_silhouettes_are_the_rasteriser_s(blender: BlenderPhotographer) -> None:
    texture = np.array([[[250, 20, 20], [20, 250, 20]]], np.uint8).repeat(8, axis=0).repeat(8, axis=1)
    flag = mesh_of(quad(0.0), (Material((1, 1, 1, 1), texture),), uv=QUAD_UV)
    pane = mesh_of(quad(0.0), (Material((0.2, 0.4, 0.9, 0.4)),))
    for mesh in (cube(), sphere(0.3, 24), flag, pane):
        scene, camera = build_scene(mesh), camera_of()
        view = blender.view(scene, [Surface()] * len(scene.rgba), camera, ground=-0.5)
        ours, theirs = Rasteriser().render_scene(scene, camera).mask[0], view.alpha >= 128
        assert (ours & theirs).sum() / (ours | theirs).sum() > 0.97
        assert view.rgb[theirs].mean() > 20 and not view.rgb[view.alpha == 0].any()


@pytest.mark.slow
def test_the_ground_is_dark_beside_the_object_only(blender: BlenderPhotographer) -> None:
    scene = build_scene(sphere(0.3, 24))
    view = blender.view(scene, [Surface()], camera_of(40.0), ground=-0.3)
    outside = view.alpha == 0
    assert view.light[outside].min() < 0.75 and np.median(view.light[outside]) > 0.9
    assert (view.light >= 0.0).all() and (view.light <= 1.0).all()
    assert (blender.view(scene, [Surface()], camera_of(40.0)).light == 1.0).all()


@pytest.mark.slow
def test_the_light_comes_from_where_it_is_in_the_environment(blender: BlenderPhotographer) -> None:
    scene, camera = build_scene(sphere(0.3, 24)), camera_of(0.0)
    lamp = np.full((64, 128, 3), 0.02, np.float32)
    lamp[20:44, 60:68] = 20.0
    matt = [Surface(roughness=1.0)]
    blender.light(lamp)
    middles = []
    for turn in range(0, 360, 45):
        grey = blender.view(scene, matt, camera, turn=float(turn)).rgb.mean(axis=2)
        middles.append(float((grey * np.arange(128)).sum() / grey.sum()))
    blender.light(np.ones((16, 32, 3), np.float32))
    # A lamp that goes round lights the left side, then the right side, once each.
    assert max(middles) - min(middles) > 8
    sides = np.sign(np.array(middles) - np.mean(middles))
    assert (sides != np.roll(sides, 1)).sum() == 2
    again = blender.view(scene, matt, camera)
    assert np.ptp(again.rgb[again.alpha == 255].mean(axis=1)) < 60


@pytest.mark.slow
def test_a_damaged_panorama_is_told(blender: BlenderPhotographer, tmp_path: Path) -> None:
    bad = tmp_path / "bad.hdr"
    bad.write_bytes(b"no panorama")
    with pytest.raises(InputError, match=r"bad\.hdr: Blender cannot use it"):
        blender.light(bad)
    # The worker goes on.
    blender.light(np.ones((16, 32, 3), np.float32))
    with pytest.raises(ValueError, match="one surface a material"):
        blender.view(build_scene(cube()), [], camera_of())
