"""Tables: dining, round, coffee and console tables, and desks; who sits at a desk sits at its front, -z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.casework import Cell, Look, carcass, front
from cadpose.library.parametric.seating import between, chance, four_legs, pick, slab
from cadpose.library.parametric.solids import Array, Builder, Paint


def _top_paint(rng: Generator, frame: Paint) -> Paint:
    kind = pick(rng, ("same", "wood", "painted", "glass", "stone"), (3, 1.5, 1, 0.8, 0.5))
    if kind == "stone":
        return paints.plain((between(rng, 0.3, 0.9),) * 3, "stone")
    if kind == "same":
        return frame
    return {"wood": paints.wood, "painted": paints.painted, "glass": paints.glass}[kind](rng)


def _frame_paint(rng: Generator) -> Paint:
    kind = pick(rng, ("wood", "painted", "metal"), (3, 1, 1))
    return {"wood": paints.wood, "painted": paints.painted, "metal": paints.metal}[kind](rng)


def _round(width: float, depth: float, power: float = 2.0) -> Array:
    a = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    c, s = np.cos(a), np.sin(a)
    r = (np.abs(c) ** power + np.abs(s) ** power) ** (-1 / power)
    return np.column_stack([c * r * width / 2, s * r * depth / 2])


def four_legged(rng: Generator, kind: str) -> Builder:
    """A top on legs, a trestle or slabs; ``kind`` is ``"dining"``, ``"coffee"`` or ``"console"``."""
    build = Builder()
    frame = _frame_paint(rng)
    top_paint = _top_paint(rng, frame)
    if kind == "dining":
        width, depth, h = between(rng, 0.9, 2.4), between(rng, 0.7, 1.1), between(rng, 0.72, 0.78)
        depth = min(depth, width)
    elif kind == "coffee":
        width, depth, h = between(rng, 0.7, 1.4), between(rng, 0.45, 0.8), between(rng, 0.34, 0.5)
        depth = min(depth, width)
    else:
        width, depth, h = between(rng, 0.8, 1.5), between(rng, 0.28, 0.42), between(rng, 0.74, 0.88)
    thick = between(rng, 0.015, 0.05)
    form = pick(rng, ("square", "soft", "oval"), (3, 1, 0.6))
    outline = {
        "square": shapes.rectangle(width, depth, 0.012),
        "soft": _round(width, depth, 4.5),
        "oval": _round(width, depth),
    }[form]
    build.add(top_paint, slab(outline, h - thick, thick, min(0.006, thick * 0.3)))
    leg_h, t = h - thick, between(rng, 0.04, 0.10) * (0.75 if kind != "dining" else 1.0)
    pull = 0.72 if form == "oval" else between(rng, 0.86, 1.0)
    w, d = width * pull - t, depth * (0.7 if form == "oval" else pull) - t
    base = pick(rng, ("legs", "trestle", "slabs", "frames", "cross"), (5, 0.6, 0.7, 1.0, 0.6))
    if base == "legs":
        style = pick(
            rng,
            ("square", "taper", "round", "splayed", "turned", "hairpin", "cabriole"),
            (3, 2.5, 1.2, 1.2, 1.2, 0.8, 0.5),
        )
        four_legs(
            build,
            frame,
            style,
            w * (0.8 if style == "splayed" else 1),
            d * (0.8 if style == "splayed" else 1),
            leg_h,
            t,
        )
        if style not in ("hairpin", "splayed") and chance(rng, 0.85):
            apron = between(rng, 0.05, 0.11)
            y = leg_h - apron / 2
            for s in (1, -1):
                build.add(
                    frame,
                    shapes.box((w, apron, 0.022), (0, y, s * d / 2)),
                    shapes.box((0.022, apron, d), (s * w / 2, y, 0)),
                )
            if kind != "dining" and chance(rng, 0.5):
                drawers(rng, build, frame, w, y, apron, -d / 2 - 0.012)
        if kind != "dining" and chance(rng, 0.45):
            shelf = frame if chance(rng, 0.7) else top_paint
            build.add(shelf, shapes.box((w, 0.02, d), (0, h * between(rng, 0.25, 0.4), 0)))
    elif base == "slabs":
        build.add(frame, shapes.box((t * 0.7, leg_h, d), (w / 2, leg_h / 2, 0)).pair())
        build.add(frame, shapes.box((w, leg_h * 0.25, 0.025), (0, leg_h * 0.8, 0)))
    elif base == "frames":
        path = [(0, 0.012, -d / 2), (0, 0.012, d / 2), (0, leg_h - 0.012, d / 2), (0, leg_h - 0.012, -d / 2)]
        section = shapes.rectangle(t * 0.5, t * 0.5)
        build.add(
            frame, shapes.tube(path, 1.0, section=section, up=(1, 0, 0), closed=True).moved(w / 2).pair()
        )
    elif base == "cross":
        for s in (1, -1):
            build.add(
                frame, shapes.bar((w / 2, 0, s * d / 2), (w / 2, leg_h, -s * d / 2), t * 0.9, t * 0.9).pair()
            )
        build.add(frame, shapes.bar((-w / 2, leg_h / 2, 0), (w / 2, leg_h / 2, 0), t * 0.6, t * 0.8))
    else:
        x = w * 0.38
        build.add(frame, shapes.box((t * 1.1, leg_h, t * 1.4), (x, leg_h / 2, 0)).pair())
        build.add(
            frame,
            shapes.box((t, t * 0.8, d), (x, t * 0.4, 0)).pair(),
            shapes.box((t, t * 0.8, d * 0.9), (x, leg_h - t * 0.4, 0)).pair(),
        )
        build.add(frame, shapes.box((2 * x, t * 1.2, t * 0.5), (0, leg_h * 0.35, 0)))
    return build


def drawers(
    rng: Generator, build: Builder, paint: Paint, width: float, y: float, tall: float, z: float
) -> None:
    """Some drawers in an apron at the front."""
    look = Look(paint, paint, paints.metal(rng), "flat", pick(rng, ("knob", "bar", "cup")), 0.006)
    count = int(rng.integers(1, 4))
    each = width * 0.94 / count
    part = Builder()
    for k in range(count):
        front(part, look, Cell((k - (count - 1) / 2) * each, y - tall / 2, each, tall, "drawer"), 0.2)
    build.include(part, offset=(0.0, 0.0, z))


def pedestal(rng: Generator) -> Builder:
    """A round or oval top on a turned column, a cone, feet or a drum."""
    build = Builder()
    frame = _frame_paint(rng)
    low = chance(rng, 0.3)
    width = between(rng, 0.5, 1.4)
    depth = width if chance(rng, 0.75) else width * between(rng, 0.6, 0.85)
    h = between(rng, 0.38, 0.55) if low else between(rng, 0.70, 0.78)
    if width < 0.75 and chance(rng, 0.2):
        h = between(rng, 1.0, 1.1)
    thick = between(rng, 0.015, 0.045)
    build.add(_top_paint(rng, frame), slab(_round(width, depth), h - thick, thick, thick * 0.35))
    tall, r = h - thick, width * 0.30
    base = pick(rng, ("tulip", "turned", "plate", "cone", "legs"))
    if base == "tulip":
        profile = [
            (r, 0.0),
            (r * 0.95, 0.012),
            (r * 0.3, 0.05),
            (0.035, tall * 0.35),
            (0.03, tall * 0.6),
            (0.10, tall),
        ]
        build.add(frame, shapes.lathe(profile, 28))
    elif base == "plate":
        build.add(frame, shapes.lathe([(r, 0), (r, 0.015), (0.03, 0.03), (0.03, tall)], 28))
    elif base == "cone":
        build.add(
            frame, shapes.lathe([(r, 0), (r * 0.35, tall * between(rng, 0.4, 0.7)), (r * 0.7, tall)], 28)
        )
    elif base == "turned":
        c = between(rng, 0.03, 0.05)
        build.add(
            frame,
            shapes.lathe(
                [
                    (c, 0.10),
                    (c * 1.4, 0.16),
                    (c * 0.7, tall * 0.4),
                    (c * 1.5, tall * 0.6),
                    (c * 0.8, tall * 0.75),
                    (c * 1.6, tall),
                ],
                16,
            ),
        )
        feet = int(rng.integers(3, 5))
        for k in range(feet):
            path = shapes.smooth_path(
                [(0, tall * 0.35, 0), (0, tall * 0.3, -r * 0.5), (0, 0.02, -r * 1.1)], 4
            )
            build.add(
                frame, shapes.tube(path, np.linspace(c, c * 0.6, len(path))).turned("y", 360 * k / feet + 45)
            )
    else:
        count = int(rng.integers(3, 5))
        for k in range(count):
            foot = shapes.tube([(0, tall, -r * 0.8), (0, 0, -r * 1.25)], [0.024, 0.014])
            build.add(frame, foot.turned("y", 360 * k / count + 45))
    return build


def desk(rng: Generator) -> Builder:
    """A top with drawers below at one side or both, a panel behind the knees, shelves on top now and then."""
    build = Builder()
    look = Look.draw(rng)
    width, depth, h = between(rng, 1.0, 1.8), between(rng, 0.5, 0.8), between(rng, 0.72, 0.78)
    thick, board = between(rng, 0.02, 0.04), 0.02
    top = look.body if chance(rng, 0.75) else paints.wood(rng)
    front_z, back_z = -depth / 2, depth / 2
    build.add(top, slab(shapes.rectangle(width, depth, 0.01), h - thick, thick, 0.004))
    tall = h - thick
    sides = pick(rng, ("left", "right", "both", "none"), (1.2, 1.2, 1, 0.8))
    block = between(rng, 0.32, 0.46)
    legs = between(rng, 0.0, 0.12) if chance(rng, 0.5) else 0.0
    frame = look.body if chance(rng, 0.6) else paints.metal(rng)
    for name, sign in (("left", 1.0), ("right", -1.0)):
        x = sign * (width / 2 - block / 2 - 0.01)
        if sides in (name, "both"):
            part = Builder()
            carcass(part, look.body, block, legs, tall, depth - 0.04, board)
            count = int(rng.integers(2, 5))
            step = (tall - legs - 2 * board) / count
            door = chance(rng, 0.2)
            for k in range(count):
                if door and k < count - 1:
                    continue
                front(part, look, Cell(0, legs + board + step * k, block - 2 * board, step, "drawer"), depth)
            if door:
                front(
                    part,
                    look,
                    Cell(0, legs + board, block - 2 * board, step * (count - 1), "door", int(sign)),
                    depth,
                )
            build.include(part, offset=(x, 0.0, front_z + 0.02))
            if legs:
                one = shapes.box((0.04, legs, 0.04), (block / 2 - 0.04, legs / 2, depth / 2 - 0.06))
                build.add(frame, one.pair().moved(x), one.mirrored("z").pair().moved(x))
        elif chance(rng, 0.5):
            build.add(
                look.body, shapes.box((0.03, tall, depth - 0.03), (sign * (width / 2 - 0.02), tall / 2, 0))
            )
        else:
            t = between(rng, 0.035, 0.06)
            for z in (front_z + t, back_z - t):
                build.add(frame, shapes.box((t, tall, t), (sign * (width / 2 - t), tall / 2, z)))
    panel = between(rng, 0.2, tall * 0.95)
    build.add(look.body, shapes.box((width - 0.05, panel, 0.018), (0, tall - panel / 2, back_z - 0.03)))
    if sides == "none" or chance(rng, 0.35):
        inner = (
            width * 0.92 if sides == "none" else max(width - block * (2.2 if sides == "both" else 1.2), 0.3)
        )
        shift = {"left": -block / 2, "right": block / 2}.get(sides, 0.0)
        part = Builder()
        part.add(look.body, shapes.box((inner, 0.11, depth * 0.6), (0, tall - 0.055, depth * 0.35)))
        drawers(rng, part, look.front, inner, tall - 0.055, 0.10, 0.04)
        build.include(part, offset=(shift, 0.0, front_z + 0.01))
    if chance(rng, 0.3):
        hutch(rng, build, look, width, h, back_z)
    return build


def hutch(rng: Generator, build: Builder, look: Look, width: float, h: float, back_z: float) -> None:
    """Shelves or pigeonholes at the back of a desk's top."""
    high, deep = between(rng, 0.2, 0.7), between(rng, 0.18, 0.28)
    part = Builder()
    carcass(part, look.body, width, h, h + high, deep, 0.018)
    for x in np.linspace(-width / 2, width / 2, int(rng.integers(3, 6)))[1:-1]:
        part.add(look.body, shapes.box((0.016, high, deep * 0.97), (float(x), h + high / 2, deep / 2)))
    if high > 0.35:
        part.add(look.body, shapes.box((width, 0.016, deep * 0.97), (0, h + high * 0.55, deep / 2)))
    build.include(part, offset=(0.0, 0.0, back_z - deep))


def table(rng: Generator) -> Mesh:
    """A table or a desk, its longer side along x."""
    kind = pick(rng, ("dining", "coffee", "console", "pedestal", "desk"), (2.6, 1.9, 0.7, 1.3, 2.8))
    if kind == "desk":
        return desk(rng).mesh("table")
    return (pedestal(rng) if kind == "pedestal" else four_legged(rng, kind)).mesh("table")
