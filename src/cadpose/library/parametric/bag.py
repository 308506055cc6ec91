"""Bags: handbags, totes, backpacks, trolleys, briefcases and duffels; pockets and clasps face -z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.finishes import BLACK, CHROME
from cadpose.library.parametric.hulls import hull, tower
from cadpose.library.parametric.paints import any_colour, darker, fabric, leather, plain
from cadpose.library.parametric.shapes import (
    bar,
    box,
    cylinder,
    plate,
    rectangle,
    rounded_box,
    smooth_path,
    torus,
    tube,
)
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid
from cadpose.library.parametric.wheels import along_x

_GOLD = plain((0.80, 0.66, 0.32), "gold")


def bag(rng: Generator) -> Mesh:
    """Any kind of bag."""
    kinds = (_handbag, _tote, _backpack, _trolley, _briefcase, _duffel)
    kind = kinds[int(rng.choice(len(kinds), p=[0.24, 0.14, 0.26, 0.2, 0.08, 0.08]))]
    build = Builder()
    kind(build, rng)
    return build.mesh("bag")


def _skin(rng: Generator) -> Paint:
    return leather(rng) if rng.random() < 0.55 else plain(any_colour(rng), "leather")


def _cloth(rng: Generator) -> Paint:
    kind = rng.random()
    if kind < 0.35:
        return fabric(rng, 0.35)
    if kind < 0.6:
        return plain([(0.1, 0.1, 0.11), (0.16, 0.19, 0.28), (0.3, 0.31, 0.32)][int(rng.integers(3))], "nylon")
    return plain(any_colour(rng), "nylon")


def _arch(half: float, low: float, high: float, z: float, steps: int = 5) -> Array:
    """A handle's path: up, over and down."""
    mid = low + 0.7 * (high - low)
    path = [(-half, low, z), (-0.9 * half, mid, z), (0, high, z), (0.9 * half, mid, z), (half, low, z)]
    return smooth_path(np.array(path), steps)


def _strap(
    path: Array, wide: float, thick: float, up: tuple[float, float, float] = (0.0, 0.0, -1.0)
) -> Solid:
    return tube(path, 1.0, section=rectangle(wide, thick), up=up)


def _handbag(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    skin, metal = _skin(rng), _GOLD if rng.random() < 0.6 else CHROME
    wide, high, deep = u(0.13, 0.19), u(0.18, 0.28), u(0.045, 0.08)
    flare, top = u(0.72, 1.02), u(0.25, 0.7)
    rows = [
        (0.0, 0.0, 0.94 * wide, 0.9 * deep),
        (0.02, 0.0, wide, deep),
        (0.5 * high, 0.0, wide * (1 + flare) / 2, deep * (0.6 + 0.4 * top)),
        (0.95 * high, 0.0, wide * flare, deep * top),
        (high, 0.0, wide * flare * 0.96, deep * top * 0.7),
    ]
    build.add(skin, tower(rows, u(0.25, 0.5), 24))
    trim = darker(skin, 0.7) if rng.random() < 0.5 else skin
    kind = int(rng.integers(3))
    front = -deep * (0.6 + 0.4 * top)
    if kind == 0:
        _add_flap(build, rng, trim, metal, (wide * flare * 0.98, high, deep, deep * top))
    elif kind == 1:
        pocket = rounded_box((1.3 * wide, 0.42 * high, 0.02), (0, 0.36 * high, -0.86 * deep), 0.01)
        build.add(trim, pocket)
        build.add(metal, box((1.1 * wide, 0.004, 0.004), (0, 0.54 * high, -0.86 * deep - 0.012)))
        build.add(
            metal, bar((-wide * flare * 0.9, high + 0.002, 0), (wide * flare * 0.9, high + 0.002, 0), 0.008)
        )
    else:
        build.add(trim, box((2 * wide * 0.98, 0.03, 2 * deep * 0.99), (0, 0.05, 0)))
        build.add(metal, rounded_box((0.06, 0.025, 0.01), (0, 0.72 * high, front - 0.002), 0.004))
        build.add(
            metal, bar((-wide * flare * 0.9, high + 0.002, 0), (wide * flare * 0.9, high + 0.002, 0), 0.008)
        )
    half = wide * flare * u(0.45, 0.7)
    rise = high + u(0.08, 0.2)
    if rng.random() < 0.65:
        for z in (-0.7 * deep * top, 0.7 * deep * top):
            build.add(trim, tube(_arch(half, 0.86 * high, rise, z * 1.15), 0.007, 8))
            for x in (-half, half):
                build.add(
                    metal,
                    torus(0.012, 0.003, sides=12, around=5).turned("x", 90).moved(x, 0.84 * high, z * 1.3),
                )
    else:
        loop = _arch(wide * flare * 0.98, 0.82 * high, high + u(0.12, 0.3), 0.0)
        build.add(trim, _strap(loop, 0.005, 0.02))
        for x in (-1.0, 1.0):
            build.add(
                metal,
                torus(0.013, 0.003, sides=12, around=5)
                .turned("z", 90)
                .moved(x * wide * flare, 0.82 * high, 0),
            )


def _add_flap(
    build: Builder, rng: Generator, look: Paint, metal: Paint, size: tuple[float, float, float, float]
) -> None:
    """A flap over the front with a clasp; the size is half width, height, half depth below and above."""
    half, high, deep, upper = size
    drop = high * rng.uniform(0.4, 0.6)
    x = np.linspace(-1, 1, 13)
    low = high - drop * (1 - 0.35 * np.abs(x) ** 2.2)
    levels = np.linspace(0, 1, 6)[:, None]
    y = (high + 0.004) * (1 - levels) + low * levels
    z = -upper - 0.01 - (deep - upper) * 0.75 * (high - y) / high
    rows = np.stack([np.broadcast_to(x * half, y.shape), y, z], axis=2)
    behind = rows[0] * [1, 1, 0] + [0, 0.004, upper]
    build.add(look, plate(np.concatenate([behind[None], rows]), 0.006))
    at = (0.0, float(low[6]) + 0.015, float(z[-1, 6]) - 0.006)
    build.add(metal, rounded_box((0.04, 0.03, 0.014), at, 0.005))


def _tote(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    look = fabric(rng, 0.5) if rng.random() < 0.6 else _skin(rng)
    strap = look if rng.random() < 0.5 else leather(rng)
    wide, high, deep = u(0.15, 0.22), u(0.28, 0.38), u(0.05, 0.1)
    spread = u(1.0, 1.15)
    rows = [
        (0.0, 0.0, wide, deep),
        (0.5 * high, 0.0, wide * (1 + spread) / 2, 0.9 * deep),
        (high, 0.0, wide * spread, 0.6 * deep),
    ]
    build.add(look, tower(rows, 0.2, 24))
    inside = darker(look, 0.35)
    build.add(
        inside,
        tower(
            [
                (high - 0.005, 0.0, wide * spread * 0.96, 0.55 * deep),
                (high + 0.002, 0.0, wide * spread * 0.97, 0.56 * deep),
            ],
            0.2,
            24,
        ),
    )
    rise = high + u(0.1, 0.25)
    for z in (-0.62 * deep, 0.62 * deep):
        build.add(strap, _strap(_arch(0.5 * wide, high - 0.06, rise, z), 0.006, 0.026))
    if rng.random() < 0.6:
        patch = rounded_box(
            (u(0.5, 1.1) * wide, u(0.3, 0.45) * high, 0.012), (0, 0.45 * high, -0.94 * deep), 0.005
        )
        build.add(plain(any_colour(rng), "print") if rng.random() < 0.5 else strap, patch)


def _backpack(build: Builder, rng: Generator) -> None:
    """Pockets at -z; what lies on the wearer's back is +z."""
    u = rng.uniform
    look = _cloth(rng)
    second = (
        look
        if rng.random() < 0.4
        else (plain(any_colour(rng), "nylon") if rng.random() < 0.5 else darker(look, 0.55))
    )
    wide, high, deep = u(0.13, 0.17), u(0.38, 0.5), u(0.075, 0.11)
    square = u(0.35, 0.6)
    rows = [
        (0.0, 0.0, 0.9 * wide, 0.85 * deep),
        (0.02, 0.0, wide, deep),
        (0.45 * high, 0.0, wide * u(0.98, 1.05), deep),
        (0.75 * high, 0.01, 0.95 * wide, 0.85 * deep),
        (0.92 * high, 0.02, 0.75 * wide, 0.6 * deep),
        (high, 0.03, 0.4 * wide, 0.3 * deep),
    ]
    build.add(look, tower(rows, square, 22))
    pocket_high = u(0.35, 0.5) * high
    pocket = tower(
        [
            (0.0, 0.0, 0.74 * wide, 0.03),
            (0.02, 0.0, 0.8 * wide, 0.045),
            (0.75 * pocket_high, 0.0, 0.78 * wide, 0.04),
            (pocket_high, 0.0, 0.68 * wide, 0.012),
        ],
        0.4,
        16,
    )
    build.add(second, pocket.moved(0, 0.03, -deep))
    zip_ = [
        (-0.72 * wide, 0.6 * pocket_high, 0),
        (-0.6 * wide, 0.92 * pocket_high, 0),
        (0.6 * wide, 0.92 * pocket_high, 0),
        (0.72 * wide, 0.6 * pocket_high, 0),
    ]
    build.add(BLACK, tube(smooth_path(np.array(zip_), 4), 0.0035, 5).moved(0, 0.03, -deep - 0.037))
    flap = rng.random() < 0.3
    if flap:
        lid = [
            (0.66 * high, -0.35 * deep, 0.98 * wide, 0.75 * deep),
            (0.9 * high, -0.1 * deep, 0.9 * wide, 0.85 * deep),
            (1.0 * high, 0.1 * deep, 0.7 * wide, 0.6 * deep),
        ]
        build.add(second, tower(lid, square, 22).moved(0, 0.01, 0))
        for x in (-0.45, 0.45):
            build.add(BLACK, box((0.022, 0.4 * high, 0.006), (x * wide, 0.55 * high, -1.13 * deep)))
            build.add(CHROME, box((0.032, 0.028, 0.008), (x * wide, 0.5 * high, -1.15 * deep)))
    elif rng.random() < 0.6:
        upper = rounded_box((1.1 * wide, 0.2 * high, 0.03), (0, 0.68 * high, -0.9 * deep), 0.014).turned(
            "x", -8, (0, 0.68 * high, -0.9 * deep)
        )
        build.add(second, upper)
        build.add(BLACK, box((0.9 * wide, 0.006, 0.005), (0, 0.74 * high, -0.9 * deep - 0.02)))
    if rng.random() < 0.6:
        side = rounded_box((0.03, 0.36 * high, 1.1 * deep), (wide, 0.22 * high, 0), 0.014)
        build.add(second, side.pair())
        if rng.random() < 0.4:
            flask = cylinder(0.032, 0.2, (wide + 0.022, 0.12, 0), 14)
            build.add(plain(any_colour(rng), "flask"), flask)
            build.add(BLACK, cylinder(0.02, 0.03, (wide + 0.022, 0.32, 0), 12))
    t = np.linspace(0, np.pi, 9)
    loop = np.stack([0.035 * np.cos(t), high - 0.01 + 0.045 * np.sin(t), np.full(9, 0.5 * deep)], 1)
    build.add(BLACK, _strap(loop, 0.006, 0.018))
    strap = second if rng.random() < 0.4 else BLACK
    out = u(0.06, 0.11)
    path = [
        (0.05, 0.9 * high, 0.7 * deep),
        (0.07, 0.92 * high, 0.8 * deep + 0.6 * out),
        (0.09, 0.7 * high, deep + out),
        (0.1, 0.4 * high, deep + 0.8 * out),
        (0.1, 0.15 * high, deep + 0.25 * out),
        (0.85 * wide, 0.05 * high, 0.8 * deep),
    ]
    build.add(strap, _strap(smooth_path(np.array(path), 4), 0.055, 0.012).pair())
    build.add(darker(look, 0.6), rounded_box((1.4 * wide, 0.75 * high, 0.03), (0, 0.45 * high, deep), 0.014))


def _trolley(build: Builder, rng: Generator) -> None:
    """A suitcase on wheels: ribs or pockets at -z, the drawn-out handle at +z."""
    u = rng.uniform
    hard = rng.random() < 0.65
    look = (
        plain(any_colour(rng), "shell")
        if rng.random() < 0.7
        else plain([(0.1, 0.1, 0.11), (0.75, 0.76, 0.78)][int(rng.integers(2))], "shell")
    )
    if not hard:
        look = _cloth(rng)
    wide, high, deep = u(0.36, 0.48), u(0.5, 0.72), u(0.2, 0.3)
    low = 0.05
    middle = low + high / 2
    build.add(look, rounded_box((wide, high, deep), (0, middle, 0), float(u(0.03, 0.06)), 2))
    band = rectangle(wide + 0.004, high + 0.004, 0.05, 3)
    build.add(
        BLACK if rng.random() < 0.6 else darker(look, 0.5),
        tube(np.column_stack([band[:, 0], band[:, 1] + middle, np.zeros(len(band))]), 0.006, 6, closed=True),
    )
    if hard:
        count = int(rng.integers(3, 8))
        upright = rng.random() < 0.75
        for t in np.linspace(-0.38, 0.38, count):
            size = (0.018, 0.86 * high, 0.014) if upright else (0.84 * wide, 0.02, 0.014)
            at = (float(t) * wide, middle, 0.0) if upright else (0.0, middle + float(t) * high, 0.0)
            for z in (-deep / 2, deep / 2):
                build.add(look, rounded_box(size, (at[0], at[1], z), 0.006))
    else:
        for y, part in ((0.33, 0.5), (0.77, 0.28)):
            build.add(
                look,
                rounded_box((0.84 * wide, part * high, 0.05), (0, low + y * high, -deep / 2 - 0.01), 0.02),
            )
            build.add(
                BLACK, box((0.7 * wide, 0.008, 0.006), (0, low + (y + 0.4 * part) * high, -deep / 2 - 0.036))
            )
    for x in (-0.4, 0.4):
        for z in (-0.36, 0.36):
            build.add(
                BLACK, along_x(cylinder(0.026, 0.022, (0, -0.011, 0), 12)).moved(x * wide, 0.026, z * deep)
            )
            build.add(BLACK, box((0.03, 0.03, 0.03), (x * wide, 0.05, z * deep)))
    if rng.random() < 0.7:
        rise = u(0.1, 0.4)
        x, z, top = 0.26 * wide, 0.36 * deep, low + high
        build.add(
            CHROME if rng.random() < 0.6 else BLACK, bar((x, top - 0.02, z), (x, top + rise, z), 0.014).pair()
        )
        build.add(BLACK, rounded_box((2 * x + 0.04, 0.03, 0.03), (0, top + rise, z), 0.012))
    grip = _arch(0.09, low + high - 0.005, low + high + 0.035, 0.0, 3)
    build.add(BLACK, tube(grip, 0.009, 6))
    build.add(
        BLACK,
        tube(_arch(0.09, 0, 0.035, 0.0, 3), 0.009, 6).turned("z", -90).moved(wide / 2 - 0.004, middle, 0),
    )
    build.add(
        CHROME,
        rounded_box(
            (0.05, 0.03, 0.008), (0, low + 0.88 * high, -deep / 2 - (0.002 if hard else 0.036)), 0.003
        ),
    )


def _briefcase(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    skin = leather(rng)
    metal = _GOLD if rng.random() < 0.6 else CHROME
    wide, high, deep = u(0.38, 0.46), u(0.27, 0.33), u(0.08, 0.13)
    build.add(skin, rounded_box((wide, high, deep), (0, high / 2, 0), 0.02))
    if rng.random() < 0.5:
        build.add(
            metal,
            tube(
                np.array([(x, y + high / 2, 0) for x, y in rectangle(wide + 0.002, high + 0.002, 0.02)]),
                0.005,
                6,
                closed=True,
            ),
        )
        for x in (-0.3, 0.3):
            build.add(
                metal, rounded_box((0.05, 0.035, 0.012), (x * wide, high - 0.03, -deep / 2 - 0.003), 0.004)
            )
    else:
        drop = u(0.45, 0.6) * high
        build.add(
            darker(skin, 0.85),
            rounded_box((wide + 0.006, drop, 0.014), (0, high - drop / 2 + 0.004, -deep / 2 - 0.004), 0.006),
        )
        build.add(skin, rounded_box((wide + 0.006, 0.014, deep + 0.01), (0, high + 0.002, 0), 0.006))
        for x in (-0.26, 0.26) if rng.random() < 0.5 else (0.0,):
            build.add(
                darker(skin, 0.6), box((0.035, 0.6 * high, 0.006), (x * wide, 0.66 * high, -deep / 2 - 0.014))
            )
            build.add(
                metal, rounded_box((0.045, 0.05, 0.012), (x * wide, high - drop, -deep / 2 - 0.016), 0.004)
            )
    build.add(darker(skin, 0.7), tube(_arch(0.075, high, high + 0.055, 0.0, 4), 0.01, 8))
    for sign in (-0.075, 0.075):
        build.add(metal, box((0.025, 0.02, 0.025), (sign, high + 0.008, 0)))


def _duffel(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    look = _cloth(rng) if rng.random() < 0.7 else leather(rng)
    strap = BLACK if rng.random() < 0.5 else leather(rng)
    half, r = u(0.24, 0.32), u(0.12, 0.16)
    rows = [
        (-half, 0.95 * r, 0.8 * r, 0.8 * r),
        (-0.94 * half, r, r, r),
        (0.0, r, 1.04 * r, 1.02 * r),
        (0.94 * half, r, r, r),
        (half, 0.95 * r, 0.8 * r, 0.8 * r),
    ]
    # Made along z, then turned to lie across.
    build.add(look, hull(rows, 0.7, 22).turned("y", 90))
    build.add(BLACK, box((1.7 * half, 0.006, 0.012), (0, 2.02 * r, 0)))
    for z in (-1, 1):
        path = [
            (-0.4 * half, 0.25 * r, z * 0.82 * r),
            (-0.4 * half, r, z * 1.06 * r),
            (-0.36 * half, 1.75 * r, z * 0.75 * r),
            (0, 2.0 * r + u(0.06, 0.12), z * 0.3 * r),
            (0.36 * half, 1.75 * r, z * 0.75 * r),
            (0.4 * half, r, z * 1.06 * r),
            (0.4 * half, 0.25 * r, z * 0.82 * r),
        ]
        build.add(strap, tube(smooth_path(np.array(path), 4), 0.012, 6))
    for x in (-0.93, 0.93):
        build.add(strap, torus(1.01 * r, 0.008, sides=24, around=5).turned("z", 90).moved(x * half, r, 0))
    pocket = rounded_box((0.62 * half, 0.9 * r, 0.04), (0, 0.85 * r, -1.03 * r), 0.02)
    build.add(look, pocket)
    build.add(BLACK, box((0.5 * half, 0.006, 0.006), (0, 1.15 * r, -1.03 * r - 0.022)))
