"""Clocks: wall, mantel, alarm, grandfather, pendulum and digital ones; they face -z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from PIL import Image, ImageDraw, ImageFont

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.decals import Pixels, picture_paint, text_picture
from cadpose.library.parametric.finishes import BLACK, CHROME
from cadpose.library.parametric.paints import metal, painted, plain, plastic, wood
from cadpose.library.parametric.shapes import (
    bar,
    box,
    cylinder,
    ellipsoid,
    extrude,
    lathe,
    rectangle,
    rounded_box,
    torus,
    tube,
)
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid

_BRASS = plain((0.76, 0.62, 0.30), "brass")
_ROMAN = ("XII", "I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX", "X", "XI")
_FACES = (
    (250, 249, 244),
    (250, 249, 244),
    (244, 236, 214),
    (32, 32, 34),
    (225, 228, 232),
    (40, 62, 96),
    (236, 190, 170),
)
_SIDE = 160


def clock(rng: Generator) -> Mesh:
    """Any kind of clock."""
    kinds = (_round, _square, _mantel, _alarm, _grandfather, _pendulum, _digital, _station)
    kind = kinds[int(rng.choice(len(kinds), p=[0.28, 0.14, 0.12, 0.14, 0.09, 0.08, 0.09, 0.06]))]
    build = Builder()
    kind(build, rng)
    return build.mesh("clock")


def _dial_picture(rng: Generator) -> tuple[Pixels, bool]:
    """((S, S, 3) numerals and marks, whether the paper is dark)."""
    paper = _FACES[int(rng.integers(len(_FACES)))]
    dark = sum(paper) < 330
    ink = (
        (240, 240, 236)
        if dark
        else [(20, 20, 22), (20, 20, 22), (90, 50, 25), (30, 45, 90)][int(rng.integers(4))]
    )
    style = int(rng.choice(5, p=[0.36, 0.22, 0.14, 0.18, 0.1]))
    image = Image.new("RGB", (_SIDE, _SIDE), paper)
    draw = ImageDraw.Draw(image)
    middle = _SIDE / 2
    outer = 0.47 * _SIDE
    if rng.random() < 0.5:
        box_ = [middle - outer, middle - outer, middle + outer, middle + outer]
        draw.ellipse(box_, outline=ink, width=int(rng.integers(1, 4)))
    tick = outer * rng.uniform(0.88, 0.96)
    for k in range(60 if style != 3 else 12):
        hour = k % 5 == 0 if style != 3 else True
        a = 2 * np.pi * k / (60 if style != 3 else 12)
        way = np.array([np.sin(a), -np.cos(a)])
        length = 0.03 if not hour else (0.06 if style < 2 else 0.14)
        start, end = middle + way * (tick - length * _SIDE), middle + way * tick
        draw.line([*start, *end], fill=ink, width=(5 if style >= 2 else 3) if hour else 1)
    if style in (0, 1, 4):
        step = 3 if style == 4 else 1
        font = ImageFont.load_default(
            size=(0.115 if style != 1 else 0.085) * _SIDE * (1.3 if style == 4 else 1.0)
        )
        ring = tick - (0.115 if style != 1 else 0.1) * _SIDE
        for k in range(0, 12, step):
            a = 2 * np.pi * k / 12
            text = _ROMAN[k] if style == 1 else str(k or 12)
            draw.text(
                (middle + ring * np.sin(a), middle - ring * np.cos(a)), text, fill=ink, font=font, anchor="mm"
            )
    return np.asarray(image, np.uint8), dark


def _circle(radius: float, sides: int = 36) -> Array:
    a = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    return np.stack([radius * np.cos(a), radius * np.sin(a)], axis=1)


def _add_dial(
    build: Builder, rng: Generator, radius: float, y: float, z: float, outline: Array | None = None
) -> None:
    """A dial with its hands; its face is at ``z``."""
    picture, dark = _dial_picture(rng)
    shape = _circle(radius) if outline is None else outline
    paint = picture_paint(picture, 2.0 * radius, "dial")
    build.add(paint, extrude(shape, 0.02 * radius).moved(0, y, z + 0.01 * radius))
    look = plain((0.92, 0.92, 0.9), "hands") if dark else (BLACK if rng.random() < 0.8 else _BRASS)
    hour = rng.uniform(0, 12)
    minute = (hour % 1) * 12
    pointed = rng.random() < 0.5
    for k, (turn, length, wide) in enumerate(((hour, 0.5, 0.075), (minute, 0.78, 0.05))):
        tip = 0.25 * wide if pointed else wide
        hand = [
            (-wide / 2, -0.12),
            (wide / 2, -0.12),
            (wide / 2, 0.1),
            (tip / 2, length),
            (-tip / 2, length),
            (-wide / 2, 0.1),
        ]
        # Clockwise for one who looks along +z: 3 o'clock is at -x.
        solid = extrude(np.array(hand) * radius, 0.02 * radius).turned("z", 30.0 * turn)
        build.add(look, solid.moved(0, y, z - (0.02 + 0.025 * k) * radius))
    if rng.random() < 0.5:
        second = box((0.016 * radius, 1.0 * radius, 0.01 * radius), (0, 0.3 * radius, 0))
        red = plain((0.8, 0.1, 0.08), "second hand")
        build.add(red, second.turned("z", float(rng.uniform(0, 360))).moved(0, y, z - 0.07 * radius))
    cap = cylinder(0.05 * radius, 0.09 * radius, sides=12).turned("x", -90)
    build.add(look, cap.moved(0, y, z))


def _ring(radius: float, thick: float, y: float, z: float) -> Solid:
    return torus(radius, thick, sides=40, around=8).turned("x", 90).moved(0, y, z)


def _case(rng: Generator) -> Paint:
    kind = rng.random()
    if kind < 0.3:
        return wood(rng)
    if kind < 0.6:
        return metal(rng)
    return plastic(rng) if kind < 0.85 else painted(rng)


def _round(build: Builder, rng: Generator) -> None:
    r = 0.15
    deep = rng.uniform(0.03, 0.07)
    case = _case(rng)
    rim = rng.uniform(0.008, 0.022)
    back = lathe([(0.96 * r, 0.0), (r + rim, 0.1 * deep), (r + rim, 0.9 * deep), (r, deep)], 40)
    build.add(case, back.turned("x", -90).moved(0, 0, deep))
    build.add(case, _ring(r + 0.3 * rim, rim, 0, 0.1 * deep))
    _add_dial(build, rng, r, 0, -0.001)
    if rng.random() < 0.15:
        for k in range(12):
            a = 2 * np.pi * k / 12
            way = np.array([np.sin(a), np.cos(a), 0.0])
            ray = tube(np.stack([way * r, way * (1.55 if k % 2 == 0 else 1.35) * r]), [0.006, 0.003], 6)
            build.add(case, ray.moved(z=0.5 * deep))


def _square(build: Builder, rng: Generator) -> None:
    r = 0.14
    deep = rng.uniform(0.04, 0.09)
    high = rng.uniform(0.95, 1.15)
    case = _case(rng)
    edge = rng.uniform(0.012, 0.035)
    side = 2 * (r + edge)
    build.add(case, rounded_box((side, side * high, deep), (0, 0, deep / 2), float(rng.uniform(0.003, 0.03))))
    if rng.random() < 0.5:
        outline = rectangle(2 * r, 2 * r, 0.006)
        _add_dial(build, rng, r, 0, -0.005, outline)
        for sign in (-1, 1):
            build.add(
                case,
                box((2 * r + 0.02, 0.012, 0.02), (0, sign * r, 0)),
                box((0.012, 2 * r + 0.02, 0.02), (sign * r, 0, 0)),
            )
    else:
        _add_dial(build, rng, r, 0, -0.006)
        build.add(case if rng.random() < 0.5 else CHROME, _ring(r, 0.008, 0, 0.0))


def _mantel(build: Builder, rng: Generator) -> None:
    """On a shelf: a wooden case with a curved top on a plinth."""
    look = wood(rng)
    r = 0.08
    wide, deep = rng.uniform(1.35, 2.6) * r, rng.uniform(0.08, 0.12)
    kind = int(rng.integers(3))
    t = np.linspace(0, np.pi, 17)
    low = -1.35 * r
    if kind == 0:
        arch = np.stack([1.25 * r * np.cos(t), 1.25 * r * np.sin(t)], 1)
        outline = np.concatenate([[[1.25 * r, low]], arch, [[-1.25 * r, low]]])
        wide = 1.25 * r
    elif kind == 1:
        x = np.linspace(wide, -wide, 25)
        y = low + 0.035 + (1.25 * r - low - 0.035) * np.exp(-((x / (0.9 * r)) ** 4) * 0.4)
        outline = np.concatenate([[[wide, low]], np.stack([x, y], 1), [[-wide, low]]])
    else:
        wide = 1.3 * r
        outline = np.array([(-wide, low), (wide, low), (wide, 1.25 * r), (0, 1.95 * r), (-wide, 1.25 * r)])
        build.add(look, box((2 * wide + 0.03, 0.015, deep + 0.03), (0, 1.25 * r, deep / 2)))
    build.add(look, extrude(outline, deep).moved(0, 0, deep / 2))
    build.add(look, box((2 * wide + 0.035, 0.022, deep + 0.035), (0, low - 0.01, deep / 2)))
    for side in (-0.8, 0.8):
        build.add(_BRASS, ellipsoid((0.015, 0.012, 0.015), (side * wide, low - 0.028, 0.01), 10))
    _add_dial(build, rng, r, 0, -0.006)
    build.add(_BRASS, _ring(r + 0.004, 0.008, 0, -0.004))


def _alarm(build: Builder, rng: Generator) -> None:
    """Round, on feet, with two bells, a hammer and a handle."""
    r = 0.05
    deep = rng.uniform(0.04, 0.055)
    look = plastic(rng) if rng.random() < 0.6 else metal(rng)
    bell = look if rng.random() < 0.4 else (CHROME if rng.random() < 0.6 else _BRASS)
    drum = lathe([(0.8 * r, 0.0), (r, 0.12 * deep), (r + 0.004, 0.5 * deep), (r + 0.004, deep)], 32)
    build.add(look, drum.turned("x", -90).moved(0, 0, deep))
    build.add(look, _ring(r, 0.006, 0, 0))
    _add_dial(build, rng, 0.97 * r, 0, -0.001)
    lean = rng.uniform(28, 42)
    dome = lathe([(0.48 * r, 0.0), (0.44 * r, 0.16 * r), (0.3 * r, 0.3 * r), (0.04 * r, 0.38 * r)], 18)
    for sign in (-1, 1):
        arm = [(0, 0.9 * r, 0), (0, 1.22 * r, 0)]
        build.add(bell, tube(arm, 0.004, 6).turned("z", -sign * lean).moved(z=deep / 2))
        build.add(bell, dome.moved(0, 1.14 * r, 0).turned("z", -sign * lean).moved(z=deep / 2))
        leg = tube([(0, -0.95 * r, 0), (0, -1.4 * r, 0)], [0.006, 0.004], 8)
        build.add(bell, leg.turned("z", -sign * 32).moved(z=deep / 2))
    build.add(bell, tube([(0, r, deep / 2), (0, 1.4 * r, deep / 2)], 0.0025, 6))
    build.add(bell, rounded_box((0.02, 0.012, 0.012), (0, 1.42 * r, deep / 2), 0.004))
    t = np.linspace(0, np.pi, 11)
    handle = np.stack([0.62 * r * np.cos(t), 1.42 * r + 0.42 * r * np.sin(t), np.full(11, deep / 2)], 1)
    build.add(bell, tube(handle, 0.0035, 6))
    for x in (-0.4, 0.4):
        build.add(BLACK, cylinder(0.012, 0.01, sides=10).turned("x", 90).moved(x * r, -0.1 * r, deep))


def _grandfather(build: Builder, rng: Generator) -> None:
    """A tall case: trunk with a window on the pendulum, hood with the dial."""
    look = wood(rng)
    high, r = rng.uniform(1.8, 2.1), 0.15
    dark = plain((0.12, 0.08, 0.06), "inside")
    build.add(
        look,
        box((0.50, 0.42, 0.28), (0, 0.21, 0)),
        box((0.54, 0.05, 0.31), (0, 0.025, 0)),
        box((0.54, 0.03, 0.31), (0, 0.43, 0)),
    )
    trunk = high - 1.0
    build.add(look, box((0.38, trunk, 0.22), (0, 0.44 + trunk / 2, 0)))
    build.add(dark, box((0.26, trunk - 0.12, 0.01), (0, 0.44 + trunk / 2, -0.112)))
    for x in (-0.13, 0.13):
        build.add(look, box((0.02, trunk - 0.1, 0.02), (x, 0.44 + trunk / 2, -0.12)))
    bob = 0.44 + trunk * 0.25
    build.add(_BRASS, box((0.012, trunk * 0.6, 0.006), (0.0, bob + trunk * 0.3, -0.12)))
    build.add(_BRASS, cylinder(0.075, 0.015, sides=24).turned("x", 90).moved(0, bob, -0.13))
    for x in (-0.08, 0.08):
        build.add(_BRASS, cylinder(0.02, 0.2, (x, bob + 0.1, -0.125), 10))
    base = 0.44 + trunk
    build.add(look, box((0.50, 0.04, 0.3), (0, base + 0.02, 0)), box((0.46, 0.42, 0.26), (0, base + 0.25, 0)))
    _add_dial(build, rng, r, base + 0.25, -0.135)
    build.add(_BRASS, _ring(r + 0.008, 0.01, base + 0.25, -0.132))
    top = base + 0.46
    if rng.random() < 0.5:
        t = np.linspace(0, np.pi, 15)
        arch = np.stack([0.25 * np.cos(t), 0.02 + 0.14 * np.sin(t)], 1)
        build.add(look, extrude(np.concatenate([[[0.25, 0.0]], arch, [[-0.25, 0.0]]]), 0.29).moved(0, top, 0))
    else:
        build.add(
            look,
            extrude(
                [(-0.27, 0), (0.27, 0), (0.27, 0.03), (0.04, 0.15), (-0.04, 0.15), (-0.27, 0.03)], 0.29
            ).moved(0, top, 0),
        )
    build.add(look, box((0.53, 0.03, 0.31), (0, top, 0)))
    build.add(_BRASS, lathe([(0.02, 0), (0.03, 0.03), (0.012, 0.06), (0.004, 0.1)], 12, (0, top + 0.14, 0)))
    if rng.random() < 0.5:
        post = cylinder(0.018, 0.4, (0.215, base + 0.05, -0.135), 10)
        build.add(look, post.pair())


def _pendulum(build: Builder, rng: Generator) -> None:
    """On the wall: a wooden case with a swinging pendulum below, or a little house."""
    look = wood(rng)
    r = 0.09
    if rng.random() < 0.5:
        build.add(
            look,
            extrude([(-0.13, -0.13), (0.13, -0.13), (0.15, 0.1), (0, 0.24), (-0.15, 0.1)], 0.12).moved(
                0, 0, 0.06
            ),
        )
        for sign in (-1, 1):
            roof = box((0.24, 0.02, 0.18), (0, 0, 0)).turned("z", -sign * 43).moved(sign * 0.085, 0.18, 0.04)
            build.add(look, roof)
        build.add(plain((0.25, 0.14, 0.08), "door"), box((0.05, 0.06, 0.02), (0, 0.13, 0)))
        _add_dial(build, rng, 0.8 * r, -0.02, -0.008)
        low = -0.13
        for x in (-0.05, 0.06):
            long = rng.uniform(0.1, 0.28)
            build.add(_BRASS, bar((x, low, 0.05), (x, low - long, 0.05), 0.004))
            build.add(
                look,
                lathe(
                    [(0.006, 0), (0.015, 0.02), (0.013, 0.07), (0.004, 0.09)],
                    10,
                    (x, low - long - 0.05, 0.05),
                ),
            )
        build.add(look, bar((0, low, 0.03), (0.02, low - 0.2, 0.03), 0.008, 0.003))
        build.add(look, cylinder(0.03, 0.01, sides=18).turned("x", 90).moved(0.02, low - 0.21, 0.03))
        return
    wide, high = 0.28, rng.uniform(0.55, 0.75)
    build.add(look, box((wide, high, 0.02), (0, -high / 2 + 0.15, 0.13)))
    for x in (-1, 1):
        build.add(look, box((0.025, high, 0.14), (x * wide / 2, -high / 2 + 0.15, 0.07)))
    for y in (0.15, 0.15 - high):
        build.add(look, box((wide + 0.06, 0.035, 0.18), (0, y, 0.06)))
    build.add(
        look,
        extrude([(-0.15, 0.16), (0.15, 0.16), (0.1, 0.2), (0, 0.27), (-0.1, 0.2)], 0.03).moved(0, 0, 0.0),
    )
    _add_dial(build, rng, r + 0.015, 0.0, 0.05)
    build.add(_BRASS, _ring(r + 0.02, 0.008, 0, 0.055))
    build.add(_BRASS, bar((0, -0.1, 0.09), (0.01, 0.28 - high, 0.09), 0.01, 0.004))
    build.add(_BRASS, cylinder(0.05, 0.012, sides=24).turned("x", 90).moved(0.01, 0.27 - high, 0.09))


def _digital(build: Builder, rng: Generator) -> None:
    wide, high, deep = rng.uniform(0.13, 0.22), rng.uniform(0.055, 0.09), rng.uniform(0.05, 0.09)
    look = plastic(rng) if rng.random() < 0.7 else wood(rng)
    build.add(look, rounded_box((wide, high, deep), (0, 0, deep / 2), float(rng.uniform(0.004, 0.02)), 2))
    ink = [(255, 40, 30), (60, 240, 90), (120, 200, 255), (245, 245, 245), (255, 170, 40)][
        int(rng.integers(5))
    ]
    text = f"{int(rng.integers(24)):02d}:{int(rng.integers(60)):02d}"
    picture = text_picture(160, [(text, 0.5, 0.5, 0.34)], (14, 14, 16), ink)
    screen = box((0.86 * wide, 0.72 * high, 0.004))
    build.add(picture_paint(picture, 0.86 * wide, "display"), screen.moved(0, 0, -0.003))
    for x in np.linspace(-0.3, 0.3, int(rng.integers(2, 6))):
        build.add(BLACK, box((0.1 * wide, 0.008, 0.012), (float(x) * wide, high / 2, deep / 2)))
    build.add(BLACK, box((0.8 * wide, 0.008, 0.7 * deep), (0, -high / 2 - 0.002, deep / 2)))


def _station(build: Builder, rng: Generator) -> None:
    """Hung from an arm or on a post, as in a station or a street."""
    r = 0.25
    look = plain([(0.1, 0.1, 0.11), (0.12, 0.25, 0.18), (0.55, 0.56, 0.58)][int(rng.integers(3))], "iron")
    deep = 0.14
    drum = lathe([(1.06 * r, 0.0), (1.08 * r, 0.5 * deep), (1.06 * r, deep)], 36)
    build.add(look, drum.turned("x", -90).moved(0, 0, deep))
    build.add(look, _ring(1.04 * r, 0.022, 0, 0), _ring(1.04 * r, 0.022, 0, deep))
    _add_dial(build, rng, r, 0, -0.004)
    if rng.random() < 0.5:
        build.add(
            look,
            tube([(0, r, deep / 2), (0, r + 0.16, deep / 2)], 0.025, 10),
            box((0.14, 0.02, 0.14), (0, r + 0.17, deep / 2)),
        )
    else:
        high = rng.uniform(0.8, 1.5)
        build.add(
            look,
            lathe(
                [(0.12, 0), (0.12, 0.06), (0.05, 0.12), (0.035, high), (0.06, high + 0.03)],
                14,
                (0, -r - high - 0.04, deep / 2),
            ),
        )
