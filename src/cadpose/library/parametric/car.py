"""Cars: sedan, hatchback, estate, SUV, coupe, convertible, minivan, pickup and delivery van."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.car_body import BED, DARK, GLASS, PAINT, TRIM, BodyShape, body_shell
from cadpose.library.parametric.car_details import add_front, add_interior, add_rear, add_sides
from cadpose.library.parametric.paints import Colour, plain
from cadpose.library.parametric.solids import Builder, Paint, Solid
from cadpose.library.parametric.wheels import MIRROR_X, car_wheel, rim_paint

STYLES = ("sedan", "hatchback", "estate", "suv", "coupe", "convertible", "minivan", "pickup", "van")
_SHARE = (0.2, 0.2, 0.1, 0.17, 0.09, 0.06, 0.07, 0.06, 0.05)

_PAINTS: tuple[tuple[Colour, float], ...] = (
    ((0.93, 0.93, 0.93), 5),
    ((0.72, 0.73, 0.75), 4),
    ((0.42, 0.43, 0.45), 4),
    ((0.09, 0.09, 0.10), 4),
    ((0.70, 0.07, 0.07), 3),
    ((0.45, 0.05, 0.08), 1),
    ((0.10, 0.22, 0.52), 2),
    ((0.07, 0.11, 0.24), 2),
    ((0.35, 0.55, 0.78), 1),
    ((0.10, 0.30, 0.20), 1),
    ((0.45, 0.60, 0.35), 0.7),
    ((0.93, 0.77, 0.10), 1),
    ((0.88, 0.42, 0.08), 0.8),
    ((0.76, 0.69, 0.56), 1),
    ((0.36, 0.24, 0.16), 0.7),
    ((0.55, 0.78, 0.75), 0.4),
    ((0.45, 0.25, 0.50), 0.3),
)


def car(rng: Generator) -> Mesh:
    """Any kind of car."""
    return car_of_style(rng, STYLES[int(rng.choice(len(STYLES), p=_SHARE))])


def car_of_style(rng: Generator, style: str) -> Mesh:
    """A car of one of `STYLES`."""
    shape = _shape(rng, style)
    paint, roof = _paints(rng, style)
    tint = rng.uniform(0.04, 0.16)
    glass = plain((tint, tint + rng.uniform(0, 0.03), tint + rng.uniform(0.01, 0.05)), "glass")
    plastic = plain((0.11, 0.11, 0.12), "plastic")
    build = Builder()
    points, faces, kind = body_shell(shape)
    looks = {PAINT: paint, GLASS: glass, DARK: plastic, TRIM: plastic, BED: plastic, _ROOF: roof}
    for number, look in looks.items():
        if (kind == number).any():
            build.add(look, Solid(points, faces[kind == number]))
    add_front(build, shape, rng, paint, style)
    add_rear(build, shape, rng, paint, style)
    add_sides(build, shape, rng, paint, style)
    if style == "convertible":
        add_interior(build, shape, rng, paint)
    _add_wheels(build, shape, rng, style)
    return build.mesh("car")


_ROOF = 5


def _paints(rng: Generator, style: str) -> tuple[Paint, Paint]:
    weights = np.array([w for _, w in _PAINTS])
    colour = _PAINTS[int(rng.choice(len(_PAINTS), p=weights / weights.sum()))][0]
    if style == "van" and rng.random() < 0.6:
        colour = (0.93, 0.93, 0.93)
    shade = rng.normal(0, 0.025)
    r, g, b = (float(np.clip(c + shade, 0.02, 0.97)) for c in colour)
    paint = plain((r, g, b), "paint")
    second = [(0.08, 0.08, 0.09), (0.93, 0.93, 0.93)][int(rng.integers(2))]
    roof = plain(second, "roof") if rng.random() < 0.12 else paint
    return paint, roof


def _add_wheels(build: Builder, shape: BodyShape, rng: Generator, style: str) -> None:
    plain_disc = rng.random() < (0.7 if style == "van" else 0.12)
    spokes = 0 if plain_disc else int(rng.choice([5, 6, 7, 8, 10]))
    width = shape.wheel_radius * rng.uniform(0.58, 0.72)
    wheel = car_wheel(
        shape.wheel_radius, width, rim_paint(rng), spokes, cap=plain_disc and rng.random() < 0.5
    )
    for s in shape.axles:
        x = shape.width / 2 - width / 2 - 0.015
        at = (x, shape.wheel_radius, s - shape.length / 2)
        build.include(wheel, None, at)
        build.include(wheel, MIRROR_X, (-x, at[1], at[2]))


def _shape(rng: Generator, style: str) -> BodyShape:
    """Measures of a style: typical ones, each varied by some per cent."""
    u = rng.uniform
    # length, width, height, clearance, bonnet y at the nose and at the windscreen's foot, wheel radius;
    # then as shares of the length: windscreen's foot and head, roof's end, rear glass's foot, belt's height.
    length, width, height, clear, nose, cowl_y, wheel, cowl, head, tail, foot, belt_y = {
        "sedan": (4.65, 1.80, 1.45, 0.17, 0.70, 0.96, 0.33, 0.275, 0.43, 0.69, 0.845, 0.93),
        "hatchback": (4.05, 1.75, 1.48, 0.17, 0.71, 0.98, 0.32, 0.255, 0.41, 0.87, 0.965, 0.94),
        "estate": (4.70, 1.81, 1.48, 0.17, 0.70, 0.96, 0.33, 0.27, 0.42, 0.90, 0.972, 0.94),
        "suv": (4.50, 1.86, 1.68, 0.23, 0.88, 1.12, 0.38, 0.265, 0.395, 0.90, 0.972, 1.07),
        "coupe": (4.45, 1.84, 1.31, 0.14, 0.68, 0.88, 0.34, 0.30, 0.46, 0.64, 0.885, 0.87),
        "convertible": (4.20, 1.78, 1.28, 0.15, 0.66, 0.88, 0.32, 0.33, 0.435, 0.435, 0.47, 0.88),
        "minivan": (4.70, 1.88, 1.76, 0.18, 0.80, 1.12, 0.33, 0.195, 0.37, 0.92, 0.978, 1.04),
        "pickup": (5.30, 1.90, 1.80, 0.26, 0.96, 1.18, 0.40, 0.255, 0.355, 0.545, 0.575, 1.14),
        "van": (5.10, 1.98, 2.15, 0.20, 0.88, 1.22, 0.34, 0.135, 0.28, 0.985, 0.992, 1.18),
    }[style]
    length, width, height = length * u(0.93, 1.07), width * u(0.97, 1.03), height * u(0.95, 1.06)
    nose, cowl_y, belt_y = nose * u(0.94, 1.06), cowl_y * u(0.97, 1.03), belt_y * u(0.98, 1.03)
    wheel *= u(0.95, 1.08)
    cowl, head = cowl + u(-0.02, 0.02), head + u(-0.015, 0.02)
    tail, foot = tail + u(-0.012, 0.012), foot + u(-0.01, 0.008)
    cowl_y = max(cowl_y, nose + 0.1)
    belt_y = max(belt_y, cowl_y - 0.06)
    cowl_s, head_s, tail_s, foot_s = (length * share for share in (cowl, head, tail, foot))
    deck = max(cowl_y, belt_y) + u(0.04, 0.10)
    hatch = style in ("hatchback", "estate", "suv", "minivan")
    front = [
        [0.0, nose - 0.05],
        [0.07, nose],
        [0.4 * cowl_s, nose + 0.68 * (cowl_y - nose)],
        [cowl_s, cowl_y],
    ]
    roof_mid = [(head_s * 0.55 + tail_s * 0.45), height]
    roof = [[head_s, height - 0.035], roof_mid, [tail_s, height - (0.05 if hatch else 0.06)]]
    end_drop = 0.06
    if style == "van":
        back = [[length - 0.02, height - 0.03], [length, height - 0.06]]
    elif hatch:
        back = [[foot_s, belt_y + 0.02], [length - 0.02, belt_y - 0.06], [length, belt_y - 0.12]]
    elif style == "pickup":
        back = [[foot_s, belt_y + 0.08], [length - 0.02, belt_y + 0.05], [length, belt_y]]
    else:
        back = [[foot_s, deck], [length - 0.05, deck - u(0.0, 0.05)], [length, deck - 0.05 - end_drop]]
    if style == "convertible":
        roof, back = [[cowl_s + 0.02, cowl_y]], [[0.7 * length, deck - 0.03], *back[1:]]
    axles = (length * u(0.185, 0.205), length * u(0.80, 0.83))
    if style in ("minivan", "van"):
        axles = (length * u(0.17, 0.19), length * u(0.78, 0.82))
    rise = u(0.0, 0.08)
    belt = [[0.0, belt_y - 0.03], [cowl_s, belt_y - 0.02], [tail_s, belt_y + rise], [length, belt_y + rise]]
    if style in ("pickup", "convertible"):
        belt = [[0.0, belt_y], [length, belt_y + 0.3 * rise]]
    shape = BodyShape(
        length,
        width,
        clear,
        wheel,
        axles,
        np.array(front + roof + back),
        np.array(belt),
        (cowl_s, head_s),
        (tail_s, foot_s),
        (),
        (),
        tumble=0.2 if style in ("van",) else u(0.28, 0.42),
        wrap=(u(0.12, 0.26), u(0.06, 0.18)),
        tilt=(u(0.0, 0.2), u(0.0, 0.2)),
        bow=u(0.06, 0.14),
        cladding=style in ("suv", "pickup") and rng.random() < 0.6,
        roof=_ROOF,
    )
    return _openings(shape, rng, style)


def _openings(shape: BodyShape, rng: Generator, style: str) -> BodyShape:
    """Side windows, door gaps and beds."""
    length, (cowl, head), (tail, foot) = shape.length, shape.windscreen, shape.rear_glass
    pillar = rng.uniform(0.05, 0.1)
    windows: tuple[tuple[float, float], ...]
    start = cowl + 0.3 * (head - cowl)
    door = cowl + 0.12
    middle = head + (0.42 if style in ("coupe", "hatchback") else 0.36) * (tail - head)
    back_door = max(tail - 0.12 * (tail - head), middle + 0.5)
    if style == "convertible":
        bed = (head + 0.05, 0.70 * length, shape.clearance + 0.25)
        return replace(
            shape, bed=bed, doors=(door, 0.66 * length), rear_glass=(foot, foot), roof=PAINT, bow=0.0
        )
    if style == "pickup":
        double = rng.random() < 0.6
        windows = ((start, middle), (middle + pillar, tail)) if double else ((start, tail - 0.1),)
        gaps = (door, middle + pillar / 2, tail + 0.03) if double else (door, tail)
        return replace(
            shape, side_glass=windows, doors=gaps, bed=(foot + 0.06, length - 0.07, shape.clearance + 0.58)
        )
    if style == "van":
        windows = ((start, head + 0.75),)
        if rng.random() < 0.4:
            windows += ((head + 0.95, head + 1.9), (head + 2.0, length - 0.25))
        return replace(
            shape, side_glass=windows, doors=(door, head + 0.85, head + 1.95), rear_glass=(length, length)
        )
    if style == "coupe" or (style == "hatchback" and rng.random() < 0.35):
        middle = min(middle + 0.25, tail - 0.1)
        windows = ((start, middle), (middle + pillar, tail + 0.35 * (foot - tail)))
        return replace(shape, side_glass=windows, doors=(door, middle + pillar / 2))
    windows = ((start, middle), (middle + pillar, back_door))
    if style in ("estate", "suv", "minivan"):
        windows += ((back_door + pillar, max(tail - 0.02, back_door + pillar + 0.3)),)
    elif style == "sedan":
        windows = ((start, middle), (middle + pillar, tail + 0.3 * (foot - tail)))
        back_door = tail + 0.12
    return replace(shape, side_glass=windows, doors=(door, middle + pillar / 2, back_door))
