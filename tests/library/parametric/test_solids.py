from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.errors import InputError
from cadpose.library.mesh import Material
from cadpose.library.parametric import shapes
from cadpose.library.parametric.paints import plain
from cadpose.library.parametric.solids import Builder, Paint, Solid, axis_rotation, joined

from .volumes import volume

RED, STRIPES = plain((1.0, 0.0, 0.0)), np.zeros((4, 4, 3), np.uint8)


def test_axis_rotation_is_right_handed() -> None:
    for axis, start, end in (("x", 1, 2), ("y", 2, 0), ("z", 0, 1)):
        assert np.allclose(axis_rotation(axis, 90) @ np.eye(3)[start], np.eye(3)[end])


@given(st.sampled_from("xyz"), st.floats(-180, 180))
def test_turning_about_a_point_keeps_it(axis: str, degrees: float) -> None:
    box = shapes.box((1, 2, 3), (4, 5, 6))
    turned = box.turned(axis, degrees, about=(4, 5, 6))
    assert np.allclose(turned.vertices.mean(axis=0), (4, 5, 6))
    assert volume(turned) == pytest.approx(6.0)


def test_mirroring_keeps_the_outside_outside() -> None:
    box = shapes.box((1, 1, 1), (2, 0, 0))
    assert volume(box.mirrored()) == pytest.approx(1.0)
    assert volume(box.scaled(-2, 1, 1)) == pytest.approx(2.0)
    pair = box.pair()
    assert np.allclose(pair.vertices.mean(axis=0), 0) and volume(pair) == pytest.approx(2.0)


def test_normals_turn_with_the_solid() -> None:
    ball = shapes.rounded_box((1, 1, 1), radius=0.49, steps=3).turned("z", 90).moved(3, 0, 0)
    assert ball.normals is not None
    outward = ball.vertices - (3, 0, 0)
    assert (np.einsum("vi,vi->v", ball.normals, outward) > 0).all()
    assert joined([ball, ball]).normals is not None
    assert joined([ball, shapes.box((1, 1, 1))]).normals is None


def test_warping_moves_vertices_and_drops_normals() -> None:
    solid = shapes.rounded_box((1, 1, 1)).warped(lambda v: v * 2.0)
    assert solid.normals is None and volume(solid) == pytest.approx(8.0, rel=0.01)


def test_a_builder_gives_a_normalised_mesh() -> None:
    build, part = Builder(), Builder()
    part.add(RED, shapes.box((1, 1, 1)))
    build.add(plain((0.0, 1.0, 0.0)), shapes.box((1, 1, 1)))
    build.include(part, offset=(3.0, 0.0, 0.0))
    assert np.allclose(build.bounds(), [(-0.5, -0.5, -0.5), (3.5, 0.5, 0.5)])
    mesh = build.mesh("two boxes")
    low, high = mesh.bounds
    assert np.linalg.norm(high - low) == pytest.approx(1.0, abs=1e-5)
    assert np.allclose(low + high, 0, atol=1e-6)
    assert len(mesh.materials) == 2
    red = [m.rgba[0] for m in mesh.materials].index(1.0)
    assert mesh.vertices[mesh.faces[mesh.face_material == red]][..., 0].min() > 0


def test_nothing_added_is_told() -> None:
    with pytest.raises(InputError, match="no faces"):
        Builder().mesh("nothing")


def _uv(solid: Solid, along: bool) -> np.ndarray:
    build = Builder()
    build.add(Paint(Material(texture=STRIPES), tile=0.5, along=along), solid)
    return np.asarray(build.mesh("textured").corner_uv)


def test_a_texture_repeats_by_the_metre_wherever_the_part_goes() -> None:
    long = shapes.box((2.0, 0.1, 0.1))
    spans = np.ptp(_uv(long, along=False).reshape(-1, 2), axis=0)
    assert spans == pytest.approx([4.0, 0.2], abs=1e-6)
    # The grain follows the longest side, before and after a turn.
    for solid in (long, long.turned("y", 30).moved(1, 2, 3)):
        assert np.ptp(_uv(solid, along=True).reshape(-1, 2), axis=0) == pytest.approx([0.2, 4.0], abs=1e-6)
