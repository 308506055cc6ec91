"""What tells a car's front from its rear: lamps, grille, plates, mirrors, bumpers."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric.car_body import BodyShape, slab
from cadpose.library.parametric.decals import number_plate
from cadpose.library.parametric.paints import plain
from cadpose.library.parametric.shapes import box, cylinder, rounded_box, torus, tube
from cadpose.library.parametric.solids import Builder, Paint, Solid

_CHROME = plain((0.80, 0.81, 0.83), "chrome")
_BLACK = plain((0.06, 0.06, 0.065), "black")
_LENS = plain((0.93, 0.95, 0.97), "headlight")
_HOUSING = plain((0.55, 0.57, 0.60), "lamp housing")
_AMBER = plain((0.95, 0.55, 0.08), "indicator")
_RED = plain((0.72, 0.03, 0.03), "tail light")
_CLEAR = plain((0.88, 0.86, 0.86), "reversing light")

Corners = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]


def _rect(x0: float, x1: float, y0: float, y1: float) -> Corners:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def _bent(shape: BodyShape, corners: Corners, front: float, back: float, columns: int = 5) -> Solid:
    points, faces = slab(corners, front, back, columns, 1)
    return Solid(shape.deform(points), faces)


def add_front(build: Builder, shape: BodyShape, rng: Generator, paint: Paint, style: str) -> None:
    """Headlights, grille, intake, bumper, plate and badge at -z."""
    u = rng.uniform
    half = shape.width / 2
    nose = float(np.interp(0.0, *shape.top.T)) - 0.06
    low = shape.clearance + 0.06
    tall = nose - low
    top = nose - u(0.0, 0.04)
    y0, y1 = top - tall * u(0.22, 0.34), top
    out, inner = half - 0.015, half * u(0.48, 0.66)
    old = rng.random() < 0.18
    if old:
        radius = min(0.1, 0.2 * tall)
        x, y = half * u(0.66, 0.74), (y0 + y1) / 2
        disc = cylinder(radius, 0.08, sides=16).turned("x", -90)
        ring = torus(radius, 0.014, sides=16, around=4).turned("x", 90)
        z = float(shape.deform(np.array([x, y, 0.0]))[2])
        build.add(_LENS, disc.moved(x, y, z + 0.045).pair())
        build.add(_CHROME, ring.moved(x, y, z - 0.035).pair())
        side = out
        build.add(
            _AMBER, _bent(shape, _rect(x + radius + 0.02, side, y - 0.04, y + 0.04), -0.012, 0.1).pair()
        )
    else:
        slant, lift = u(-0.02, 0.07), u(0.0, 0.05)
        housing: Corners = (
            (inner, y0 + lift),
            (out, y0 + slant),
            (out + 0.012, y1),
            (inner, y1 - 0.3 * lift),
        )
        dark = rng.random() < 0.4
        build.add(_BLACK if dark else _HOUSING, _bent(shape, housing, -0.012, u(0.1, 0.3)).pair())
        cut = 0.12 * (out - inner)
        lens: Corners = (
            (inner + cut, y0 + lift + 0.015),
            (out - cut, y0 + slant + 0.015),
            (out - cut, y1 - 0.015),
            (inner + cut, y1 - 0.3 * lift - 0.015),
        )
        build.add(_LENS, _bent(shape, lens, -0.022, 0.03).pair())
        if rng.random() < 0.4:
            corner: Corners = _rect(out - cut, out + 0.006, y0 + max(slant, 0) + 0.012, y1 - 0.02)
            build.add(_AMBER, _bent(shape, corner, -0.017, 0.08, 2).pair())
    _grille(build, shape, rng, paint, (inner - 0.04, y0, y1))
    bumper = low + 0.42 * tall
    lip = low + 0.02
    if rng.random() < (0.7 if style == "van" else 0.22):
        build.add(_BLACK, _bent(shape, _rect(-half - 0.01, half + 0.01, low, bumper), -0.035, 0.32, 10))
        lip = low + 0.1
    wide = half * u(0.55, 0.8)
    build.add(_BLACK, _bent(shape, _rect(-wide, wide, lip, lip + 0.25 * tall), -0.014, 0.03, 8))
    if rng.random() < 0.55:
        fog = _rect(0.68 * half, 0.84 * half, lip + 0.04, lip + 0.04 + 0.13 * tall)
        build.add(_HOUSING if rng.random() < 0.6 else _BLACK, _bent(shape, fog, -0.02, 0.03, 2).pair())
    plate_y = low + u(0.24, 0.36) * tall
    z = float(shape.deform(np.array([0.0, plate_y, -0.03]))[2])
    build.add(*number_plate(rng, (0.0, plate_y, z - 0.005), to_front=True))


def _grille(
    build: Builder, shape: BodyShape, rng: Generator, paint: Paint, place: tuple[float, float, float]
) -> None:
    u = rng.uniform
    wide, y0, y1 = place
    kind = int(rng.integers(5))
    wide = max(wide, 0.25) * (u(0.5, 0.8) if kind == 2 else u(0.85, 1.0))
    drop = u(0.0, 0.5) * (y1 - y0)
    low, high = y0 - drop + 0.01, y1 - 0.015
    outline: Corners = ((-wide * u(0.75, 1), low), (wide * u(0.75, 1), low), (wide, high), (-wide, high))
    outline = ((-outline[1][0], low), outline[1], outline[2], outline[3])
    if kind == 0:
        gap = 0.02
        part: Corners = ((gap, low), (wide * 0.5, low), (wide * 0.55, high), (gap, high))
        build.add(_CHROME, _bent(shape, part, -0.014, 0.03, 3).pair())
        part = (
            (gap + 0.015, low + 0.015),
            (wide * 0.5 - 0.015, low + 0.015),
            (wide * 0.55 - 0.015, high - 0.015),
            (gap + 0.015, high - 0.015),
        )
        build.add(_BLACK, _bent(shape, part, -0.019, 0.03, 3).pair())
        return
    if rng.random() < 0.55:
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = outline
        frame: Corners = (
            (ax * 1.04, ay - 0.02),
            (bx * 1.04, by - 0.02),
            (cx * 1.04, cy + 0.015),
            (dx * 1.04, dy + 0.015),
        )
        build.add(_CHROME, _bent(shape, frame, -0.013, 0.03, 7))
    build.add(_BLACK, _bent(shape, outline, -0.018, 0.03, 7))
    bars = plain((0.5, 0.5, 0.52), "bars") if rng.random() < 0.6 else _CHROME
    if kind in (1, 3):
        count = int(rng.integers(2, 6))
        for k in range(count):
            y = low + (high - low) * (k + 0.5) / count
            w = np.interp(y, [low, high], [outline[1][0], outline[2][0]]) * 0.97
            build.add(bars, _bent(shape, _rect(-w, w, y - 0.007, y + 0.007), -0.024, 0.0, 7))
    elif kind == 2:
        for x in np.linspace(-0.85, 0.85, int(rng.integers(5, 9))) * outline[1][0]:
            build.add(bars, _bent(shape, _rect(x - 0.01, x + 0.01, low + 0.01, high - 0.01), -0.024, 0.0, 1))
    middle = (low + high) / 2
    z = float(shape.deform(np.array([0.0, middle, -0.03]))[2])
    build.add(_CHROME, cylinder(0.05, 0.02, sides=12).turned("x", 90).moved(0, middle, z + 0.01))


def add_rear(build: Builder, shape: BodyShape, rng: Generator, paint: Paint, style: str) -> None:
    """Tail lights, plate, bumper, window of an upright wall and exhausts at +z."""
    u = rng.uniform
    half, end = shape.width / 2, shape.length
    deck = float(np.interp(end - 0.03, *shape.top.T)) - 0.06
    if style == "van":
        deck = float(shape.belt[-1, 1]) + 0.35
    low = shape.clearance + 0.06
    tall = deck - low
    upright = style in ("van", "pickup") or (
        style in ("estate", "suv", "minivan", "hatchback") and rng.random() < 0.35
    )
    y1 = deck - u(0.0, 0.05)
    if upright:
        y0, inner = y1 - tall * u(0.35, 0.5), half * u(0.82, 0.88)
    else:
        y0, inner = y1 - tall * u(0.2, 0.3), half * u(0.45, 0.68)
    out = half - 0.012

    def plate(corners: Corners, proud: float, depth: float, columns: int = 5) -> Solid:
        return _bent(shape, corners, end - depth, end + proud, columns)

    slant = 0.0 if upright else u(-0.05, 0.06)
    lamp: Corners = (
        (inner, y0 + max(slant, 0)),
        (out, y0),
        (out + 0.012, y1),
        (inner + 0.2 * slant, y1 - 0.01),
    )
    red, green, _, _ = paint.material.rgba
    if (red > 0.4 and green < 0.2) or rng.random() < 0.2:
        # A red lamp on red paint is seen by its dark frame.
        frame: Corners = (
            (inner - 0.02, y0 + max(slant, 0) - 0.02),
            (out, y0 - 0.02),
            (out + 0.01, y1 + 0.015),
            (inner + 0.2 * slant - 0.02, y1 + 0.005),
        )
        build.add(_BLACK, plate(frame, 0.011, 0.08).pair())
    build.add(_RED, plate(lamp, 0.016, 0.07 if style == "pickup" else u(0.1, 0.28)).pair())
    third = (y1 - y0) / 3
    if upright:
        build.add(
            _AMBER, plate(_rect(inner + 0.01, out - 0.01, y0 + third, y0 + 1.6 * third), 0.022, 0.0, 2).pair()
        )
        build.add(
            _CLEAR, plate(_rect(inner + 0.01, out - 0.01, y0 + 0.02, y0 + 0.9 * third), 0.022, 0.0, 2).pair()
        )
    else:
        span = out - inner
        x0 = inner + span * u(0.05, 0.3)
        build.add(_CLEAR, plate(_rect(x0, x0 + 0.3 * span, y0 + third, y0 + 2 * third), 0.022, 0.0, 2).pair())
        if rng.random() < 0.15:
            build.add(_RED, plate(_rect(-inner - 0.01, inner + 0.01, y1 - third, y1 - 0.02), 0.014, 0.03, 8))
    bumper = low + 0.38 * tall
    if style == "van" or rng.random() < 0.25:
        build.add(_BLACK, plate(_rect(-half - 0.01, half + 0.01, low, bumper), 0.045, 0.3, 10))
    else:
        build.add(
            _BLACK, plate(_rect(-0.75 * half, 0.75 * half, low - 0.02, low + 0.22 * tall), 0.012, 0.05, 8)
        )
        build.add(_BLACK, plate(_rect(-half, half, bumper, bumper + 0.012), 0.006, 0.25, 10))
    if style == "van":
        height = float(shape.top[:, 1].max())
        y = float(shape.belt[-1, 1])
        pane: Corners = (
            (0.04, y + 0.05),
            (0.88 * half, y + 0.05),
            (0.8 * half, height - 0.22),
            (0.04, height - 0.22),
        )
        build.add(plain((0.08, 0.09, 0.1), "glass"), plate(pane, 0.025, 0.03, 4).pair())
        build.add(_BLACK, plate(_rect(-0.008, 0.008, bumper, height - 0.1), 0.012, 0.03, 1))
    plate_y = (y0 + y1) / 2 - 0.02 if (inner > 0.45 and rng.random() < 0.6) else bumper - 0.06
    if style in ("van", "pickup"):
        plate_y = bumper - 0.12
    z = float(shape.deform(np.array([0.0, plate_y, end + 0.03]))[2])
    build.add(*number_plate(rng, (0.0, plate_y, z + (0.03 if plate_y < bumper else -0.012)), to_front=False))
    if style != "van":
        for x in [(0.6,), (-0.6,), (0.6, -0.6)][int(rng.integers(3))]:
            pipe = cylinder(0.035, 0.12, sides=10).turned("x", 90)
            build.add(_CHROME, pipe.moved(x * half, low - 0.02, end / 2 - 0.12))


def add_sides(build: Builder, shape: BodyShape, rng: Generator, paint: Paint, style: str) -> None:
    """Mirrors, door handles, underside, and now and then roof rails."""
    u = rng.uniform
    half = shape.width / 2
    cowl, head = shape.windscreen
    centre = shape.length / 2
    belt = float(np.interp(cowl, *shape.belt.T))
    z = cowl + 0.42 * (head - cowl) - centre
    size = (u(0.16, 0.22), u(0.11, 0.15), 0.11) if style != "van" else (0.2, 0.32, 0.12)
    y = belt + size[1] / 2 + 0.03
    x = half * 0.94
    mirror = rounded_box(size, (x + size[0] / 2 + 0.05, y, z), 0.045)
    build.add(paint if rng.random() < 0.65 else _BLACK, mirror.pair())
    glass = box((size[0] - 0.04, size[1] - 0.03, 0.01), (x + size[0] / 2 + 0.05, y, z + 0.055))
    build.add(plain((0.6, 0.66, 0.7), "mirror"), glass.pair())
    build.add(_BLACK, box((0.12, 0.03, 0.05), (x + 0.03, belt + 0.04, z)).pair())
    handle = _CHROME if rng.random() < 0.35 else paint
    for door in shape.doors[1:]:
        y = float(np.interp(door, *shape.belt.T)) - 0.12
        grip = half * float(shape.side(y)) + 0.008
        build.add(handle, box((0.03, 0.03, 0.16), (grip, y, door - 0.16 - centre)).pair())
    front, rear = shape.axles
    build.add(
        _BLACK, box((1.1, 0.25, rear - front + 1.2), (0, shape.clearance + 0.17, (front + rear) / 2 - centre))
    )
    # Without these, one looks through the arches of one side and out of the other.
    reach = shape.arch_radius
    for s in shape.axles:
        bonnet = float(np.interp(s, *shape.top.T)) - 0.12
        rise = min(shape.wheel_radius + reach + 0.01, bonnet) - shape.clearance
        house = box((shape.width - 0.62, rise, 2 * reach), (0, shape.clearance + rise / 2, s - centre))
        build.add(_BLACK, house)
    if style in ("estate", "suv", "minivan") and rng.random() < 0.5:
        height = float(shape.top[:, 1].max())
        tail = shape.rear_glass[0]
        ends = [
            (head + 0.15, height - 0.06),
            (head + 0.3, height + 0.02),
            (tail - 0.25, height + 0.01),
            (tail - 0.1, height - 0.07),
        ]
        rail = tube([(half * 0.62, y, s - centre) for s, y in ends], 0.018, 6)
        build.add(_CHROME if rng.random() < 0.5 else _BLACK, rail.pair())


def add_interior(build: Builder, shape: BodyShape, rng: Generator, paint: Paint) -> None:
    """Windscreen, seats and steering wheel of an open car."""
    cowl, head = shape.windscreen
    half, centre = shape.width / 2, shape.length / 2
    base = float(np.interp(cowl, *shape.top.T)) - 0.02
    height = base + rng.uniform(0.36, 0.44)
    foot, top = (0.80 * half, base, cowl + 0.08 - centre), (0.62 * half, height, head + 0.05 - centre)
    foot_l, top_l = (-foot[0], *foot[1:]), (-top[0], *top[1:])
    build.add(paint if rng.random() < 0.5 else _BLACK, tube([foot, top, top_l, foot_l], 0.028, 6))
    pane = Solid(np.array([foot, foot_l, top_l, top]), np.array([[0, 1, 2], [0, 2, 3]]))
    build.add(plain((0.55, 0.65, 0.68), "glass", 0.35), pane)
    assert shape.bed is not None
    seat = plain(
        [(0.45, 0.3, 0.2), (0.12, 0.11, 0.11), (0.82, 0.77, 0.68), (0.5, 0.1, 0.1)][int(rng.integers(4))],
        "leather",
    )
    start, end, floor = shape.bed
    belt = float(shape.belt[0, 1])
    rows = [start + 0.75 * (end - start)] if end - start < 1.35 else [start + 0.5 * (end - start), end - 0.2]
    for back in rows:
        z = back - centre
        cushion = rounded_box((0.5, 0.2, 0.5), (0.37, floor + 0.12, z - 0.25), 0.06)
        rest = rounded_box((0.48, belt - floor + 0.02, 0.14), (0, 0, 0), 0.06).turned("x", -12)
        build.add(seat, cushion.pair(), rest.moved(0.37, (belt + floor) / 2 + 0.05, z).pair())
        build.add(seat, rounded_box((0.26, 0.17, 0.1), (0.37, belt + 0.12, z + 0.06), 0.04).pair())
    wheel = (
        torus(0.18, 0.016, sides=16, around=5).turned("x", 70).moved(-0.37, belt + 0.0, start + 0.25 - centre)
    )
    build.add(_BLACK, wheel)
