"""Cups: mugs, cups on saucers, paper cups and tumblers; a handle points to the own left, a print to -z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.decals import picture_paint, random_word, text_picture
from cadpose.library.parametric.finishes import BLACK, CHROME, WHITE
from cadpose.library.parametric.paints import Colour, any_colour, darker, plain, wood
from cadpose.library.parametric.shapes import cylinder, grid, lathe, smooth_path, torus, tube
from cadpose.library.parametric.solids import Builder, Paint

_DRINKS: tuple[Colour, ...] = ((0.16, 0.08, 0.04), (0.55, 0.35, 0.2), (0.62, 0.3, 0.08), (0.85, 0.78, 0.68))


def cup(rng: Generator) -> Mesh:
    """Any kind of cup."""
    build = Builder()
    kinds = (_mug, _teacup, _paper_cup, _tumbler)
    kinds[int(rng.choice(4, p=[0.46, 0.24, 0.2, 0.1]))](build, rng)
    return build.mesh("cup")


def _glaze(rng: Generator) -> Paint:
    kind = rng.random()
    if kind < 0.35:
        return plain((0.93, 0.92, 0.9), "glaze")
    return plain(any_colour(rng), "glaze") if kind < 0.85 else plain((0.13, 0.13, 0.14), "glaze")


def _wall(build: Builder, look: Paint, inside: Paint, outer: list[tuple[float, float]], thick: float) -> None:
    """A vessel through (radius, y) of its outside, with an inside of another look."""
    curve = [(float(r), float(y)) for r, y in smooth_path(np.array(outer), 3)]
    rim_r, rim_y = curve[-1]
    inner = [(r - thick, y + thick) for r, y in reversed(curve) if r > 2 * thick and y < rim_y - thick]
    solid = lathe([*curve, (rim_r - 0.5 * thick, rim_y + 0.4 * thick), (rim_r - thick, rim_y), *inner], 32)
    build.add(look, solid)
    level = 0.75 * rim_y
    r_at = float(np.interp(level, [y for _, y in curve], [r for r, _ in curve]))
    build.add(inside, cylinder(r_at - 0.9 * thick, 0.001, (0, level, 0), 28))


def _handle(
    build: Builder, look: Paint, r_top: float, r_low: float, top: float, low: float, out: float, thick: float
) -> None:
    """A loop at -x."""
    path = [
        (-r_top + 0.002, top, 0),
        (-r_top - 0.8 * out, top + 0.02 * out, 0),
        (-r_top - out, 0.5 * (top + low), 0),
        (-r_low - 0.6 * out, low + 0.1 * (top - low), 0),
        (-r_low + 0.002, low, 0),
    ]
    build.add(look, tube(smooth_path(np.array(path), 5), thick, 8))


def _mug(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    look = _glaze(rng)
    r, high = u(0.038, 0.046), u(0.085, 0.115)
    low_r = r * u(0.78, 1.02)
    belly = r * u(0.97, 1.08)
    drink = plain(_DRINKS[int(rng.integers(4))], "drink")
    _wall(build, look, drink, [(0.93 * low_r, 0.0), (low_r, 0.006), (belly, 0.45 * high), (r, high)], 0.004)
    handle = look if rng.random() < 0.85 else plain(any_colour(rng), "handle")
    _handle(
        build, handle, r, low_r, u(0.76, 0.86) * high, u(0.2, 0.32) * high, u(0.026, 0.034), u(0.0045, 0.0065)
    )
    kind = rng.random()
    if kind < 0.3:
        band = plain(any_colour(rng), "band")
        for k in range(int(rng.integers(1, 4))):
            y = (0.2 + 0.2 * k) * high
            rr = float(np.interp(y, [0, 0.45 * high, high], [low_r, belly, r])) + 0.0012
            turn = np.linspace(0, 2 * np.pi, 29)
            rows = np.stack(
                [
                    np.stack([rr * np.cos(turn), np.full(29, level), rr * np.sin(turn)], 1)
                    for level in (y, y + 0.06 * high)
                ]
            )
            build.add(band, grid(rows))
    elif kind < 0.7:
        red, green, blue = (int(255 * c) for c in look.material.rgba[:3])
        ink = (
            (250, 250, 250)
            if red + green + blue < 380
            else [(180, 30, 40), (30, 60, 140), (30, 30, 30)][int(rng.integers(3))]
        )
        words = [
            (random_word(rng, int(rng.integers(3, 6))), 0.5, 0.42, 0.26),
            (random_word(rng, 7), 0.5, 0.64, 0.1),
        ]
        picture = text_picture(96, words, (red, green, blue), ink)
        turn = np.radians(np.linspace(-42, 42, 9))
        rr = max(belly, r, low_r) + 0.0012
        rows = np.stack(
            [
                np.stack([rr * np.sin(turn), np.full(9, y), -rr * np.cos(turn)], 1)
                for y in (-0.28 * high, 0.28 * high)
            ]
        )
        build.add(picture_paint(picture, 1.5 * r, "print"), grid(rows).moved(0, 0.5 * high, 0))


def _teacup(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    look = _glaze(rng)
    r, high = u(0.04, 0.05), u(0.05, 0.07)
    drink = plain(_DRINKS[int(rng.integers(4))], "drink")
    foot = 0.006
    _wall(
        build,
        look,
        drink,
        [(0.45 * r, foot), (0.68 * r, foot + 0.006), (u(0.85, 0.95) * r, 0.55 * high), (r, high)],
        0.003,
    )
    _handle(build, look, 0.96 * r, 0.8 * r, 0.82 * high, 0.36 * high, u(0.016, 0.024), 0.0035)
    trim = plain((0.8, 0.66, 0.32), "gold") if rng.random() < 0.3 else plain(any_colour(rng), "trim")
    if rng.random() < 0.5:
        build.add(trim, torus(r - 0.001, 0.0018, (0, high, 0), 32, 5))
    plate_r = r * u(1.5, 1.8)
    if rng.random() < 0.8:
        saucer = [
            (0.5 * plate_r, 0.0),
            (0.62 * plate_r, 0.004),
            (0.95 * plate_r, 0.013),
            (plate_r, 0.016),
            (0.96 * plate_r, 0.016),
            (0.6 * plate_r, 0.0075),
        ]
        build.add(look if rng.random() < 0.8 else darker(look, 0.6), lathe(saucer, 36))
        if rng.random() < 0.3:
            spoon = [
                (0.3 * plate_r, 0.018, -0.75 * plate_r),
                (0.0, 0.018, -0.8 * plate_r),
                (-0.55 * plate_r, 0.02, -0.7 * plate_r),
            ]
            build.add(CHROME, tube(smooth_path(np.array(spoon), 4), [0.006, *([0.0022] * 8)], 6))
    else:
        build.add(look, lathe([(0.46 * r, 0.0), (0.42 * r, foot + 0.002)], 24))


def _paper_cup(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    look = [WHITE, plain((0.75, 0.6, 0.42), "card"), plain(any_colour(rng), "card")][int(rng.integers(3))]
    r, high = u(0.038, 0.045), u(0.09, 0.15)
    low_r = u(0.68, 0.76) * r
    build.add(look, lathe([(low_r, 0.0), (r, high)], 32))
    if rng.random() < 0.75:
        cap = WHITE if rng.random() < 0.5 else BLACK
        build.add(
            cap,
            lathe(
                [
                    (1.05 * r, high - 0.004),
                    (1.06 * r, high + 0.004),
                    (0.97 * r, high + 0.007),
                    (0.93 * r, high + 0.017),
                    (0.82 * r, high + 0.018),
                    (0.8 * r, high + 0.012),
                ],
                32,
            ),
        )
    else:
        build.add(
            plain(_DRINKS[int(rng.integers(4))], "drink"),
            cylinder(0.96 * r, 0.0015, (0, high - 0.0005, 0), 28),
        )
        build.add(look, torus(r, 0.0022, (0, high, 0), 32, 6))
    if rng.random() < 0.65:
        sleeve = (
            plain((0.66, 0.5, 0.33), "sleeve") if rng.random() < 0.6 else plain(any_colour(rng), "sleeve")
        )
        y0, y1 = 0.32 * high, 0.72 * high
        a, b = (low_r + (r - low_r) * y / high + 0.0012 for y in (y0, y1))
        build.add(sleeve, lathe([(a, y0), (b, y1)], 32))
    words = [(random_word(rng, 4), 0.5, 0.45, 0.24), (random_word(rng, 7), 0.5, 0.62, 0.09)]
    paper = (245, 245, 240) if rng.random() < 0.5 else (40, 80, 60)
    picture = text_picture(96, words, paper, (30, 50, 40) if sum(paper) > 400 else (250, 250, 250))
    turn = np.radians(np.linspace(-26, 26, 7))
    rows = []
    for y in (0.38 * high, 0.64 * high):
        rr = low_r + (r - low_r) * y / high + 0.0024
        rows.append(np.stack([rr * np.sin(turn), np.full(7, y - 0.51 * high), -rr * np.cos(turn)], 1))
    build.add(picture_paint(picture, 0.9 * r, "print"), grid(np.stack(rows)).moved(0, 0.51 * high, 0))


def _tumbler(build: Builder, rng: Generator) -> None:
    """A beaker without a handle: of plastic, wood or enamel."""
    u = rng.uniform
    look = wood(rng) if rng.random() < 0.2 else plain(any_colour(rng), "beaker")
    r, high = u(0.036, 0.046), u(0.09, 0.13)
    low_r = u(0.66, 0.9) * r
    _wall(
        build,
        look,
        darker(look, 0.4),
        [(0.9 * low_r, 0.0), (low_r, 0.005), ((low_r + r) / 2, 0.5 * high), (r, high)],
        0.0035,
    )
    for k in range(int(rng.integers(0, 4))):
        y = (0.78 + 0.06 * k) * high
        build.add(darker(look, 0.85), torus(low_r + (r - low_r) * y / high, 0.0014, (0, y, 0), 32, 5))
