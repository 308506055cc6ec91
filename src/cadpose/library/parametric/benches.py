"""Benches: garden and park benches with slatted backs, hall benches, and those without a back."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.chairs_frame import Frame, back_fill, seat
from cadpose.library.parametric.seating import (
    Bend,
    between,
    chance,
    four_legs,
    leg,
    pick,
    rail,
    seat_outline,
    slab,
    upright,
)
from cadpose.library.parametric.solids import Builder, Paint


def _planks(
    paint: Paint, build: Builder, width: float, depth: float, y: float, count: int, thick: float
) -> None:
    """A seat of boards along x."""
    each = depth / count
    for k in range(count):
        z = (k - (count - 1) / 2) * each
        build.add(paint, shapes.rounded_box((width, thick, each * 0.86), (0, y - thick / 2, z), 0.004))


def park(rng: Generator) -> Builder:
    """Boards for seat and back between two or three cast or bent ends, with arms or without."""
    build = Builder()
    wood = paints.wood(rng) if chance(rng, 0.75) else paints.painted(rng)
    iron = paints.metal(rng) if chance(rng, 0.6) else paints.plain((0.12, 0.14, 0.12))
    width, depth = between(rng, 1.2, 2.0), between(rng, 0.40, 0.50)
    h, high, rake = between(rng, 0.40, 0.46), between(rng, 0.32, 0.50), between(rng, 10, 22)
    lean = float(np.tan(np.radians(rake)))
    z0, z1 = -depth / 2, depth / 2
    count = int(rng.integers(3, 8))
    _planks(wood, build, width, depth, h, count, between(rng, 0.025, 0.04))
    rows = int(rng.integers(1, 6))
    tall = high * 0.85 / rows
    bend = Bend(width, high, h, z1, rake)
    for k in range(rows):
        build.add(wood, rail(high - tall * (k + 0.5), width / 2, tall * 0.84, 0.028, pieces=1).warped(bend))
    t = between(rng, 0.03, 0.055)
    section = shapes.rectangle(t * 1.1, t * 0.7)
    ends = [width * between(rng, 0.36, 0.485)]
    style = pick(rng, ("cast", "legs", "concrete"), (2, 1.4, 0.6))
    armed = chance(rng, 0.6)
    rest = h + between(rng, 0.18, 0.24)
    for x in ends:
        if style == "concrete":
            side = [
                (z0 + 0.02, 0),
                (z0 + 0.06, h - 0.03),
                (z1, h - 0.03),
                (z1 + high * lean, h + high),
                (z1 + high * lean + 0.07, h + high),
            ]
            side += [(z1 + 0.09, h - 0.06), (z1 + 0.06, 0)]
            grey = paints.plain((0.62, 0.61, 0.58), "concrete")
            build.add(grey, shapes.extrude(side, 0.08, "zy").moved(x).pair())
            continue
        back = [
            (x, 0, z1 + 0.10),
            (x, h * 0.5, z1 - 0.01),
            (x, h - 0.04, z1 + 0.02),
            (x, h + high, z1 + high * lean + 0.03),
        ]
        path = shapes.smooth_path(back, 4) if style == "cast" else np.array([back[0], back[2], back[3]])
        build.add(iron, shapes.tube(path, 1.0, section=section, up=(0, 0, -1)).pair())
        front_top = rest if armed else h - 0.04
        front = [
            (x, 0, z0 - 0.02),
            (x, h * 0.5, z0 + 0.06),
            (x, h - 0.04, z0 + 0.02),
            (x, front_top, z0 + 0.03),
        ]
        path = shapes.smooth_path(front, 4) if style == "cast" else np.array([front[0], front[3]])
        build.add(iron, shapes.tube(path, 1.0, section=section, up=(0, 0, -1)).pair())
        build.add(iron, shapes.bar((x, h - 0.05, z0), (x, h - 0.05, z1 + 0.02), t, t * 0.8).pair())
        if armed:
            arm = [
                (x, rest - 0.03, z0 - 0.03),
                (x, rest, z0 + 0.05),
                (x, rest, z1 * 0.5),
                (x, rest - 0.01, z1 + (rest - h) * lean),
            ]
            build.add(
                iron if style == "cast" else wood,
                shapes.tube(
                    shapes.smooth_path(arm, 3), 1.0, section=shapes.rectangle(t * 1.5, t * 0.6)
                ).pair(),
            )
        if style == "cast" and chance(rng, 0.5):
            ring = shapes.torus(0.07, 0.010, sides=16, around=6).turned("z", 90).moved(x, rest - 0.09, 0.0)
            build.add(iron, ring.pair() if armed else ring.moved(y=-0.3).pair())
    return build


def garden_bench(rng: Generator) -> Builder:
    """A long wooden chair: posts, a filled back, arms mostly; upholstered for the hall now and then."""
    build = Builder()
    wood = paints.wood(rng) if chance(rng, 0.7) else paints.painted(rng)
    soft = paints.upholstery(rng)
    width, depth, h = between(rng, 1.0, 1.8), between(rng, 0.42, 0.54), between(rng, 0.41, 0.47)
    high, t = between(rng, 0.36, 0.58), between(rng, 0.04, 0.065)
    frame = Frame(width, depth, h, high, t)
    bend = Bend(width, high, h, depth / 2 - t / 2, between(rng, 4, 14))
    kind = pick(rng, ("slats", "slats", "spindles", "ladder", "cross", "panel"))
    low = between(rng, 0.04, 0.10)
    bays = 1 if kind in ("ladder", "panel") else int(rng.integers(1, 4))
    half = width / 2 - t / 2
    posts = np.linspace(-half, half, bays + 1)
    state = rng.bit_generator.state
    for k in range(bays):
        rng.bit_generator.state = state  # all bays alike
        middle, each = (posts[k] + posts[k + 1]) / 2, (posts[k + 1] - posts[k]) / 2
        for paint, solid in back_fill(rng, kind, float(each), low, high, t, wood, soft):
            build.add(paint, solid.moved(float(middle)).warped(bend))
    if kind in ("slats", "spindles") and bays == 1:
        for x in np.linspace(-half, half, int(rng.integers(10, 18)))[1:-1]:
            build.add(wood, upright(float(x), low, high - 0.05, 0.035, 0.014).warped(bend))
    for x in posts:
        build.add(wood, upright(float(x), -0.03, high, t, t * 0.8).warped(bend))
    rear = leg("square", h, t).moved(half, 0, depth / 2 - t / 2)
    front = leg(pick(rng, ("square", "taper", "turned")), h - 0.01, t).moved(half, 0, -depth / 2 + t / 2)
    build.add(wood, rear.pair(), front.pair())
    build.add(wood, shapes.box((width - t, 0.07, 0.025), (0, h - 0.06, -depth / 2 + t / 2)))
    if chance(rng, 0.65):
        _planks(wood, build, width, depth, h, int(rng.integers(3, 8)), 0.022)
    else:
        seat(rng, build, frame, width, wood, soft)
    if chance(rng, 0.7):
        rest = between(rng, 0.18, 0.25)
        at = bend(np.array([[half, min(rest, high * 0.9), 0.0]]))[0]
        z = -depth / 2 + t
        build.add(
            wood,
            shapes.bar(
                (half, float(at[1]), z - 0.06), (half, float(at[1]), float(at[2])), t * 1.3, 0.025
            ).pair(),
        )
        build.add(
            wood,
            shapes.bar((half, h - 0.03, z - 0.01), (half, float(at[1]), z - 0.01), t * 0.9, t * 0.9).pair(),
        )
    return build


def backless(rng: Generator) -> Builder:
    """A long seat on legs or slabs: of boards, of one board, or padded."""
    build = Builder()
    wood = paints.wood(rng) if chance(rng, 0.75) else paints.painted(rng)
    width, depth, h = between(rng, 0.9, 1.8), between(rng, 0.30, 0.45), between(rng, 0.41, 0.48)
    t = between(rng, 0.04, 0.07)
    kind = pick(rng, ("planks", "board", "pad"))
    if kind == "planks":
        _planks(wood, build, width, depth, h, int(rng.integers(2, 6)), 0.03)
    elif kind == "board":
        build.add(wood, slab(shapes.rectangle(width, depth, 0.02), h - 0.045, 0.045, 0.008))
    else:
        soft = paints.upholstery(rng)
        thick = between(rng, 0.06, 0.14)
        build.add(
            soft, slab(seat_outline(width, width, depth, 0.03), h - thick, thick, thick * 0.35, thick * 0.15)
        )
        h -= thick - 0.03
    base = pick(rng, ("legs", "slabs", "trestle"), (2, 1, 1))
    x = width * between(rng, 0.36, 0.46)
    if base == "slabs":
        build.add(wood, shapes.box((t, h - 0.03, depth * 0.85), (x, (h - 0.03) / 2, 0)).pair())
    elif base == "trestle":
        for s in (1, -1):
            build.add(
                wood, shapes.bar((x, h - 0.03, s * depth * 0.15), (x, 0, s * depth * 0.48), t, t).pair()
            )
        build.add(wood, shapes.bar((x, h * 0.5, -depth * 0.3), (x, h * 0.5, depth * 0.3), t * 0.6, t).pair())
    else:
        metal = wood if chance(rng, 0.6) else paints.metal(rng)
        style = pick(rng, ("square", "taper", "round", "turned", "splayed"))
        four_legs(build, metal, style, 2 * x, depth - t * 1.3, h - 0.02, t)
    if chance(rng, 0.5):
        build.add(wood, shapes.box((2 * x, 0.06, 0.03), (0, h * between(rng, 0.4, 0.85), 0)))
    return build


def settle(rng: Generator) -> Builder:
    """A chest to sit on with a low back and closed sides."""
    build = Builder()
    wood = paints.wood(rng) if chance(rng, 0.6) else paints.painted(rng)
    width, depth, h = between(rng, 0.9, 1.5), between(rng, 0.40, 0.5), between(rng, 0.42, 0.48)
    high = h + between(rng, 0.30, 0.5)
    build.add(wood, shapes.rounded_box((width, h - 0.05, depth), (0, (h - 0.05) / 2 + 0.02, 0), 0.006))
    build.add(
        paints.darker(wood, 0.9),
        slab(shapes.rectangle(width + 0.02, depth + 0.01, 0.01), h - 0.03, 0.025, 0.005),
    )
    build.add(wood, shapes.rounded_box((width, high, 0.04), (0, high / 2, depth / 2 - 0.02), 0.006))
    side = [
        (-depth / 2, 0),
        (-depth / 2, h + 0.16),
        (-depth / 4, h + 0.2),
        (depth / 2 - 0.05, high),
        (depth / 2, high),
        (depth / 2, 0),
    ]
    build.add(wood, shapes.extrude(side, 0.035, "zy").moved(width / 2 + 0.01).pair())
    fields = int(rng.integers(2, 5))
    for k in range(fields):
        each = width / fields
        x = (k - (fields - 1) / 2) * each
        build.add(
            paints.darker(wood, 0.82),
            shapes.box((each * 0.8, h * 0.6, 0.01), (x, h * 0.47, -depth / 2 - 0.001)),
        )
    if chance(rng, 0.5):
        pad = slab(shapes.rectangle(width - 0.04, depth - 0.06, 0.03), h - 0.01, 0.06, 0.025, 0.01)
        build.add(paints.fabric(rng, 0.4), pad.moved(z=-0.02))
    return build


def bench(rng: Generator) -> Mesh:
    """A bench; where it has a back, that is at +z."""
    makers = {"park": park, "garden": garden_bench, "backless": backless, "settle": settle}
    return makers[pick(rng, tuple(makers), (0.42, 0.34, 0.14, 0.10))](rng).mesh("bench")
