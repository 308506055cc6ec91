"""The light of a photo whose light is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import Mask
from cadpose.rendering.lights import Lights
from cadpose.rendering.raster import Rasteriser
from cadpose.replacement.light import even_light, guess_light
from cadpose.replacement.surface import Surface, surface_of
from cadpose.replacement.window import Window
from tests.rendering.shapes import cube, sphere
from tests.replacement.scenes import degrees_between, unit

POSE = Pose4Dof(Rotation(30.0, 20.0), 300.0, (80.0, 80.0))
UP = POSE.rotation.to_matrix()[:, 1]
SIZE = 160
ALL = Window(0, 0, SIZE, SIZE)


def photographed(
    direction: FloatArray, key: float, ambient: float
) -> tuple[NDArray[np.uint8], Mask, Surface]:
    """A grey ball under one lamp before a grey wall, its mask and its surface."""
    x, y, z = direction
    mesh, cameras = sphere(0.35, rings=32), POSE.to_cameras(SIZE, SIZE)
    lamp = Lights(key=(x, y, z), key_strength=key, fill_strength=0.0, ambient=ambient, sky=0.0)
    views = Rasteriser(lights=lamp).render(mesh, cameras)
    return views.over(120)[0], views.mask[0], surface_of(mesh, cameras, Rasteriser(supersample=1))


@pytest.mark.parametrize(
    "direction",
    [(-0.7, -0.6, -0.4), (0.7, -0.6, -0.4), (0.0, -0.9, -0.45), (0.5, -0.7, 0.5), (-0.3, -0.3, -0.9)],
)
def test_the_lamp_of_a_rendered_scene_is_found(direction: tuple[float, float, float]) -> None:
    towards = unit(direction)
    rgb, mask, surface = photographed(towards, 0.8, 0.15)
    light = guess_light(rgb, mask, surface, UP, ~mask, ALL)
    assert light.guessed
    assert degrees_between(light.direction, towards) < 6.0
    assert light.key > light.ambient


def test_print_on_the_object_does_not_move_the_lamp() -> None:
    towards = unit((-0.7, -0.6, -0.4))
    rgb, mask, surface = photographed(towards, 0.8, 0.15)
    rgb = rgb.copy()
    rng = np.random.default_rng(0)
    for _ in range(40):
        y, x = rng.integers(40, 120, 2)
        rgb[y : y + 5, x : x + 5] //= 3
    light = guess_light(rgb, mask, surface, UP, ~mask, ALL)
    assert degrees_between(light.direction, towards) < 15.0


def test_more_ambient_light_is_less_contrast() -> None:
    towards = unit((-0.7, -0.6, -0.4))
    hard, soft = (
        guess_light(rgb, mask, surface, UP, ~mask, ALL)
        for rgb, mask, surface in (photographed(towards, 0.8, 0.1), photographed(towards, 0.3, 0.6))
    )
    assert hard.key / hard.ambient > 2.0 * soft.key / soft.ambient


def test_where_shading_tells_nothing_light_comes_from_above() -> None:
    mesh, cameras = cube(0.5), POSE.to_cameras(SIZE, SIZE)
    surface = surface_of(mesh, cameras, Rasteriser(supersample=1))
    rng = np.random.default_rng(1)
    rgb = rng.integers(60, 200, (SIZE, SIZE, 3)).astype(np.uint8)
    mask = surface.coverage > 0.5
    light = guess_light(rgb, mask, surface, UP, ~mask, ALL)
    assert not light.guessed
    assert np.array(light.direction) @ UP > 0.8


def test_warm_surroundings_make_warm_light() -> None:
    rgb, mask, surface = photographed(unit((-0.7, -0.6, -0.4)), 0.8, 0.15)
    rgb = np.clip(rgb * np.array([1.3, 1.0, 0.6]), 0, 255).astype(np.uint8)
    red, green, blue = guess_light(rgb, mask, surface, UP, ~mask, ALL).colour
    assert red > green > blue


def test_light_that_is_not_wanted_has_no_colour() -> None:
    assert even_light(UP).colour == (1.0, 1.0, 1.0)
    assert not even_light(UP).guessed


def test_normals_of_a_ball() -> None:
    mesh, cameras = sphere(0.35, rings=48), POSE.to_cameras(SIZE, SIZE)
    surface = surface_of(mesh, cameras, Rasteriser(supersample=1))
    middle = surface.normals[80, 80]
    assert degrees_between(middle, (0.0, 0.0, -1.0)) < 4.0
    right = surface.normals[80, 80 + 35]
    assert right[0] > 0.5 and abs(right[1]) < 0.1 and right[2] < 0
    assert not surface.normals[0, 0].any() and surface.coverage[0, 0] == 0
