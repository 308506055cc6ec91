from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.library.parametric import shapes
from cadpose.library.parametric.solids import Solid

from .volumes import open_edges, volume

L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
FLAT = np.stack(
    [*np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 6), indexing="ij"), np.zeros((5, 6))], 2
)

# Name: (solid, its exact volume, how far facets may be below it).
CLOSED: dict[str, tuple[Solid, float, float]] = {
    "box": (shapes.box((1, 2, 3), (5, 5, 5)), 6.0, 1e-6),
    "rounded box": (shapes.rounded_box((1, 2, 3), radius=0.02, steps=2), 6.0, 0.01),
    "cylinder": (shapes.cylinder(1, 2, sides=64), 2 * np.pi, 0.01),
    "cone": (shapes.frustum(1, 0, 3, sides=64), np.pi, 0.01),
    "frustum": (shapes.frustum(1, 0.5, 3, sides=64), np.pi * 1.75, 0.01),
    "lathe": (shapes.lathe([(1, 0), (1, 1), (0.5, 1), (0.5, 2)], 64), np.pi * 1.25, 0.01),
    "sphere": (shapes.ellipsoid((1, 1, 1), sides=48), np.pi * 4 / 3, 0.02),
    "superellipsoid": (shapes.superellipsoid((1, 1, 1), upright=0.02, round_=0.02, sides=40), 8.0, 0.2),
    "torus": (shapes.torus(1, 0.2, sides=64, around=32), 2 * np.pi**2 * 0.04, 0.02),
    "tube": (shapes.tube([(0, 0, 0), (0, 1, 0)], 0.5, sides=64), np.pi / 4, 0.01),
    "bar": (shapes.bar((0, 0, 0), (0, 1, 0), 0.2, 0.1), 0.02, 1e-6),
    "extruded": (shapes.extrude(L_SHAPE, 0.5), 1.5, 1e-6),
    "extruded clockwise": (shapes.extrude(L_SHAPE[::-1], 0.5), 1.5, 1e-6),
    "from the side": (shapes.extrude(L_SHAPE, 0.5, "zy"), 1.5, 1e-6),
    "from above": (shapes.extrude(L_SHAPE, 0.5, "xz"), 1.5, 1e-6),
    "rounded rims": (shapes.extrude(L_SHAPE, 0.5, radius=0.02), 1.5, 0.01),
    "plate": (shapes.plate(FLAT, 0.1), 0.4, 1e-6),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_and_of_the_right_volume(name: str) -> None:
    solid, exact, missing = CLOSED[name]
    assert open_edges(solid) == 0
    assert exact * (1 - missing) - 1e-9 <= volume(solid) <= exact * (1 + 1e-6)


@given(st.floats(0.05, 0.6), st.floats(0.02, 1.0), st.floats(0.05, 0.6), st.floats(0.05, 0.6))
def test_a_pillow_fills_its_size(width: float, thick: float, depth: float, puff: float) -> None:
    solid = shapes.pillow((width, thick, depth), (1, 2, 3), puff)
    assert open_edges(solid) == 0 and 0 < volume(solid) < width * thick * depth
    assert np.ptp(solid.vertices, axis=0) == pytest.approx([width, thick, depth])


@given(st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=2, max_size=6, unique=True))
def test_a_tube_stays_near_its_path(path: list[tuple[float, float, float]]) -> None:
    line = np.array(path)
    if np.linalg.norm(np.diff(line, axis=0), axis=1).min() < 0.05:
        return
    solid = shapes.tube(line, 0.01, sides=8)
    assert np.isfinite(solid.vertices).all()
    distance = np.linalg.norm(solid.vertices[:, None] - line[None], axis=2).min(axis=1)
    assert distance.max() <= 0.0201  # a mitre at most doubles the radius


def test_a_closed_tube_has_no_ends() -> None:
    ring = np.column_stack(
        [np.cos(np.arange(24) * np.pi / 12), np.zeros(24), np.sin(np.arange(24) * np.pi / 12)]
    )
    solid = shapes.tube(ring, 0.1, sides=12, closed=True)
    assert open_edges(solid) == 0
    assert abs(volume(solid)) == pytest.approx(2 * np.pi**2 * 0.01, rel=0.08)


def test_a_flat_bar_lies_flat() -> None:
    across = shapes.tube([(-1, 0, 0), (1, 0, 0)], 1.0, section=shapes.rectangle(0.3, 0.1))
    assert np.ptp(across.vertices, axis=0) == pytest.approx([2.0, 0.1, 0.3])


def test_a_smooth_path_goes_through_its_points() -> None:
    points = np.array([(0.0, 0.0), (1.0, 0.5), (2.0, 0.0)])
    curve = shapes.smooth_path(points, 5)
    assert len(curve) == 11 and np.allclose(curve[[0, 5, 10]], points)
    assert len(shapes.smooth_path(points, 5, closed=True)) == 15


def test_rectangle_corners() -> None:
    assert np.ptp(shapes.rectangle(2, 1, 0.2, centre=(5, 5)), axis=0) == pytest.approx([2, 1])
    assert shapes.rectangle(2, 1, centre=(5, 5)).mean(axis=0) == pytest.approx([5, 5])
