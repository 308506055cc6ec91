"""Bicycles: road, mountain, city, step-through and BMX; chain and chainring at the own right."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.finishes import BLACK, CHROME, LENS, RED_LIGHT, STEEL
from cadpose.library.parametric.hulls import hull, mudguard
from cadpose.library.parametric.paints import any_colour, plain, wicker
from cadpose.library.parametric.shapes import bar, box, cylinder, rounded_box, smooth_path, torus, tube
from cadpose.library.parametric.solids import Array, Builder, Paint
from cadpose.library.parametric.wheels import RUBBER, along_x, spoked_wheel

STYLES = ("road", "mountain", "city", "step", "bmx")


def bicycle(rng: Generator) -> Mesh:
    """Any kind of bicycle."""
    return bicycle_of_style(rng, STYLES[int(rng.choice(len(STYLES), p=[0.22, 0.26, 0.2, 0.2, 0.12]))])


def bicycle_of_style(rng: Generator, style: str) -> Mesh:
    """A bicycle of one of `STYLES`."""
    u = rng.uniform
    build = Builder()
    colours = [(0.08, 0.08, 0.09), (0.92, 0.92, 0.92), (0.75, 0.08, 0.08), (0.1, 0.25, 0.6)]
    shade = colours[int(rng.integers(4))] if rng.random() < 0.5 else any_colour(rng)
    paint = plain(shade, "frame")
    r, thick, pipe = {
        "road": (0.335, 0.03, 0.017),
        "mountain": (0.345, 0.06, 0.022),
        "city": (0.345, 0.042, 0.016),
        "step": (0.335, 0.045, 0.018),
        "bmx": (0.255, 0.055, 0.018),
    }[style]
    r *= u(0.96, 1.04)
    base = (1.02 if style != "bmx" else 0.92) * u(0.97, 1.05)
    front, rear = -0.58 * base, 0.42 * base
    tyre = RUBBER if rng.random() < 0.85 else plain((0.55, 0.4, 0.25), "tyre")
    rim = CHROME if rng.random() < 0.6 else (BLACK if rng.random() < 0.7 else paint)
    crank = np.array(
        [0.0, r - 0.06 if style != "bmx" else r + 0.02, rear - 0.42 if style != "bmx" else rear - 0.36]
    )
    seat_top = {"road": 0.80, "mountain": 0.76, "city": 0.78, "step": 0.72, "bmx": 0.52}[style] * u(
        0.96, 1.05
    )
    lean = 0.29
    seat_at = crank + np.array([0.0, seat_top - crank[1], lean * (seat_top - crank[1])])
    head_y = {"road": 0.86, "mountain": 0.88, "city": 0.9, "step": 0.92, "bmx": 0.64}[style] * u(0.98, 1.03)
    rake = 0.31
    head = np.array([0.0, head_y, front + rake * (head_y - r) - 0.04])
    low_head = head + 0.16 * np.array([0.0, -0.95, -0.31])
    _frame(build, paint, pipe, style, (head, low_head, crank, seat_at), (r, rear))
    for z in (front, rear):
        build.include(spoked_wheel(r, thick, rim, tyre, 20, sides=28, wire=0.0022), None, (0, r, z))
    crown = low_head + np.array([0, -0.03, -0.01])
    wide = thick / 2 + 0.022
    fork = smooth_path(
        np.array(
            [
                crown + np.array([0.4 * wide, 0, 0]),
                crown + np.array([wide, -0.06, -0.02]),
                [wide, 0.5 * (r + crown[1]) - 0.02, 0.5 * (front + crown[2]) + 0.01],
                [wide, r, front],
            ]
        ),
        3,
    )
    build.add(paint if style != "mountain" or rng.random() < 0.4 else BLACK, tube(fork, 0.8 * pipe, 7).pair())
    build.add(
        STEEL, bar((-0.06, r, front), (0.06, r, front), 0.016), bar((-0.07, r, rear), (0.07, r, rear), 0.016)
    )
    _saddle(build, rng, style, seat_at)
    _bars(build, rng, style, head)
    _drive(build, rng, crank, (r, rear))
    if style in ("city", "step"):
        _extras(build, rng, paint, r, thick, front, rear, head, seat_at)
    return build.mesh("bicycle")


def _frame(
    build: Builder,
    paint: Paint,
    pipe: float,
    style: str,
    joints: tuple[Array, Array, Array, Array],
    wheel: tuple[float, float],
) -> None:
    head, low, crank, seat = joints
    r, rear = wheel
    lug = crank + 0.86 * (seat - crank)
    if style in ("mountain", "bmx"):
        lug = crank + 0.7 * (seat - crank)
    build.add(paint, tube(np.stack([head, low]), 1.25 * pipe, 8))
    build.add(paint, tube(np.stack([low, crank]), 1.15 * pipe, 8))
    build.add(paint, tube(np.stack([crank, lug]), pipe, 8))
    build.add(CHROME, tube(np.stack([lug, seat]), 0.75 * pipe, 7))
    if style == "step":
        middle = crank + 0.38 * (seat - crank)
        path = smooth_path(
            np.stack([head + 0.5 * (low - head), 0.5 * (head + crank) + np.array([0, 0.02, -0.02]), middle]),
            5,
        )
        build.add(paint, tube(path, pipe, 8))
    else:
        build.add(paint, tube(np.stack([head + 0.2 * (low - head), lug]), pipe, 8))
    axle = np.array([0.05, r, rear])
    build.add(
        paint,
        tube(
            np.stack([crank + np.array([0.025, 0, 0]), crank + np.array([0.045, 0, 0.12]), axle]),
            0.6 * pipe,
            6,
        ).pair(),
    )
    build.add(
        paint,
        tube(
            np.stack([lug + np.array([0.02, -0.01, 0]), lug + np.array([0.04, -0.08, 0.03]), axle]),
            0.55 * pipe,
            6,
        ).pair(),
    )
    build.add(paint, along_x(cylinder(1.3 * pipe, 0.07, (0, -0.035, 0), 10)).moved(*crank))


def _saddle(build: Builder, rng: Generator, style: str, at: Array) -> None:
    y, z = float(at[1]), float(at[2])
    wide = 0.075 if style in ("road", "mountain", "bmx") else 0.105
    look = BLACK if rng.random() < 0.7 else plain((0.45, 0.26, 0.14), "saddle")
    rows = [
        (z - 0.16, y + 0.015, 0.015, 0.012),
        (z - 0.06, y + 0.018, 0.025, 0.018),
        (z + 0.04, y + 0.02, 0.8 * wide, 0.022),
        (z + 0.1, y + 0.022, wide, 0.024),
        (z + 0.13, y + 0.02, 0.8 * wide, 0.015),
    ]
    build.add(look, hull(rows, 0.8, 12))


def _bars(build: Builder, rng: Generator, style: str, head: Array) -> None:
    u = rng.uniform
    y, z = float(head[1]), float(head[2])
    reach = {"road": 0.09, "mountain": 0.07, "city": 0.04, "step": 0.03, "bmx": 0.04}[style]
    rise = {"road": 0.03, "mountain": 0.05, "city": u(0.05, 0.12), "step": u(0.08, 0.16), "bmx": 0.06}[style]
    stem = (0.0, y + rise, z - reach)
    metal = BLACK if style in ("road", "mountain") or rng.random() < 0.4 else CHROME
    build.add(metal, tube([(0, y - 0.02, z), (0, y + rise, z), stem], 0.014, 7))
    grip = BLACK if rng.random() < 0.7 else plain((0.45, 0.26, 0.14), "grip")
    if style == "road":
        path = [
            (0, *stem[1:]),
            (0.17, *stem[1:]),
            (0.21, stem[1], stem[2] - 0.04),
            (0.215, stem[1] - 0.03, stem[2] - 0.09),
            (0.215, stem[1] - 0.11, stem[2] - 0.06),
            (0.215, stem[1] - 0.13, stem[2] + 0.03),
        ]
        build.add(grip, tube(smooth_path(np.array(path), 4), 0.014, 7).pair())
        hood = rounded_box((0.03, 0.05, 0.06), (0.212, stem[1] + 0.01, stem[2] - 0.1), 0.012)
        build.add(BLACK, hood.pair())
        build.add(
            STEEL,
            tube(
                [(0.212, stem[1] + 0.02, stem[2] - 0.12), (0.215, stem[1] - 0.07, stem[2] - 0.13)], 0.006, 5
            ).pair(),
        )
        return
    wide = {"mountain": 0.34, "city": 0.28, "step": 0.29, "bmx": 0.34}[style] * u(0.93, 1.06)
    if style == "bmx":
        path = [
            (0, *stem[1:]),
            (0.06, *stem[1:]),
            (0.14, stem[1] + 0.18, stem[2] + 0.01),
            (wide, stem[1] + 0.2, stem[2] + 0.04),
        ]
        build.add(metal, bar((-0.11, stem[1] + 0.11, stem[2]), (0.11, stem[1] + 0.11, stem[2]), 0.02))
    elif style == "mountain":
        path = [
            (0, *stem[1:]),
            (0.06, *stem[1:]),
            (0.13, stem[1] + u(0.0, 0.03), stem[2]),
            (wide, stem[1] + 0.03, stem[2] + 0.05),
        ]
    else:
        path = [
            (0, *stem[1:]),
            (0.1, stem[1] + 0.02, stem[2] - 0.03),
            (0.24, stem[1] + 0.05, stem[2] + 0.02),
            (wide, stem[1] + 0.04, stem[2] + u(0.14, 0.24)),
        ]
    curve = smooth_path(np.array(path), 4)
    build.add(metal, tube(curve, 0.012, 7).pair())
    way = curve[-1] - curve[-3]
    way /= np.linalg.norm(way)
    build.add(grip, tube(np.stack([curve[-1] - 0.1 * way, curve[-1] + 0.02 * way]), 0.017, 8).pair())
    lever = curve[-1] - 0.11 * way + np.array([0.0, -0.01, -0.035])
    build.add(STEEL, tube(np.stack([lever, lever + 0.09 * way]), 0.005, 5).pair())


def _drive(build: Builder, rng: Generator, crank: Array, wheel: tuple[float, float]) -> None:
    y, z = float(crank[1]), float(crank[2])
    r, rear = wheel
    metal = BLACK if rng.random() < 0.5 else CHROME
    big, small = rng.uniform(0.07, 0.1), 0.035
    build.add(metal, along_x(torus(big, 0.006, sides=22, around=4)).moved(0.055, y, z))
    for k in range(5):
        a = 2 * np.pi * k / 5
        build.add(
            metal,
            bar((0.055, y, z), (0.055, y + big * float(np.cos(a)), z + big * float(np.sin(a))), 0.012, 0.005),
        )
    build.add(STEEL, along_x(cylinder(small, 0.03, (0, -0.015, 0), 14)).moved(0.055, r, rear))
    build.add(
        BLACK,
        bar((0.055, y + big, z), (0.055, r + small, rear), 0.008, 0.006),
        bar((0.055, y - big, z), (0.055, r - small, rear), 0.008, 0.006),
    )
    turn = rng.uniform(0, np.pi)
    for sign in (1, -1):
        end = np.array([sign * 0.085, y + sign * 0.17 * np.cos(turn), z + sign * 0.17 * np.sin(turn)])
        build.add(metal, tube(np.stack([[sign * 0.07, y, z], end]), 0.011, 6))
        build.add(
            BLACK, box((0.09, 0.022, 0.07), (float(end[0]) + sign * 0.055, float(end[1]), float(end[2])))
        )


def _extras(
    build: Builder,
    rng: Generator,
    paint: Paint,
    r: float,
    thick: float,
    front: float,
    rear: float,
    head: Array,
    seat: Array,
) -> None:
    """Mudguards, lamps, rack, basket and chain case of a city bicycle."""
    guard = paint if rng.random() < 0.5 else (BLACK if rng.random() < 0.6 else CHROME)
    build.add(
        guard,
        mudguard(r + 0.025, thick + 0.02, 35, 160, (0, r, front), 12),
        mudguard(r + 0.025, thick + 0.02, 55, 200, (0, r, rear), 14),
    )
    lamp = (0.0, float(head[1]) - 0.12, float(head[2]) - 0.11)
    build.add(CHROME, cylinder(0.032, 0.05, sides=12).turned("x", -90).moved(*lamp))
    build.add(LENS, cylinder(0.029, 0.01, sides=12).turned("x", -90).moved(lamp[0], lamp[1], lamp[2] - 0.045))
    build.add(RED_LIGHT, rounded_box((0.06, 0.04, 0.025), (0, r + 0.2, rear + r * 0.86), 0.01))
    if rng.random() < 0.7:
        y = 2 * r + 0.07
        for x in (-0.06, 0.0, 0.06):
            build.add(STEEL, bar((x, y, float(seat[2]) - 0.02), (x, y, rear + 0.24), 0.01))
        for z in (float(seat[2]), rear + 0.05, rear + 0.23):
            build.add(STEEL, bar((-0.065, y, z), (0.065, y, z), 0.01))
        build.add(STEEL, bar((0.065, y, rear + 0.1), (0.065, r, rear), 0.01).pair())
    if rng.random() < 0.45:
        look = wicker(rng) if rng.random() < 0.5 else plain((0.25, 0.25, 0.26), "basket")
        y, z = float(head[1]) - 0.04, float(head[2]) - 0.22
        for x in (-0.16, 0.16):
            build.add(look, box((0.012, 0.2, 0.22), (x, y, z)))
        build.add(
            look,
            box((0.33, 0.2, 0.012), (0, y, z - 0.11)),
            box((0.33, 0.2, 0.012), (0, y, z + 0.11)),
            box((0.33, 0.012, 0.23), (0, y - 0.1, z)),
        )
    if rng.random() < 0.5:
        build.add(BLACK, bar((-0.05, r - 0.02, rear - 0.12), (-0.17, 0.02, rear - 0.02), 0.014))
