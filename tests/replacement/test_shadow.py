"""The shadow on the ground: where it lies, and how dark."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.geometry.frames import FloatArray
from cadpose.poses import Pose4Dof, Rotation
from cadpose.replacement.light import Light
from cadpose.replacement.shadow import CELLS, REACH, darkening, ground_height, ground_shadow
from tests.rendering.shapes import cube
from tests.replacement.scenes import unit

CUBE = cube(0.5)


def cell(x: float, z: float) -> tuple[int, int]:
    """Row and column of a place on the ground."""
    return int((z + REACH) / (2 * REACH) * CELLS), int((x + REACH) / (2 * REACH) * CELLS)


def lamp(direction_cv: FloatArray, ambient: float = 0.3, key: float = 0.9) -> Light:
    x, y, z = direction_cv
    return Light((float(x), float(y), float(z)), ambient, key, (1.0, 1.0, 1.0), 1.0, True)


def test_the_cast_shadow_is_as_long_as_the_lamp_is_low() -> None:
    # A lamp at 45 degrees on the side of -x: the shadow of a cube of 0.5 reaches 0.5 to the side of +x.
    shadow = ground_shadow(CUBE, unit((-1.0, 1.0, 0.0)))
    assert shadow.lamp[cell(0.5, 0.0)] > 0.9
    assert shadow.lamp[cell(0.9, 0.0)] < 0.05
    assert shadow.lamp[cell(-0.4, 0.0)] < 0.05
    assert shadow.height == pytest.approx(-0.25)


def test_the_contact_shadow_is_darkest_at_the_object() -> None:
    sky = ground_shadow(CUBE, unit((0.0, 1.0, 0.0))).sky
    under, near, far = (float(sky[cell(x, 0.0)]) for x in (0.0, 0.28, 0.7))
    assert under > 0.95
    assert 0.25 < near < 0.6
    assert far < 0.15


def test_a_lamp_below_the_ground_casts_nothing() -> None:
    assert not ground_shadow(CUBE, unit((1.0, -0.2, 0.0))).lamp.any()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_falls_away_from_the_lamp_and_touches_the_object(side: float) -> None:
    pose = Pose4Dof(Rotation(0.0, 25.0), 300.0, (160.0, 100.0))
    R = pose.rotation.to_matrix()
    direction_s = unit((side, 0.9, 0.0))
    light = lamp(R @ direction_s)
    lost = darkening(ground_shadow(CUBE, direction_s), light, pose, 320, 240)
    ground = ground_height(CUBE)
    lit, dark = pose.project(np.array([(0.5 * side, ground, 0.0), (-0.5 * side, ground, 0.0)]))
    at = lost[int(dark[1]), int(dark[0])]
    assert at > 0.5
    assert lost[int(lit[1]), int(lit[0])] < 0.25 * at
    # Just before the lower front edge the ground is darkened: nothing floats.
    foot = pose.project(np.array([(0.0, ground, -0.262)]))[0]
    assert lost[int(foot[1]), int(foot[0])] > 0.1
    assert lost.min() >= 0.0 and lost.max() <= 1.0


def test_the_plane_is_drawn_in_the_photos_perspective() -> None:
    pose = Pose4Dof(Rotation(37.0, 30.0), 260.0, (150.0, 110.0))
    shadow = ground_shadow(CUBE, unit((0.0, 1.0, 0.0)))
    lost = darkening(shadow, lamp(pose.rotation.to_matrix()[:, 1], ambient=1e-6), pose, 320, 240)
    ground = ground_height(CUBE)
    # From straight above the shadow of a cube is its own footprint.
    inner = [(x, ground, z) for x in (-0.2, 0.2) for z in (-0.2, 0.2)]
    outer = [(x, ground, z) for x in (-0.31, 0.31) for z in (-0.31, 0.31)]
    for points, low, high in ((inner, 0.9, 1.0), (outer, 0.0, 0.1)):
        for x, y in pose.project(np.array(points)):
            assert low <= lost[int(y), int(x)] <= high


def test_a_camera_below_the_ground_sees_no_shadow() -> None:
    pose = Pose4Dof(Rotation(0.0, -20.0), 300.0, (160.0, 120.0))
    light = lamp(pose.rotation.to_matrix()[:, 1])
    assert not darkening(ground_shadow(CUBE, unit((0.0, 1.0, 0.0))), light, pose, 320, 240).any()


def test_nothing_lies_above_the_horizon() -> None:
    pose = Pose4Dof(Rotation(0.0, 4.0), 200.0, (160.0, 120.0))
    direction_s = unit((0.0, 0.1, -1.0))
    light = lamp(pose.rotation.to_matrix() @ direction_s)
    lost = darkening(ground_shadow(CUBE, direction_s), light, pose, 320, 240)
    horizon = 120 - 200 * np.tan(np.radians(4.0))
    assert lost.any()
    assert not lost[: int(horizon)].any()
