"""Screens, refrigerators and toilets."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from cadpose.library.mesh import Material, Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.seating import between, chance, pick, slab
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid


def _picture(rng: Generator) -> NDArray[np.uint8]:
    """(36, 64, 3) something on a screen: a sky over hills, or windows on a desktop."""
    image = np.zeros((36, 64, 3))
    if chance(rng, 0.6):
        top, low = rng.uniform(60, 230, 3), rng.uniform(60, 230, 3)
        image[:] = top + (low - top) * np.linspace(0, 1, 36)[:, None, None]
        for _ in range(int(rng.integers(1, 4))):
            column = np.arange(64)
            line = 36 * (
                rng.uniform(0.4, 0.8) + 0.12 * np.sin(column * rng.uniform(0.05, 0.2) + rng.uniform(0, 6))
            )
            image[np.arange(36)[:, None] > line[None]] = rng.uniform(20, 200, 3)
    else:
        image[:] = rng.uniform(30, 200, 3)
        for _ in range(int(rng.integers(1, 4))):
            y, x = int(rng.integers(1, 16)), int(rng.integers(1, 30))
            h, w = int(rng.integers(10, 20)), int(rng.integers(16, 34))
            image[y : y + h, x : x + w] = rng.uniform(200, 255)
            image[y : y + 3, x : x + w] = rng.uniform(20, 160, 3)
            image[y + 5 : y + h - 2 : 3, x + 2 : x + w - 4] = rng.uniform(90, 180)
    return np.clip(image, 0, 255).astype(np.uint8)


def _screen(rng: Generator, width: float, height: float) -> tuple[Paint, Solid]:
    """The glass, off and black or showing a picture, square to z; its face looks to -z."""
    glass = shapes.box((width, height, 0.004))
    if chance(rng, 0.5):
        tone = between(rng, 0.03, 0.10)
        return paints.plain((tone, tone, tone * 1.1), "screen"), glass
    # One repeat over the width; the height is cut to it by stretching the solid, not the picture.
    paint = Paint(Material(texture=_picture(rng), name="screen"), tile=1.0)
    unit = shapes.box((1.0, 1.0, 0.01), (0.5, 0.5, 0.0))
    placed = unit.transformed(np.diag([-width, height, 0.4]), (width / 2, -height / 2, 0.0))
    return paint, placed


def flat_screen(rng: Generator) -> Builder:
    """A television or a monitor: a frame, a back, and a foot, two feet or none."""
    build = Builder()
    monitor = chance(rng, 0.4)
    width = between(rng, 0.42, 0.72) if monitor else between(rng, 0.7, 1.5)
    height = width * pick_ratio(rng, monitor)
    body = paints.plain((between(rng, 0.04, 0.14),) * 3, "case") if chance(rng, 0.75) else paints.plastic(rng)
    metal = body if chance(rng, 0.5) else paints.metal(rng)
    rim, thick = between(rng, 0.006, 0.03), between(rng, 0.015, 0.06)
    chin = rim + (between(rng, 0.0, 0.05) if chance(rng, 0.4) else 0.0)
    foot = between(rng, 0.05, 0.10) if not monitor else between(rng, 0.09, 0.18)
    build.add(body, shapes.rounded_box((width, height, thick), (0, foot + height / 2, 0), 0.006))
    if thick > 0.03 or monitor:
        hump = (width * between(rng, 0.4, 0.8), height * between(rng, 0.4, 0.7), between(rng, 0.02, 0.06))
        build.add(
            body, shapes.rounded_box(hump, (0, foot + height * 0.45, thick / 2 + hump[2] / 2 - 0.005), 0.015)
        )
    paint, glass = _screen(rng, width - 2 * rim, height - rim - chin)
    build.add(paint, glass.moved(0, foot + height / 2 + (chin - rim) / 2, -thick / 2 - 0.001))
    if chin > rim + 0.01:
        mark = shapes.box((width * 0.06, 0.008, 0.003), (0, foot + chin / 2, -thick / 2 - 0.001))
        build.add(paints.plain((0.7, 0.7, 0.7)), mark)
    base = pick(
        rng,
        ("plate", "oval", "feet", "vee", "wall"),
        (2, 2, 0.6 if monitor else 2, 0.8, 0.1 if monitor else 0.6),
    )
    deep = between(rng, 0.16, 0.26)
    if base in ("plate", "oval"):
        wide = width * between(rng, 0.28, 0.5)
        neck = shapes.rounded_box(
            (width * between(rng, 0.06, 0.16), foot + height * 0.3, 0.02),
            (0, (foot + height * 0.3) / 2, thick / 2 + 0.012),
            0.006,
        )
        a = np.linspace(0, 2 * np.pi, 28, endpoint=False)
        outline = np.column_stack([np.cos(a) * wide / 2, np.sin(a) * deep / 2])
        build.add(
            metal,
            neck,
            slab(outline if base == "oval" else shapes.rectangle(wide, deep, 0.02), 0.0, 0.012, 0.004),
        )
    elif base in ("feet", "vee"):
        x = width * (0.36 if base == "feet" else 0.05)
        spread = 0.02 if base == "feet" else width * 0.18
        for z in (-deep / 2, deep / 2):
            build.add(
                metal, shapes.tube([(x, foot + 0.01, 0), (x + spread, 0.006, z)], 0.007, sides=7).pair()
            )
    return build


def pick_ratio(rng: Generator, monitor: bool) -> float:
    """Height over width."""
    return float(rng.choice([0.5625, 0.625, 0.75, 0.43], p=[0.55, 0.25, 0.1, 0.1])) if monitor else 0.58


def tube_set(rng: Generator) -> Builder:
    """A television with a picture tube, deep and round at the back."""
    build = Builder()
    body = paints.plastic(rng) if chance(rng, 0.6) else paints.wood(rng)
    w, h = between(rng, 0.45, 0.8), between(rng, 0.38, 0.6)
    d = between(rng, 0.10, 0.18)
    build.add(body, shapes.rounded_box((w, h, d), (0, h / 2, 0), 0.015, 2))
    sections = []
    for share, z in ((0.92, 0.0), (0.88, 0.08), (0.6, 0.22), (0.45, 0.28)):
        flat = shapes.rectangle(w * share, h * share, 0.04, 3)
        sections.append(
            np.column_stack([flat[:, 0], flat[:, 1] + h * 0.48, np.full(len(flat), d / 2 - 0.01 + z)])
        )
    build.add(paints.darker(body, 0.75), shapes.loft(sections))
    side = chance(rng, 0.5)
    sw, sh = w * (0.68 if side else 0.86), h * (0.8 if side else 0.72)
    paint, glass = _screen(rng, sw, sh)
    shift = w * 0.11 if side else 0.0
    build.add(paint, glass.moved(shift, h * (0.5 if side else 0.56), -d / 2 - 0.003))
    dark = paints.plain((0.12, 0.12, 0.12))
    if side:
        for k, y in enumerate((0.8, 0.62)):
            knob = shapes.cylinder(0.028 - 0.004 * k, 0.03, sides=14).turned("x", -90)
            build.add(dark, knob.moved(-w * 0.39, h * y, -d / 2))
        build.add(dark, shapes.box((w * 0.14, h * 0.3, 0.004), (-w * 0.39, h * 0.28, -d / 2 - 0.001)))
    else:
        for k in range(4):
            build.add(dark, shapes.box((0.03, 0.012, 0.008), (-w * 0.3 + 0.05 * k, h * 0.1, -d / 2 - 0.002)))
    return build


def tv(rng: Generator) -> Mesh:
    """A television or a monitor; the screen is at -z."""
    return (tube_set(rng) if chance(rng, 0.15) else flat_screen(rng)).mesh("tv")


def fridge(rng: Generator) -> Mesh:
    """A refrigerator; doors and handles are at -z."""
    build = Builder()
    kind = pick(rng, ("two", "single", "side", "french", "retro"), (2.2, 1, 1.2, 1, 0.8))
    tone = rng.random()
    body = (
        paints.plain((between(rng, 0.88, 0.96),) * 3, "enamel")
        if tone < 0.4
        else paints.plain((between(rng, 0.55, 0.75),) * 3, "steel")
        if tone < 0.8
        else paints.painted(rng)
    )
    if kind == "retro":
        body = paints.painted(rng)
    w = between(rng, 0.85, 0.95) if kind in ("side", "french") else between(rng, 0.5, 0.72)
    h = (
        between(rng, 0.8, 1.6)
        if kind == "single"
        else between(rng, 1.4, 2.0)
        if kind != "retro"
        else between(rng, 1.2, 1.6)
    )
    d, foot = between(rng, 0.52, 0.68), 0.04
    radius = between(rng, 0.05, 0.09) if kind == "retro" else 0.01
    build.add(
        paints.darker(body, 0.93), shapes.rounded_box((w, h - foot, d), (0, (h + foot) / 2, 0), radius, 2)
    )
    build.add(paints.plain((0.08, 0.08, 0.08)), shapes.box((w * 0.94, 0.06, d * 0.9), (0, 0.03, 0.01)))
    low, tall, gap = foot + 0.02, h - foot - 0.03, 0.006
    split = low + tall * (between(rng, 0.28, 0.4) if chance(rng, 0.6) else between(rng, 0.62, 0.75))
    # Doors as (x, y, width, height, side of the hinge: -1 at smaller x, 0 a drawer).
    hinge = -1 if chance(rng, 0.5) else 1
    doors: list[tuple[float, float, float, float, int]]
    if kind in ("single", "retro") and (kind == "single" or chance(rng, 0.5)):
        doors = [(0.0, low, w, tall, hinge)]
    elif kind in ("two", "retro"):
        doors = [(0.0, low, w, split - low, hinge), (0.0, split, w, low + tall - split, hinge)]
    elif kind == "side":
        left = w * between(rng, 0.4, 0.5)
        doors = [(w / 2 - left / 2, low, left, tall, 1), (-w / 2 + (w - left) / 2, low, w - left, tall, -1)]
    else:
        up = low + tall * between(rng, 0.35, 0.45)
        doors = [(w / 4, up, w / 2, low + tall - up, 1), (-w / 4, up, w / 2, low + tall - up, -1)]
        rows = int(rng.integers(1, 3))
        step = (up - low) / rows
        doors += [(0.0, low + step * k, w, step, 0) for k in range(rows)]
    thick = between(rng, 0.04, 0.07)
    grip = paints.metal(rng) if chance(rng, 0.7) else paints.plain((0.1, 0.1, 0.1))
    z = -d / 2 - thick / 2 + 0.002
    for x, y, dw, dh, side in doors:
        edge = min(radius, 0.03) if kind != "retro" else 0.03
        door = shapes.rounded_box((dw - gap, dh - gap, thick), (x, y + dh / 2, z), max(edge, 0.008), 2)
        build.add(body, door)
        out = z - thick / 2
        if side == 0:
            build.add(grip, _handle((x - dw * 0.35, y + dh * 0.85, out), (x + dw * 0.35, y + dh * 0.85, out)))
            continue
        at = x - side * (dw / 2 - 0.045)
        if kind == "retro":
            build.add(
                grip,
                shapes.rounded_box(
                    (dw * 0.3, 0.03, 0.035), (at + side * dw * 0.08, y + dh * 0.72, out - 0.02), 0.012
                ),
            )
        else:
            middle, length = y + dh * 0.5, min(dh * between(rng, 0.35, 0.7), 0.9)
            build.add(grip, _handle((at, middle - length / 2, out), (at, middle + length / 2, out)))
    if kind in ("side", "french") and chance(rng, 0.6):
        x, y, dw, dh, _ = doors[0]
        spout = shapes.rounded_box(
            (dw * 0.45, 0.32, 0.012), (x, y + dh * (0.62 if kind == "side" else 0.5), z - thick / 2), 0.005
        )
        build.add(paints.plain((0.08, 0.08, 0.09)), spout)
    elif chance(rng, 0.3):
        for _ in range(int(rng.integers(2, 7))):
            note = (between(rng, -0.3, 0.3) * w, between(rng, 0.55, 0.85) * h, z - thick / 2)
            build.add(
                paints.plastic(rng),
                shapes.box((between(rng, 0.03, 0.1), between(rng, 0.03, 0.12), 0.006), note),
            )
    return build.mesh("fridge")


def _handle(start: tuple[float, float, float], end: tuple[float, float, float]) -> Solid:
    """A bar on two feet that stands out to the front."""
    a, b = np.array(start), np.array(end)
    out = np.array([0.0, 0.0, -0.045])
    return shapes.tube([a, a + out, b + out, b], 0.011, sides=8)


def _egg(width: float, front: float, back: float, count: int = 28) -> Array:
    """(count, 2) outline (x, forward) of a bowl: long to the front, flat behind."""
    a = np.linspace(0, 2 * np.pi, count, endpoint=False)
    forward = np.where(np.sin(a) > 0, front * np.sin(a), back * np.sign(np.sin(a)) * np.abs(np.sin(a)) ** 0.6)
    return np.column_stack([np.cos(a) * width / 2, forward])


def toilet(rng: Generator) -> Mesh:
    """A toilet: bowl, seat, lid and cistern; its front is at -z."""
    build = Builder()
    white = (
        paints.plain((between(rng, 0.88, 0.97),) * 3, "ceramic") if chance(rng, 0.94) else paints.painted(rng)
    )
    lid_paint = white if chance(rng, 0.6) else paints.wood(rng) if chance(rng, 0.6) else paints.plastic(rng)
    w, front, back, h = (
        between(rng, 0.34, 0.39),
        between(rng, 0.28, 0.36),
        between(rng, 0.14, 0.2),
        between(rng, 0.37, 0.43),
    )
    hung = chance(rng, 0.2)
    rim = _egg(w, front, back)
    shares = ((0.45, 0.55, 0.10), (0.6, 0.68, 0.2), (0.85, 0.88, 0.6), (0.99, 1.0, 0.9), (1.0, 1.0, 1.0))
    straight = chance(rng, 0.4)
    rows = []
    for sx, sz, y in ((0.8, 0.75, 0.0), *shares[2:]) if straight else ((0.62, 0.62, 0.0), *shares):
        level = h * (0.35 + 0.65 * y) if hung else h * y
        flat = rim * (sx, sz)
        rows.append(np.column_stack([flat[:, 0], np.full(len(flat), level), -flat[:, 1]]))
    build.add(white, shapes.loft(rows))
    if not hung:
        foot = (w * between(rng, 0.5, 0.62), h * 0.96, back * 2.0)
        build.add(white, shapes.rounded_box(foot, (0, h * 0.48, back * 0.9), 0.03))
    ring = _egg(w * 1.03, front * 1.03, back * 0.9)
    raised = chance(rng, 0.35)
    build.add(lid_paint, slab(ring, h, 0.018, 0.007))
    lid = slab(_egg(w * 1.02, front * 1.02, back * 0.9), 0.0, 0.02, 0.008, 0.008)
    if raised:
        # The opening is dark when one looks in.
        build.add(
            paints.darker(white, 0.55),
            slab(_egg(w * 0.66, front * 0.72, back * 0.6), h + 0.017, 0.003, 0.001),
        )
        build.add(lid_paint, lid.moved(z=-back * 0.8).turned("x", 90).moved(0, h + 0.03, back * 0.9))
    else:
        build.add(lid_paint, lid.moved(0, h + 0.02, 0))
    if not hung or chance(rng, 0.3):
        cw, ch, cd = between(rng, 0.34, 0.46), between(rng, 0.30, 0.42), between(rng, 0.15, 0.2)
        z = back + cd / 2 + 0.02
        if chance(rng, 0.9):
            build.add(white, shapes.rounded_box((cw, ch, cd), (0, h + ch / 2 - 0.03, z), 0.03, 2))
            build.add(white, shapes.rounded_box((cw + 0.02, 0.035, cd + 0.02), (0, h + ch - 0.03, z), 0.012))
            build.add(
                paints.metal(rng),
                shapes.cylinder(0.02, 0.012, (0, h + ch - 0.015, z), 14)
                if chance(rng, 0.6)
                else shapes.rounded_box(
                    (0.07, 0.02, 0.03), (cw * 0.33, h + ch * 0.75, z - cd / 2 - 0.01), 0.006
                ),
            )
            build.add(
                white,
                shapes.rounded_box((w * 0.8, h * 0.35, cd + back * 0.7), (0, h * 0.82, z - back * 0.3), 0.03),
            )
        else:
            top = between(rng, 1.5, 1.9)
            build.add(white, shapes.rounded_box((cw, 0.3, cd), (0, top, z), 0.03, 2))
            build.add(paints.metal(rng), shapes.cylinder(0.02, top - h, (0, h * 0.9, z), 12))
            build.add(
                white,
                shapes.rounded_box((w * 0.6, h * 0.3, cd + back * 0.5), (0, h * 0.8, z - back * 0.3), 0.03),
            )
    else:
        build.add(white, shapes.rounded_box((w * 0.9, h * 0.5, 0.12), (0, h * 0.74, back + 0.02), 0.03))
    return build.mesh("toilet")
