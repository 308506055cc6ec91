"""Cars, buses, trucks, motorbikes and bicycles: which end is the front, and that every style is made."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import bicycle, car, motorbike, registry
from cadpose.library.parametric.car_body import GLASS, BodyShape, body_shell
from tests.library.parametric.surfaces import surface_of

VEHICLES = ("car", "bus", "truck", "motorbike")
SEEDS = range(8)


@cache
def make(category: str, seed: int) -> Mesh:
    return registry.make(category, seed)


@pytest.mark.parametrize("category", VEHICLES)
def test_lamps_tell_front_from_rear(category: str) -> None:
    for seed in SEEDS:
        mesh = make(category, seed)
        low, high = mesh.bounds[:, 2]
        white, red = surface_of(mesh, "headlight"), surface_of(mesh, "tail light")
        # At the ends, not just on either side of the middle.
        assert white[:, 2].max() < low + 0.35 * (high - low)
        assert red[:, 2].min() > high - 0.35 * (high - low)


@pytest.mark.parametrize("category", VEHICLES)
def test_vehicles_are_about_alike_on_both_sides(category: str) -> None:
    for seed in SEEDS:
        mesh = make(category, seed)
        for name in ("headlight", "tyre"):
            points = surface_of(mesh, name)
            assert abs(points[:, 0].mean()) < 0.03


@pytest.mark.parametrize("category", [*VEHICLES, "bicycle"])
def test_vehicles_stand_on_their_wheels_and_are_longest_along_z(category: str) -> None:
    for seed in SEEDS:
        mesh = make(category, seed)
        size = mesh.bounds[1] - mesh.bounds[0]
        assert size[2] > 1.2 * max(size[0], size[1])
        tyres = surface_of(mesh, "tyre")
        assert tyres[:, 1].min() < mesh.bounds[0, 1] + 0.05


@pytest.mark.parametrize("category", ["motorbike", "bicycle"])
def test_the_handlebar_is_in_front(category: str) -> None:
    for seed in SEEDS:
        mesh = make(category, seed)
        out = np.abs(mesh.vertices[:, 0])
        assert mesh.vertices[out > 0.9 * out.max(), 2].mean() < -0.05


@pytest.mark.parametrize(
    ("styles", "of_style"),
    [
        (car.STYLES, car.car_of_style),
        (motorbike.STYLES, motorbike.motorbike_of_style),
        (bicycle.STYLES, bicycle.bicycle_of_style),
    ],
)
def test_every_style_is_made_and_modest(
    styles: tuple[str, ...], of_style: Callable[[Generator, str], Mesh]
) -> None:
    for style in styles:
        for seed in range(3):
            mesh = of_style(np.random.default_rng(seed), style)
            assert 2000 < len(mesh.faces) < 8000
            assert len(mesh.materials) > 4


def _box_on_wheels() -> BodyShape:
    top = np.array([[0.0, 0.7], [1.2, 0.95], [1.9, 1.4], [3.0, 1.4], [3.8, 1.0], [4.2, 0.9]])
    return BodyShape(
        length=4.2, width=1.8, clearance=0.17, wheel_radius=0.32, axles=(0.8, 3.4), top=top,
        belt=np.array([[0.0, 0.9], [4.2, 0.9]]), windscreen=(1.2, 1.9), rear_glass=(3.0, 3.8),
        side_glass=((1.6, 2.4), (2.5, 3.2)), doors=(1.3, 2.45, 3.3),
    )  # fmt: skip


def test_a_body_is_a_mirror_image_of_itself_with_arches_over_its_wheels() -> None:
    shape = _box_on_wheels()
    points, faces, kind = body_shell(shape)
    assert faces.max() == len(points) - 1 and len(kind) == len(faces)
    mirrored = points * [-1, 1, 1]
    order, other = (np.lexsort(np.round(p, 6).T) for p in (points, mirrored))
    assert np.allclose(points[order], mirrored[other], atol=1e-6)
    assert points[:, 2].min() >= -2.1 - 0.1 and points[:, 2].max() <= 2.1 + 0.1
    # No point of the shell's side lies within a wheel.
    for axle in shape.axles:
        side = points[np.abs(points[:, 0]) > 0.8]
        reach = np.hypot(side[:, 1] - shape.wheel_radius, side[:, 2] - (axle - 2.1))
        assert reach.min() > shape.wheel_radius
    glass = points[faces[kind == GLASS]].mean(axis=1)
    assert glass[:, 1].min() > 0.85
    # The windscreen is in front, the side windows lie to both sides.
    assert glass[:, 2].min() < -0.5 and glass[:, 0].min() < -0.5 and glass[:, 0].max() > 0.5


def test_an_open_car_has_seats_and_a_wheel_on_its_own_left() -> None:
    mesh = car.car_of_style(np.random.default_rng(5), "convertible")
    assert len(surface_of(mesh, "leather")) > 100
    assert len(surface_of(mesh, "glass")) > 0
