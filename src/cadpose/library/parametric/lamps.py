"""Lamps: table and floor lamps with a shade, desk lamps with an arm, arc lamps, pendants."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.seating import between, chance, pick
from cadpose.library.parametric.solids import Builder, Paint, Solid


def _shade_paint(rng: Generator) -> Paint:
    if chance(rng, 0.5):
        tone = between(rng, 0.8, 0.97)
        return paints.plain((tone, tone * 0.97, tone * 0.88), "shade")
    return paints.fabric(rng, 0.15) if chance(rng, 0.6) else paints.plastic(rng)


def shade(rng: Generator, radius: float, height: float) -> Solid:
    """A shade open below, its lower rim at y = 0: a drum, an empire cone, a bell or a square one."""
    kind = pick(rng, ("drum", "empire", "bell", "square"), (2, 2, 1, 0.8))
    top = (
        radius
        * {
            "drum": between(rng, 0.85, 1.0),
            "empire": between(rng, 0.35, 0.7),
            "bell": 0.4,
            "square": between(rng, 0.5, 0.9),
        }[kind]
    )
    t = np.linspace(0, 1, 7 if kind == "bell" else 2)
    r = radius + (top - radius) * (t**0.45 if kind == "bell" else t)
    sides = 4 if kind == "square" else 28
    a = np.linspace(0, 2 * np.pi, sides, endpoint=False) + (np.pi / 4 if sides == 4 else 0.0)
    around = np.append(a, a[0])
    rows = np.array(
        [[(q * np.cos(v), h, -q * np.sin(v)) for v in around] for q, h in zip(r, t * height, strict=True)]
    )
    return shapes.plate(rows[:, ::-1], 0.004)


def _bulb(build: Builder, y: float) -> None:
    build.add(paints.plain((0.98, 0.96, 0.88), "bulb"), shapes.ellipsoid((0.03, 0.04, 0.03), (0, y, 0), 12))


def table_lamp(rng: Generator) -> Builder:
    """A turned, stacked or plain foot under a shade."""
    build = Builder()
    body = pick(rng, ("ceramic", "metal", "wood"), (2, 1, 1))
    paint = {"ceramic": paints.plastic, "metal": paints.metal, "wood": paints.wood}[body](rng)
    h, r = between(rng, 0.16, 0.40), between(rng, 0.05, 0.11)
    kind = pick(rng, ("vase", "gourd", "column", "balls", "block"))
    if kind == "vase":
        profile = [
            (r * 0.6, 0),
            (r * 0.65, h * 0.05),
            (r, h * 0.4),
            (r * 0.95, h * 0.6),
            (r * 0.3, h * 0.92),
            (r * 0.2, h),
        ]
        build.add(paint, shapes.lathe([tuple(p) for p in shapes.smooth_path(profile, 4)], 24))
    elif kind == "gourd":
        profile = [(r * 0.7, 0), (r, h * 0.25), (r * 0.45, h * 0.58), (r * 0.6, h * 0.76), (r * 0.15, h)]
        build.add(paint, shapes.lathe([tuple(p) for p in shapes.smooth_path(profile, 5)], 24))
    elif kind == "column":
        build.add(paint, shapes.lathe([(r, 0), (r, 0.02), (r * 0.25, 0.035), (r * 0.2, h)], 24))
    elif kind == "balls":
        count = int(rng.integers(2, 5))
        build.add(paint, shapes.cylinder(r * 0.9, 0.02, sides=20))
        for k in range(count):
            q = h / count / 2
            build.add(
                paint,
                shapes.ellipsoid((min(q * 1.3, r), q, min(q * 1.3, r)), (0, 0.02 + q * (2 * k + 1), 0), 16),
            )
    else:
        build.add(paint, shapes.rounded_box((r * 1.6, h, r * 1.6), (0, h / 2, 0), 0.01))
    neck = between(rng, 0.03, 0.09)
    build.add(paints.metal(rng), shapes.cylinder(0.008, neck + 0.08, (0, h - 0.01, 0), 8))
    tall = between(rng, 0.14, 0.28)
    build.add(_shade_paint(rng), shade(rng, between(rng, 0.11, 0.22), tall).moved(y=h + neck))
    _bulb(build, h + neck + tall * 0.4)
    return build


def floor_lamp(rng: Generator) -> Builder:
    """A tall stem on a plate or on three legs, a shade or a bowl on top."""
    build = Builder()
    h = between(rng, 1.15, 1.55)
    paint = paints.metal(rng) if chance(rng, 0.65) else paints.wood(rng)
    if chance(rng, 0.35):
        for k in range(3):
            foot = shapes.tube([(0, h * 0.92, -0.02), (0, 0, -0.28)], [0.016, 0.012])
            build.add(paint, foot.turned("y", 120 * k))
    else:
        build.add(
            paint, shapes.lathe([(0.15, 0), (0.15, 0.02), (0.02, 0.035), (0.013, 0.06), (0.013, h)], 24)
        )
    tall = between(rng, 0.2, 0.34)
    if chance(rng, 0.2):
        bowl = [(0.02, 0.0), (0.12, 0.03), (0.19, 0.09), (0.185, 0.09), (0.02, 0.03)]
        build.add(_shade_paint(rng), shapes.lathe(bowl, 24, (0, h - 0.02, 0)))
        return build
    build.add(_shade_paint(rng), shade(rng, between(rng, 0.17, 0.28), tall).moved(y=h - 0.06))
    _bulb(build, h + tall * 0.3)
    return build


def _cone_head(rng: Generator, radius: float, length: float) -> Solid:
    """A reflector whose opening looks down from the origin."""
    profile = [(radius, -length), (radius * 0.8, -length * 0.5), (radius * 0.35, -0.02), (0.015, 0.0)]
    rows = [tuple(p) for p in shapes.smooth_path(profile, 3)]
    a = np.linspace(0, 2 * np.pi, 21)
    grid = np.array([[(r * np.cos(v), y, -r * np.sin(v)) for v in a] for r, y in rows])
    return shapes.plate(grid[:, ::-1], 0.004)


def desk_lamp(rng: Generator) -> Builder:
    """Two arms and a reflector that looks down in front of the foot; the light falls to the front."""
    build = Builder()
    paint = paints.metal(rng) if chance(rng, 0.5) else paints.plastic(rng)
    head = paint if chance(rng, 0.7) else paints.plastic(rng)
    build.add(paint, shapes.lathe([(0.09, 0), (0.09, 0.018), (0.015, 0.03)], 24))
    low, high = between(rng, 0.2, 0.32), between(rng, 0.2, 0.32)
    back = between(rng, 0.02, 0.14)
    elbow = (0.0, 0.03 + low, back)
    tip = (0.0, elbow[1] + high * between(rng, 0.1, 0.75), back - high)
    for x in (-0.012, 0.012):
        build.add(paint, shapes.tube([(x, 0.03, 0), (x, *elbow[1:])], 0.005, sides=7))
        build.add(paint, shapes.tube([(x, *elbow[1:]), (x, *tip[1:])], 0.005, sides=7))
    for at in (elbow, tip):
        build.add(paint, shapes.cylinder(0.014, 0.04, (0, -0.02, 0), 10).turned("z", 90).moved(*at))
    cone = _cone_head(rng, between(rng, 0.06, 0.10), between(rng, 0.09, 0.15))
    build.add(head, cone.turned("x", between(rng, 5, 35)).moved(*tip))
    glow = shapes.ellipsoid((0.028, 0.028, 0.028), (0, -0.06, 0), 10)
    build.add(paints.plain((0.98, 0.96, 0.88), "bulb"), glow.moved(*tip))
    return build


def arc_lamp(rng: Generator) -> Builder:
    """A long bow from a heavy foot, its shade hanging out to the front."""
    build = Builder()
    metal = paints.metal(rng)
    h, reach = between(rng, 1.5, 1.9), between(rng, 0.7, 1.2)
    if chance(rng, 0.5):
        build.add(metal, shapes.cylinder(0.17, 0.04, (0, 0, reach * 0.5), 28))
    else:
        build.add(
            paints.plain((0.85, 0.84, 0.82), "stone"),
            shapes.rounded_box((0.28, 0.1, 0.22), (0, 0.05, reach * 0.5), 0.01),
        )
    bow = [(0, 0.03, reach * 0.5), (0, h * 0.65, reach * 0.48), (0, h, 0), (0, h * 0.86, -reach * 0.5)]
    build.add(metal, shapes.tube(shapes.smooth_path(bow, 8), 0.012, sides=8))
    tall = between(rng, 0.14, 0.24)
    build.add(
        _shade_paint(rng), shade(rng, between(rng, 0.16, 0.24), tall).moved(0, h * 0.86 - tall, -reach * 0.5)
    )
    return build


def pendant(rng: Generator) -> Builder:
    """A shade, a globe or a reflector on a cord."""
    build = Builder()
    cord = between(rng, 0.3, 0.8)
    build.add(paints.plain((0.12, 0.12, 0.12)), shapes.cylinder(0.006, cord, sides=6))
    build.add(paints.metal(rng), shapes.cylinder(0.05, 0.03, (0, cord, 0), 16))
    paint = _shade_paint(rng) if chance(rng, 0.6) else paints.metal(rng)
    kind = pick(rng, ("shade", "globe", "reflector"))
    if kind == "globe":
        r = between(rng, 0.1, 0.2)
        build.add(paint, shapes.ellipsoid((r, r, r), (0, -r + 0.02, 0), 24))
    elif kind == "shade":
        tall = between(rng, 0.15, 0.3)
        build.add(paint, shade(rng, between(rng, 0.15, 0.3), tall).moved(y=-tall + 0.03))
        _bulb(build, -tall * 0.5)
    else:
        build.add(paint, _cone_head(rng, between(rng, 0.12, 0.25), between(rng, 0.14, 0.24)).moved(y=0.02))
        _bulb(build, -0.1)
    return build


def lamp(rng: Generator) -> Mesh:
    """A lamp; where it reaches out, that is to -z."""
    makers = {
        "table": table_lamp,
        "floor": floor_lamp,
        "desk": desk_lamp,
        "arc": arc_lamp,
        "pendant": pendant,
    }
    return makers[pick(rng, tuple(makers), (2.2, 1.6, 1.8, 0.8, 0.8))](rng).mesh("lamp")
