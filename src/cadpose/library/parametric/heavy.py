"""Buses and trucks; cab, windscreen and headlights at -z, red lights at +z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.decals import number_plate, picture_paint, random_word, text_picture
from cadpose.library.parametric.finishes import AMBER, BLACK, CHROME, DARK_GLASS, LENS, RED_LIGHT, STEEL
from cadpose.library.parametric.paints import Colour, any_colour, darker, plain
from cadpose.library.parametric.shapes import bar, box, cylinder, extrude, lathe, rounded_box, tube
from cadpose.library.parametric.solids import Builder, Paint
from cadpose.library.parametric.wheels import MIRROR_X, car_wheel

_COLOURS: tuple[Colour, ...] = ((0.92, 0.92, 0.92), (0.75, 0.08, 0.08), (0.10, 0.25, 0.58), (0.93, 0.75,
    0.12), (0.12, 0.42, 0.24), (0.60, 0.62, 0.65), (0.90, 0.45, 0.08), (0.10, 0.10, 0.11), (0.30, 0.62,
    0.78), (0.42, 0.08, 0.12))  # fmt: skip
_RIM = plain((0.70, 0.71, 0.73), "rim")


def _colour(rng: Generator) -> Paint:
    return plain(
        _COLOURS[
            int(rng.choice(len(_COLOURS), p=[0.26, 0.16, 0.14, 0.1, 0.08, 0.08, 0.06, 0.04, 0.04, 0.04]))
        ],
        "paint",
    )


def _wheels(build: Builder, half: float, radius: float, axles: list[float], floor: float) -> None:
    """Pairs of wheels in dark half-round arches that stand a little proud of the sides."""
    wheel = car_wheel(radius, 0.32, _RIM, 0, sides=16)
    start = np.arcsin(np.clip((floor - radius) / (1.15 * radius), -1, 1))
    t = np.linspace(start, np.pi - start, 13)
    arch = np.stack([1.15 * radius * np.cos(t), radius + 1.15 * radius * np.sin(t)], 1)
    for z in axles:
        build.include(wheel, None, (half - 0.14, radius, z))
        build.include(wheel, MIRROR_X, (0.14 - half, radius, z))
        build.add(BLACK, extrude(arch, 2 * half + 0.012, "zy").moved(0, 0, z))


def _pane(build: Builder, paint: Paint, line: ArrayLike, width: float, thick: float = 0.02) -> None:
    """A sheet across the vehicle that stands on a slanting (z, y) line of its front, pushed out a little."""
    a, b = np.asarray(line, np.float64)
    way = (b - a) / np.linalg.norm(b - a)
    out = np.array([-way[1], way[0]]) * thick
    build.add(paint, extrude(np.stack([a - out, b - out, b + out, a + out]), width, "zy"))


def _mirrors(build: Builder, half: float, y: float, z: float, high: float) -> None:
    build.add(BLACK, tube([(half - 0.05, y + high, z + 0.1), (half + 0.16, y + high, z - 0.12), (half + 0.18,
        y + 0.5 * high, z - 0.12)], 0.022, 6).pair())  # fmt: skip
    build.add(BLACK, rounded_box((0.22, high, 0.12), (half + 0.19, y + 0.3 * high, z - 0.12), 0.04).pair())


def _lamps(build: Builder, rng: Generator, half: float, y: float, z: float, wide: float) -> None:
    """Headlights with indicators, bumper and plate at the front."""
    x = half - wide / 2 - 0.1
    round_ = rng.random() < 0.35
    if round_:
        build.add(LENS, cylinder(0.12, 0.06, sides=16).turned("x", -90).moved(x, y, z + 0.02).pair())
    else:
        build.add(BLACK, rounded_box((wide + 0.05, 0.24, 0.06), (x, y, z), 0.03).pair())
        build.add(LENS, rounded_box((wide - 0.03, 0.17, 0.06), (x, y, z - 0.015), 0.03).pair())
    build.add(AMBER, box((0.07, 0.12, 0.06), (half - 0.05, y, z - 0.012)).pair())


def _tail(build: Builder, rng: Generator, half: float, y: float, z: float, upright: bool) -> None:
    size = (0.14, 0.5, 0.05) if upright else (0.4, 0.14, 0.05)
    x = half - size[0] / 2 - 0.08
    build.add(RED_LIGHT, rounded_box(size, (x, y, z), 0.02).pair())
    build.add(
        AMBER,
        box(
            (size[0] * 0.8 if upright else 0.1, 0.1, 0.05), (x, y + (0.1 if upright else 0.0), z + 0.008)
        ).pair(),
    )
    build.add(*number_plate(rng, (0.0, y - 0.1, z + 0.02), to_front=False))


def bus(rng: Generator) -> Mesh:
    """A city bus, coach, double-decker or school bus."""
    build = Builder()
    if rng.random() < 0.14:
        _school_bus(build, rng)
        return build.mesh("bus")
    u = rng.uniform
    double, coach = rng.random() < 0.2, rng.random() < 0.4
    paint = _colour(rng)
    second = plain(any_colour(rng), "stripe") if rng.random() < 0.6 else darker(paint, 0.5)
    long, half = u(9.5, 12.5), 1.25
    high = 4.3 if double else (u(3.2, 3.6) if coach else u(2.9, 3.15))
    low = 0.32
    z0, z1 = -long / 2, long / 2
    build.add(paint, rounded_box((2 * half, high - low, long), (0, (high + low) / 2, 0), 0.16, 2))
    build.add(BLACK, box((2 * half - 0.1, 0.1, long - 0.3), (0, low - 0.02, 0)))
    belt = u(1.25, 1.4) if not coach else u(1.55, 1.75)
    rows = [(belt, 2.35), (2.95, 3.95)] if double else [(belt, high - 0.42)]
    for y0, y1 in rows:
        build.add(DARK_GLASS, box((2 * half + 0.02, y1 - y0, long - 1.2), (0, (y0 + y1) / 2, 0.1)))
        count = int(rng.integers(5, 9))
        pillar = paint if rng.random() < 0.5 else BLACK
        for k in range(1, count):
            build.add(
                pillar,
                box(
                    (2 * half + 0.035, y1 - y0, 0.07), (0, (y0 + y1) / 2, z0 + 0.7 + k * (long - 1.2) / count)
                ),
            )
    stripe = u(0.12, 0.5)
    build.add(second, box((2 * half + 0.016, stripe, long - 0.34), (0, u(0.7, 1.0), 0)))
    # Windscreen, sign, doors at the own right, as where one drives on the right.
    foot = belt - (0.35 if not coach else 0.5)
    sign = 2.5 if double else high - 0.3
    build.add(
        DARK_GLASS,
        rounded_box(
            (2 * half - 0.12, sign - 0.1 - foot, 0.12), (0, (foot + sign - 0.1) / 2, z0 + 0.03), 0.05
        ),
    )
    if double:
        build.add(DARK_GLASS, rounded_box((2 * half - 0.12, 1.05, 0.12), (0, 3.45, z0 + 0.03), 0.05))
    words = [(f"{int(rng.integers(1, 400))}  {random_word(rng, 6)}", 0.5, 0.5, 0.13)]
    picture = text_picture(128, words, (14, 14, 16), [(255, 180, 40), (245, 245, 245)][int(rng.integers(2))])
    build.add(picture_paint(picture, 1.7, "sign"), box((1.7, 0.25, 0.1)).moved(0, sign + 0.04, z0 + 0.035))
    for z in (z0 + 0.75, 0.3) if not coach else (z0 + 0.75,):
        build.add(BLACK, box((0.05, 1.95, 1.15), (half - 0.002, 1.38, z)))
        for shift in (-0.28, 0.28):
            build.add(DARK_GLASS, box((0.05, 1.75, 0.48), (half + 0.008, 1.4, z + shift)))
    _lamps(build, rng, half, 0.78, z0 - 0.01, 0.34)
    build.add(BLACK, rounded_box((2 * half + 0.02, 0.26, 0.3), (0, 0.46, z0 + 0.12), 0.05))
    build.add(*number_plate(rng, (0.0, 0.48, z0 - 0.04), to_front=True))
    build.add(BLACK if rng.random() < 0.5 else CHROME, box((0.8, 0.12, 0.04), (0, 0.8, z0)))
    build.add(
        DARK_GLASS, rounded_box((2 * half - 0.5, 0.75, 0.06), (0, min(high - 0.75, 2.1), z1 - 0.01), 0.04)
    )
    build.add(BLACK, box((1.6, 0.55, 0.05), (0, 1.0, z1 - 0.01)))
    for k in range(4):
        build.add(STEEL, box((1.5, 0.03, 0.05), (0, 0.82 + 0.12 * k, z1)))
    _tail(build, rng, half, 0.85, z1, True)
    build.add(BLACK, rounded_box((2 * half + 0.02, 0.2, 0.3), (0, 0.44, z1 - 0.12), 0.05))
    _wheels(
        build,
        half,
        0.49,
        [z0 + 2.6, z1 - 3.0] if rng.random() < 0.75 else [z0 + 2.6, z1 - 3.6, z1 - 2.4],
        low,
    )
    _mirrors(build, half, 1.9 if not coach else 2.3, z0 + 0.1, 0.4)
    if not double:
        for z in (-2.0, 2.2) if rng.random() < 0.5 else (u(-1, 2),):
            build.add(plain((0.85, 0.85, 0.85), "roof unit"), rounded_box((1.7, 0.22, 2.0), (0, high + 0.06,
                z), 0.08))  # fmt: skip
    return build.mesh("bus")


def _school_bus(build: Builder, rng: Generator) -> None:
    """Yellow, with a bonnet."""
    yellow = plain((0.95, 0.68, 0.08), "paint") if rng.random() < 0.8 else _colour(rng)
    long, half, high = rng.uniform(8.5, 10.5), 1.2, 3.1
    z0, z1 = -long / 2, long / 2
    cab = z0 + 1.4
    build.add(
        yellow, rounded_box((2 * half, high - 0.5, z1 - cab), (0, (high + 0.5) / 2, (z1 + cab) / 2), 0.18, 2)
    )
    build.add(
        yellow,
        rounded_box((1.75, 1.05, 1.7), (0, 1.1, z0 + 0.85), 0.14),
        rounded_box((2.2, 0.5, 1.3), (0, 0.8, z0 + 0.75), 0.14),
    )
    build.add(DARK_GLASS, rounded_box((2.1, 0.9, 0.1), (0, 2.15, cab + 0.02), 0.04))
    build.add(BLACK, box((1.2, 0.6, 0.06), (0, 1.1, z0 - 0.005)))
    for k in range(5):
        build.add(STEEL, box((1.15, 0.03, 0.06), (0, 0.88 + 0.11 * k, z0 - 0.012)))
    build.add(LENS, cylinder(0.13, 0.06, sides=16).turned("x", -90).moved(0.74, 1.0, z0 + 0.05).pair())
    build.add(
        BLACK, box((2.3, 0.25, 0.15), (0, 0.55, z0 - 0.02)), box((2.4, 0.25, 0.15), (0, 0.6, z1 + 0.02))
    )
    count = 9
    for k in range(count):
        z = cab + 0.9 + k * (z1 - cab - 1.5) / (count - 1)
        build.add(DARK_GLASS, box((2 * half + 0.02, 0.62, (z1 - cab - 1.5) / count * 0.85), (0, 2.25, z)))
    for y in (1.75, 1.3, 0.95):
        build.add(BLACK, box((2 * half + 0.03, 0.05, z1 - cab - 0.4), (0, y, (z1 + cab) / 2)))
    build.add(DARK_GLASS, box((0.05, 1.7, 0.7), (half - 0.01, 1.5, cab + 0.5)))
    picture = text_picture(128, [("SCHOOL BUS", 0.5, 0.5, 0.14)], (240, 172, 20), (15, 15, 15))
    build.add(picture_paint(picture, 1.5, "sign"), box((1.5, 0.26, 0.06)).moved(0, high - 0.22, cab + 0.01))
    build.add(
        picture_paint(picture, 1.5, "sign", False), box((1.5, 0.26, 0.06)).moved(0, high - 0.22, z1 - 0.01)
    )
    for x in (-0.95, 0.95):
        build.add(RED_LIGHT, cylinder(0.1, 0.06, sides=14).turned("x", 90).moved(x, high - 0.22, z1 - 0.02))
        build.add(AMBER, cylinder(0.1, 0.06, sides=14).turned("x", -90).moved(x, high - 0.22, cab + 0.03))
    build.add(DARK_GLASS, box((1.9, 0.7, 0.05), (0, 2.2, z1)))
    _tail(build, rng, half, 1.15, z1, False)
    _wheels(build, half, 0.5, [z0 + 0.95, z1 - 2.4], 0.5)
    _mirrors(build, 1.1, 1.5, z0 + 1.0, 0.35)


def truck(rng: Generator) -> Mesh:
    """A lorry: cab over engine or bonneted, with box, trailer, tipper, flatbed or tank."""
    u = rng.uniform
    build = Builder()
    paint = _colour(rng)
    half = u(1.18, 1.25)
    bonnet = u(1.3, 1.7) if rng.random() < 0.28 else 0.0
    kind = int(rng.choice(5, p=[0.34, 0.24, 0.16, 0.12, 0.14]))
    deck = u(1.0, 1.15)
    load = {0: u(4.8, 7.2), 1: u(9.0, 12.5), 2: u(4.2, 5.2), 3: u(5.0, 7.0), 4: u(5.5, 8.5)}[kind]
    cab_long, cab_high = u(1.75, 2.3), u(2.6, 3.3)
    total = bonnet + cab_long + 0.25 + load
    z0 = -total / 2
    back = z0 + bonnet + cab_long
    _cab(build, rng, paint, half, (z0, z0 + bonnet, back), cab_high)
    start = back + 0.25
    _load(build, rng, paint, kind, half, (start, start + load), deck)
    build.add(BLACK, box((0.95, 0.22, total - 0.5), (0, 0.82, 0.2)))
    r = 0.52
    front = z0 + (1.0 if bonnet else 1.35)
    if kind == 1:
        axles = [
            front,
            start + 0.6,
            *([start + 1.75] if bonnet else []),
            start + load - 3.2,
            start + load - 1.95,
        ]
    elif load > 5.5:
        axles = [front, start + load - 2.6, start + load - 1.45]
    else:
        axles = [front, start + load - 1.5]
    wheel = car_wheel(r, 0.34, _RIM, 0, sides=14)
    for z in axles:
        build.include(wheel, None, (half - 0.18, r, z))
        build.include(wheel, MIRROR_X, (0.18 - half, r, z))
        if z != front:
            build.add(BLACK, box((2 * half - 0.1, 0.03, 1.1), (0, 2 * r + 0.02, z)))
    build.add(
        STEEL if rng.random() < 0.6 else BLACK,
        cylinder(0.3, 1.1, sides=16)
        .turned("x", 90)
        .moved(half - 0.4, 0.68, start + 1.2 - (0.9 if kind != 1 else 0))
        .pair(),
    )
    z1 = start + load
    build.add(BLACK, box((2 * half - 0.1, 0.14, 0.1), (0, 0.62, z1 - 0.06)))
    _tail(build, rng, half, 0.88, z1 - 0.02, False)
    return build.mesh("truck")


def _cab(
    build: Builder, rng: Generator, paint: Paint, half: float, along: tuple[float, float, float], high: float
) -> None:
    """Cab and, maybe, bonnet; ``along`` holds z of the nose, the cab's front and its back."""
    u = rng.uniform
    nose, front, back = along
    low = 0.55
    belt = u(1.6, 1.8) if nose == front else u(1.75, 1.9)
    rake = u(0.08, 0.3)
    top = high if nose == front else min(high, 2.8)
    foot = (front + 0.02, belt - 0.05)
    head = (front + rake, top - 0.28)
    profile = [(front, low), (back, low), (back, top), (front + rake + 0.3, top), (front + rake + 0.04,
        top - 0.12), head, foot, (front, belt - 0.25)]  # fmt: skip
    build.add(paint, extrude(profile, 2 * half, "zy"))
    _pane(build, DARK_GLASS, [foot, head], 2 * half - 0.12)
    glass = [(front + 0.2, belt), (front + 1.2, belt), (front + 1.2, top - 0.4), (front + 0.2 + 0.8 * rake,
        top - 0.4)]  # fmt: skip
    build.add(DARK_GLASS, extrude(glass, 2 * half + 0.02, "zy"))
    build.add(BLACK, box((2 * half + 0.015, top - 1.0, 0.02), (0, (top + 0.6) / 2, front + 1.3)))
    build.add(BLACK, box((2 * half + 0.02, 0.03, 0.16), (0, belt - 0.15, front + 1.12)))
    _mirrors(build, half, belt + 0.1, front + 0.15, 0.42)
    if nose < front:
        build.add(
            paint, rounded_box((1.5, 1.0, front - nose + 0.3), (0, 1.22, (front + nose) / 2 + 0.15), 0.12)
        )
        build.add(
            paint, rounded_box((2 * half, 0.45, front - nose), (0, 0.98, (front + nose) / 2 + 0.1), 0.14)
        )
        if rng.random() < 0.6:
            build.add(CHROME, tube([(half + 0.02, 0.9, back + 0.1), (half + 0.02, top + 0.35, back + 0.1)],
                0.075, 10).pair())  # fmt: skip
    lattice = CHROME if rng.random() < 0.4 else BLACK
    wide = 1.2 if nose < front else u(1.3, 1.9)
    build.add(BLACK, box((wide, 0.62, 0.05), (0, 1.22, nose - 0.005)))
    for k in range(int(rng.integers(3, 6))):
        build.add(
            STEEL if lattice is BLACK else CHROME,
            box((wide - 0.08, 0.035, 0.05), (0, 1.0 + 0.12 * k, nose - 0.012)),
        )
    bumper = BLACK if rng.random() < 0.5 else (CHROME if rng.random() < 0.4 else paint)
    build.add(bumper, rounded_box((2 * half + 0.03, 0.36, 0.3), (0, 0.55, nose + 0.1), 0.05))
    _lamps(build, rng, half, 0.6 if nose == front else 1.02, nose - (0.06 if nose == front else 0.0), 0.34)
    build.add(*number_plate(rng, (0.0, 0.48, nose - 0.06), to_front=True))
    if rng.random() < 0.5:
        shield = [(front + 0.7, top), (back, top), (back, top + 0.5)]
        build.add(paint, extrude(shield, 1.8 * half, "zy"))
    for x in np.linspace(-0.7, 0.7, 5) * half:
        build.add(AMBER, box((0.1, 0.05, 0.06), (float(x), top - 0.03, front + rake + 0.2)))
    build.add(
        BLACK, box((2 * half - 0.02, 0.5, 0.9), (0, 0.68, front + 0.55 if nose < front else back - 0.35))
    )
    # The front wheels' arches.
    axle = nose + (1.0 if nose < front else 1.35)
    t = np.linspace(0, np.pi, 13)
    arch = np.stack([0.6 * np.cos(t), 0.55 + 0.58 * np.sin(t)], 1)
    build.add(BLACK, extrude(arch, 2 * half + 0.012, "zy").moved(0, 0, axle))


def _load(
    build: Builder,
    rng: Generator,
    paint: Paint,
    kind: int,
    half: float,
    along: tuple[float, float],
    deck: float,
) -> None:
    u = rng.uniform
    z0, z1 = along
    middle, long = (z0 + z1) / 2, z1 - z0
    if kind <= 1:
        top = u(3.2, 3.9)
        skin = plain([(0.92, 0.92, 0.92), (0.75, 0.76, 0.78), (0.85, 0.82, 0.75)][int(rng.integers(3))],
            "box") if rng.random() < 0.65 else plain(any_colour(rng), "box")  # fmt: skip
        build.add(skin, box((2 * half + 0.06, top - deck, long), (0, (top + deck) / 2, middle)))
        edge = darker(skin, 0.75)
        for x in (-1.0, 1.0):
            for z in (z0, z1):
                build.add(
                    edge, box((0.07, top - deck + 0.02, 0.07), (x * (half + 0.02), (top + deck) / 2, z))
                )
            build.add(
                edge,
                box((0.07, 0.09, long), (x * (half + 0.02), top, middle)),
                box((0.07, 0.12, long), (x * (half + 0.02), deck, middle)),
            )
        build.add(BLACK, box((0.03, top - deck - 0.1, 0.02), (0, (top + deck) / 2, z1 + 0.005)))
        for x in (-0.3, 0.3):
            build.add(STEEL, bar((x, deck + 0.05, z1 + 0.02), (x, top - 0.05, z1 + 0.02), 0.04))
        if rng.random() < 0.55:
            red, green, blue = (int(255 * c) for c in skin.material.rgba[:3])
            ink = (250, 250, 250) if red + green + blue < 380 else [(180, 25, 30), (25, 60, 140), (30, 30,
                30)][int(rng.integers(3))]  # fmt: skip
            word = random_word(rng, int(rng.integers(4, 8)))
            side = min(0.8 * long, 5.0)
            for sign in (1.0, -1.0):
                # The picture looks to +z when made; a quarter turn lays it on a side.
                picture = text_picture(128, [(word, 0.5, 0.5, 0.2)], (red, green, blue), ink)
                sheet = box((side, 0.28 * side, 0.01)).turned("y", 90.0 * sign)
                build.add(
                    picture_paint(picture, side, "lettering", False),
                    sheet.moved(sign * (half + 0.033), (top + deck) / 2 + 0.1, middle),
                )
    elif kind == 2:
        body = paint if rng.random() < 0.3 else plain([(0.85, 0.6, 0.1), (0.4, 0.42, 0.44), (0.75, 0.2,
            0.1)][int(rng.integers(3))], "tipper")  # fmt: skip
        rise = u(0.9, 1.3)
        build.add(
            body,
            box((2 * half, 0.1, long), (0, deck + 0.05, middle)),
            box((2 * half, rise + 0.4, 0.08), (0, deck + (rise + 0.4) / 2, z0)),
            box((2 * half, rise, 0.08), (0, deck + rise / 2, z1 - 0.04)),
        )
        for x in (-1.0, 1.0):
            build.add(body, box((0.08, rise, long), (x * half, deck + rise / 2, middle)))
            for k in range(5):
                build.add(
                    darker(body, 0.8),
                    box((0.1, rise, 0.1), (x * (half + 0.02), deck + rise / 2, z0 + (k + 0.5) * long / 5)),
                )
        if rng.random() < 0.5:
            mound = [(z0 + 0.1, deck + 0.1), (z1 - 0.1, deck + 0.1), (middle + 0.8, deck + rise + 0.25),
                (middle - 0.8, deck + rise + 0.25)]  # fmt: skip
            build.add(plain((0.5, 0.42, 0.3), "sand"), extrude(mound, 2 * half - 0.2, "zy"))
    elif kind == 3:
        wood = plain((0.5, 0.36, 0.22), "planks")
        build.add(wood, box((2 * half, 0.12, long), (0, deck + 0.06, middle)))
        build.add(paint, box((2 * half, 0.9, 0.08), (0, deck + 0.5, z0)))
        if rng.random() < 0.6:
            for x in (-1.0, 1.0):
                build.add(paint, box((0.05, 0.45, long), (x * half, deck + 0.3, middle)))
            build.add(paint, box((2 * half, 0.45, 0.05), (0, deck + 0.3, z1 - 0.03)))
        for _ in range(int(rng.integers(0, 4))):
            size = (u(0.8, 1.6), u(0.5, 1.2), u(0.8, 1.4))
            at = (u(-0.4, 0.4), deck + 0.12 + size[1] / 2, u(z0 + 1.0, z1 - 1.0))
            build.add(plain(any_colour(rng), "crate"), box(size, at))
    else:
        r = u(0.85, 1.05)
        skin = CHROME if rng.random() < 0.4 else plain(any_colour(rng), "tank")
        drum = [(0.75 * r, 0.0), (r, 0.15), (r, long - 0.15), (0.75 * r, long)]
        build.add(skin, lathe(drum, 24).turned("x", 90).scaled(x=1.1).moved(0, deck + 0.1 + r, z0))
        for share in (0.1, 0.37, 0.63, 0.9):
            build.add(BLACK, box((1.5, 0.35, 0.12), (0, deck + 0.1, z0 + share * long)))
        for share in (0.2, 0.5, 0.8):
            build.add(STEEL, cylinder(0.2, 0.1, (0, deck + 0.06 + 2 * r, z0 + share * long), 14))
        build.add(STEEL, bar((0.5, deck + 0.2, z1 + 0.02), (0.5, deck + 2 * r, z1 - 0.05), 0.04))
