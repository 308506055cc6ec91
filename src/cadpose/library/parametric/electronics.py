"""Laptops, keyboards and phones.

A laptop's screen looks to -z. What lies flat (keyboards, phones) has its lower edge to -z,
where its user is.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from PIL import Image, ImageDraw

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.decals import Pixels, picture_paint
from cadpose.library.parametric.finishes import BLACK, CHROME, DARK_GLASS, STEEL, WHITE
from cadpose.library.parametric.paints import any_colour, plain
from cadpose.library.parametric.shapes import bar, box, cylinder, rounded_box, tube
from cadpose.library.parametric.solids import Builder, Paint

_GREYS = ((0.80, 0.81, 0.83), (0.55, 0.56, 0.58), (0.16, 0.16, 0.17), (0.08, 0.08, 0.09), (0.92, 0.92, 0.91))


def _shell(rng: Generator) -> Paint:
    return (
        plain(_GREYS[int(rng.integers(len(_GREYS)))], "shell")
        if rng.random() < 0.9
        else plain(any_colour(rng), "shell")
    )


def _screen_picture(rng: Generator, aspect: float) -> Pixels:
    """(64, 64, 3) what a screen shows; of an oblong one only the middle is seen."""
    side = 64
    image = Image.new("RGB", (side, side), tuple(int(c) for c in rng.integers(20, 200, 3)))
    draw = ImageDraw.Draw(image)
    low, high = (0.5 - 0.5 * min(1.0, aspect)) * side, (0.5 + 0.5 * min(1.0, aspect)) * side
    kind = int(rng.integers(3))
    if kind == 0:
        one, other = rng.integers(0, 256, (2, 3))
        for y in range(side):
            t = y / side
            draw.line([(0, y), (side, y)], fill=tuple(int(v) for v in one * (1 - t) + other * t))
    elif kind == 1:
        draw.rectangle([0, low, side, high], fill=(240, 240, 242))
        for k in range(7):
            line = low + (k + 1) * (high - low) / 8
            draw.line([(6, line), (6 + int(rng.integers(15, 50)), line)], fill=(90, 95, 105), width=1)
        draw.rectangle([0, low, side, low + 4], fill=tuple(int(c) for c in rng.integers(20, 220, 3)))
    else:
        horizon = low + (high - low) * rng.uniform(0.45, 0.7)
        draw.rectangle([0, low, side, horizon], fill=(130, 180, 225))
        draw.rectangle(
            [0, horizon, side, high],
            fill=tuple(int(c) for c in (rng.integers(40, 110), rng.integers(80, 150), 60)),
        )
        x = int(rng.integers(8, 56))
        draw.polygon([(x - 22, horizon), (x, low + 6), (x + 22, horizon)], fill=(95, 100, 110))
    return np.asarray(image, np.uint8)


def _screen(rng: Generator, wide: float, high: float) -> Paint:
    """Off, or showing something."""
    if rng.random() < 0.5:
        return DARK_GLASS
    return picture_paint(_screen_picture(rng, high / wide), max(wide, high), "screen")


def _key_rows(rng: Generator, wide: float, deep: float, pad: bool) -> list[tuple[float, float, float, float]]:
    """(x, z, width, depth) of the keys, from the user's left, which is +x, and from the far row to -z."""
    keys: list[tuple[float, float, float, float]] = []
    block = wide * (0.76 if pad else 1.0)
    rows = 5 if rng.random() < 0.5 else 6
    pitch = deep / rows
    for row in range(rows):
        z = deep / 2 - (row + 0.5) * pitch
        if row == rows - 1:
            sizes = [1.3, 1.1, 1.1, 5.5, 1.1, 1.1, 1.3]
        elif row == 0 and rows == 6:
            sizes = [1.0] * 14
        else:
            sizes = [
                [1.0] * 12 + [2.0],
                [1.5] + [1.0] * 12,
                [1.8] + [1.0] * 11 + [2.0],
                [2.3] + [1.0] * 10 + [2.6],
            ][row % 4]
        unit = block / sum(sizes)
        x = wide / 2
        for size in sizes:
            keys.append((x - size * unit / 2, z, size * unit * 0.86, pitch * 0.84))
            x -= size * unit
        if pad:
            unit = wide * 0.21 / 4
            keys += [(-wide / 2 + (k + 0.5) * unit, z, unit * 0.86, pitch * 0.84) for k in range(4)]
    return keys


def keyboard(rng: Generator) -> Mesh:
    """A computer's keyboard, its space bar to -z."""
    u = rng.uniform
    build = Builder()
    look = _shell(rng)
    dark = sum(look.material.rgba[:3]) < 1.0
    keys = (
        look
        if rng.random() < 0.3
        else (
            plain((0.85, 0.85, 0.84), "keys")
            if (dark and rng.random() < 0.3)
            else BLACK
            if rng.random() < 0.6
            else WHITE
        )
    )
    if keys is look:
        keys = plain((0.24, 0.24, 0.25), "keys") if dark else plain((0.75, 0.75, 0.76), "keys")
    pad = rng.random() < 0.65
    wide, deep = (u(0.42, 0.46) if pad else u(0.28, 0.33)), u(0.125, 0.15)
    thick = u(0.012, 0.024)
    tilt = u(0.0, 6.0)
    around = u(0.006, 0.016)
    body = rounded_box((wide + 2 * around, thick, deep + 2 * around), (0, thick / 2, 0), 0.4 * thick)
    build.add(look, body.turned("x", -tilt))
    tall = u(0.003, 0.009)
    accent = plain(any_colour(rng), "accent")
    for k, (x, z, w, d) in enumerate(_key_rows(rng, wide, deep, pad)):
        cap = box((w, tall, d), (x, thick + tall / 2 - 0.001, z))
        build.add(accent if k == 0 and rng.random() < 0.3 else keys, cap.turned("x", -tilt))
    if rng.random() < 0.4:
        path = [(0.1, 0.008, deep / 2 + 0.01), (0.11, 0.006, deep / 2 + 0.06), (0.05, 0.004, deep / 2 + 0.1)]
        build.add(BLACK, tube(path, 0.003, 6))
    return build.mesh("keyboard")


def laptop(rng: Generator) -> Mesh:
    """Opened: the screen looks to -z, the keys lie before it."""
    u = rng.uniform
    build = Builder()
    look = _shell(rng)
    wide = u(0.29, 0.39)
    deep = wide * u(0.64, 0.74)
    thick = u(0.01, 0.026)
    build.add(look, rounded_box((wide, thick, deep), (0, thick / 2, 0), 0.35 * thick))
    dark = sum(look.material.rgba[:3]) < 1.0
    keys = BLACK if not dark or rng.random() < 0.4 else plain((0.3, 0.3, 0.31), "keys")
    if rng.random() < 0.15:
        keys = WHITE
    bed = plain((0.25, 0.25, 0.26), "key bed") if keys is not BLACK else plain((0.4, 0.4, 0.41), "key bed")
    w, d = wide * u(0.8, 0.92), deep * u(0.4, 0.48)
    shift = deep * 0.16
    if rng.random() < 0.6:
        build.add(bed, box((w + 0.008, 0.001, d + 0.008), (0, thick + 0.0005, shift)))
    for x, z, kw, kd in _key_rows(rng, w, d, False):
        build.add(keys, box((kw, 0.0025, kd), (x, thick + 0.001, z + shift)))
    pad = box((wide * u(0.24, 0.34), 0.001, deep * 0.24), (0, thick + 0.0006, -deep * 0.31))
    build.add(plain((0.5, 0.5, 0.52), "touch pad"), pad)
    angle = u(8, 32)
    slim = u(0.005, 0.011)
    high = deep * u(0.95, 1.0)
    hinge = (0.0, thick, deep / 2 - 0.004)
    rim = u(0.006, 0.018)
    lid = rounded_box((wide, high, slim), (0, high / 2, 0), 0.4 * slim)
    frame = box((wide - 0.006, high - 0.008, 0.002), (0, high / 2, -slim / 2 - 0.0004))
    pane_w, pane_h = wide - 2 * rim, high - 2 * rim - 0.012
    pane = box((pane_w, pane_h, 0.002))
    build.add(look, lid.turned("x", angle).moved(*hinge))
    build.add(BLACK if rng.random() < 0.75 else look, frame.turned("x", angle).moved(*hinge))
    build.add(
        _screen(rng, pane_w, pane_h),
        pane.moved(0, high / 2 + 0.006, -slim / 2 - 0.002).turned("x", angle).moved(*hinge),
    )
    build.add(
        CHROME if rng.random() < 0.5 else WHITE,
        cylinder(0.018, 0.001, sides=16)
        .turned("x", 90)
        .moved(0, high / 2, slim / 2)
        .turned("x", angle)
        .moved(*hinge),
    )
    build.add(BLACK, bar((-0.4 * wide, thick, hinge[2]), (0.4 * wide, thick, hinge[2]), 0.01))
    return build.mesh("laptop")


def phone(rng: Generator) -> Mesh:
    """A mobile phone lying on its back, its lower end to -z."""
    u = rng.uniform
    build = Builder()
    look = _shell(rng)
    if rng.random() < 0.75:
        wide, long, thick = u(0.064, 0.08), u(0.135, 0.165), u(0.007, 0.01)
        build.add(look, rounded_box((wide, thick, long), (0, 0, 0), 0.45 * thick, 2))
        build.add(
            BLACK if rng.random() < 0.8 else WHITE,
            rounded_box((wide - 0.003, 0.002, long - 0.003), (0, thick / 2, 0), 0.0009),
        )
        edge = u(0.002, 0.016)
        w, d = wide - 0.006, long - 2 * edge - 0.004
        picture = _screen_picture(rng, 1.0)
        screen = DARK_GLASS if rng.random() < 0.3 else picture_paint(picture, long, "screen")
        build.add(screen, box((w, 0.001, d)).moved(0, thick / 2 + 0.001, 0))
        if rng.random() < 0.6:
            for k in range(20):
                x, z = (k % 4 - 1.5) * 0.22 * w, (k // 4 - 2.0) * 0.17 * d
                build.add(
                    plain(any_colour(rng), "icon"),
                    box((0.14 * w, 0.0008, 0.14 * w), (x, thick / 2 + 0.0018, z)),
                )
        if edge > 0.01:
            build.add(
                STEEL, cylinder(0.0045, 0.001, (0, thick / 2 + 0.001, -long / 2 + 0.5 * edge + 0.002), 16)
            )
        build.add(
            STEEL,
            box((0.002, 0.4 * thick, 0.02), (-wide / 2, 0, 0.2 * long)),
            box((0.002, 0.4 * thick, 0.03), (wide / 2, 0, 0.22 * long)),
        )
        build.add(
            BLACK,
            rounded_box(
                (0.4 * wide, 0.002, 0.2 * long), (-0.2 * wide, -thick / 2 - 0.0005, 0.36 * long), 0.0009
            ),
        )
    else:
        wide, long, thick = u(0.042, 0.052), u(0.1, 0.125), u(0.013, 0.02)
        build.add(look, rounded_box((wide, thick, long), (0, 0, 0), 0.4 * thick, 2))
        build.add(
            plain((0.62, 0.72, 0.55), "display"),
            box((0.74 * wide, 0.002, 0.3 * long), (0, thick / 2, 0.22 * long)),
        )
        dark = sum(look.material.rgba[:3]) < 1.0
        key = plain((0.75, 0.75, 0.76), "keys") if dark else BLACK
        for row in range(5):
            for column in (-1, 0, 1):
                size = (0.22 * wide, 0.003, 0.055 * long)
                build.add(
                    key,
                    rounded_box(size, (column * 0.27 * wide, thick / 2, (-0.02 - 0.09 * row) * long), 0.001),
                )
        if rng.random() < 0.4:
            build.add(BLACK, bar((0.3 * wide, 0, long / 2), (0.3 * wide, 0, long / 2 + 0.025), 0.008))
    return build.mesh("phone")
