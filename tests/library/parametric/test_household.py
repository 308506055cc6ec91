"""Clocks, bags, bottles and kitchen machines: their fronts look to -z."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.library.parametric.decals import number_plate, picture_paint, text_picture
from cadpose.library.parametric.registry import make
from tests.library.parametric.surfaces import surface_of

SEEDS = range(16)
# What lies in front on models of a category, by the names of materials; at least one is there.
IN_FRONT = {
    "clock": ("dial", "display"),
    "oven": ("window", "dark glass"),
    "microwave": ("display",),
    "washing machine": ("door glass", "display"),
}


@pytest.mark.parametrize("category", sorted(IN_FRONT))
def test_dials_and_doors_look_to_the_front(category: str) -> None:
    for seed in SEEDS:
        mesh = make(category, seed)
        low, high = mesh.bounds[:, 2]
        found = [p for p in (surface_of(mesh, name) for name in IN_FRONT[category]) if len(p)]
        assert found
        for points in found:
            assert points[:, 2].mean() < low + 0.5 * (high - low)


def test_a_bottle_stands_upright_with_its_label_in_front() -> None:
    labelled = 0
    for seed in range(30):
        mesh = make("bottle", seed)
        size = mesh.bounds[1] - mesh.bounds[0]
        assert size[1] > 0.9 * max(size[0], size[2])
        textured = [m.name for m in mesh.materials if m.texture is not None]
        for name in textured:
            points = surface_of(mesh, name, textured=True)
            labelled += 1
            assert points[:, 2].min() < 0
    assert labelled > 15


def test_a_laptop_is_open_to_the_front() -> None:
    for seed in SEEDS:
        mesh = make("laptop", seed)
        screens = [surface_of(mesh, name) for name in ("screen", "dark glass")]
        screen = next(p for p in screens if len(p))
        pad = surface_of(mesh, "touch pad")
        # The screen stands behind the touch pad and above it.
        assert screen[:, 2].mean() > pad[:, 2].mean() + 0.2
        assert screen[:, 1].mean() > pad[:, 1].mean() + 0.1


def test_a_cup_has_its_handle_at_its_own_left() -> None:
    handled = 0
    for seed in range(24):
        mesh = make("cup", seed)
        # The drink's surface lies in the cup's middle; a handle moves the middle of the bounds off it.
        drink = surface_of(mesh, "drink")
        if len(drink):
            off = drink[:, 0].mean()
            assert off > -0.02
            handled += off > 0.05
    assert handled >= 4


def test_a_bag_has_more_to_see_in_front_than_behind() -> None:
    detail = []
    for seed in range(24):
        mesh = make("bag", seed)
        z = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
        low, high = mesh.bounds[:, 2]
        detail.append(int((z < low + 0.25 * (high - low)).sum() - (z > high - 0.25 * (high - low)).sum()))
    assert np.mean(np.array(detail) >= 0) > 0.6


def test_a_picture_is_the_right_way_round_for_who_looks_at_it() -> None:
    image = np.zeros((8, 8, 3), np.uint8)
    image[:4, :4] = 255  # white at the top left
    for to_front, left_x in ((True, 0.25), (False, -0.25)):
        texture = picture_paint(image, 1.0, "x", to_front).material.texture
        assert texture is not None
        # Seen from the front, the picture's left lies at +x; from the back, at -x.
        u, v = left_x % 1.0, 0.25
        assert texture[int((1 - v) * 8) % 8, int(u * 8) % 8].tolist() == [255, 255, 255]
        assert texture[int((1 - v) * 8) % 8, int((-left_x % 1.0) * 8) % 8].tolist() == [0, 0, 0]


def test_words_are_written_and_plates_differ() -> None:
    picture = text_picture(64, [("AB", 0.5, 0.5, 0.4)], (255, 255, 255), (0, 0, 0))
    dark = picture[..., 0] < 128
    assert dark.any() and not dark[:8].any() and not dark[-8:].any()
    one, other = (number_plate(np.random.default_rng(s), (0, 0, 0), True)[0] for s in (1, 2))
    assert not np.array_equal(one.material.texture, other.material.texture)  # type: ignore[arg-type]
