"""Carcasses with doors, drawers and shelves, as cabinets, desks, bookcases and kitchens have them.

A case is built with its front at z = 0 and its body behind, at +z; x = 0 is its middle, the floor y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.seating import between, chance, leg, pick
from cadpose.library.parametric.solids import Builder, Paint, Solid

FRONTS = ("flat", "shaker", "inset", "louvre")
HANDLES = ("knob", "bar", "long", "cup", "none")


@dataclass(frozen=True)
class Look:
    """What the fronts of one piece share.

    Attributes:
        body: Of the carcass.
        front: Of doors and drawers.
        metal: Of the handles.
        style: One of `FRONTS`.
        handle: One of `HANDLES`.
        gap: Between two fronts, in metres.
    """

    body: Paint
    front: Paint
    metal: Paint
    style: str
    handle: str
    gap: float

    @classmethod
    def draw(cls, rng: Generator, lacquer: float = 0.4) -> Look:
        """Wood or lacquer, the fronts mostly of the body's colour."""
        body = paints.painted(rng) if chance(rng, lacquer) else paints.wood(rng)
        front = body
        if chance(rng, 0.3):
            front = paints.painted(rng) if chance(rng, 0.6) else paints.wood(rng)
        metal = paints.metal(rng) if chance(rng, 0.8) else paints.darker(front, 0.5)
        style = pick(rng, FRONTS, (2.2, 1.3, 1.0, 0.25))
        return cls(
            body,
            front,
            metal,
            style,
            pick(rng, HANDLES, (1.6, 1.4, 0.8, 0.6, 0.5)),
            between(rng, 0.003, 0.010),
        )


@dataclass(frozen=True)
class Cell:
    """An opening in the front: its middle, its lower edge, its size in metres, and what fills it.

    ``kind`` is ``"door"``, ``"drawer"``, ``"glass"`` (a glazed door), ``"mirror"`` or ``"open"``. A door is
    hinged at its smaller x where ``hinge`` is -1, else at the other side.
    """

    x: float
    y: float
    width: float
    height: float
    kind: str
    hinge: int = 1


def carcass(
    build: Builder, paint: Paint, width: float, low: float, high: float, depth: float, board: float
) -> None:
    """Sides, top, bottom and back of a case whose front edge lies at z = 0."""
    tall = high - low
    side = shapes.box((board, tall, depth), (width / 2 - board / 2, (low + high) / 2, depth / 2))
    build.add(paint, side.pair())
    for y in (low + board / 2, high - board / 2):
        build.add(paint, shapes.box((width - 2 * board, board, depth), (0, y, depth / 2)))
    build.add(
        paints.darker(paint, 0.85),
        shapes.box((width - board, tall - board, 0.008), (0, (low + high) / 2, depth - 0.006)),
    )


def front(build: Builder, look: Look, cell: Cell, depth: float) -> None:
    """The door or drawer of a cell with its handle; an open cell stays open."""
    if cell.kind == "open":
        return
    w, h = cell.width - 2 * look.gap, cell.height - 2 * look.gap
    middle = (cell.x, cell.y + cell.height / 2, -0.008)
    if cell.kind in ("glass", "mirror"):
        frame_front(build, look.front, w, h, middle, 0.05)
        pane = (
            paints.plain((0.80, 0.85, 0.86), "glass", 0.3)
            if cell.kind == "glass"
            else paints.plain((0.80, 0.84, 0.86), "mirror")
        )
        build.add(pane, shapes.box((w - 0.09, h - 0.09, 0.005), middle))
        if cell.kind == "glass":
            for y in np.linspace(cell.y, cell.y + cell.height, 4)[1:-1]:
                build.add(
                    look.body, shapes.box((cell.width, 0.015, depth * 0.85), (cell.x, float(y), depth * 0.52))
                )
    elif look.style == "flat" or min(w, h) < 0.14:
        build.add(look.front, shapes.rounded_box((w, h, 0.02), middle, 0.003))
    else:
        rim = min(0.06, min(w, h) * 0.22)
        build.add(look.front, shapes.box((w, h, 0.014), (middle[0], middle[1], 0.0)))
        frame_front(build, look.front, w, h, middle, rim)
        if look.style == "inset":
            build.add(
                look.front,
                shapes.rounded_box(
                    (w - 2.9 * rim, h - 2.9 * rim, 0.02), (middle[0], middle[1], -0.003), 0.006
                ),
            )
        elif look.style == "louvre" and cell.kind == "door":
            for y in np.arange(middle[1] - h / 2 + rim + 0.02, middle[1] + h / 2 - rim, 0.04):
                slat = (
                    shapes.box((w - 2 * rim, 0.03, 0.006)).turned("x", 25).moved(middle[0], float(y), -0.008)
                )
                build.add(look.front, slat)
    handle(build, look, cell, w, h)


def frame_front(
    build: Builder, paint: Paint, w: float, h: float, middle: tuple[float, float, float], rim: float
) -> None:
    """Stiles and rails around a panel or a pane."""
    x, y, z = middle
    for s in (1, -1):
        build.add(paint, shapes.box((rim, h, 0.02), (x + s * (w - rim) / 2, y, z)))
        build.add(paint, shapes.box((w - 2 * rim, rim, 0.02), (x, y + s * (h - rim) / 2, z)))


def handle(build: Builder, look: Look, cell: Cell, w: float, h: float) -> None:
    """Knobs, bars or shells: in the middle of a drawer, at the free edge of a door."""
    if look.handle == "none":
        return
    z = -0.018
    if cell.kind == "drawer":
        spots = [cell.x] if w < 0.62 else [cell.x - w * 0.28, cell.x + w * 0.28]
        if look.handle == "long":
            spots = [cell.x]
        y = cell.y + cell.height * (0.5 if h < 0.3 else 0.72)
        for x in spots:
            build.add(
                look.metal,
                _grip(look.handle, min(w * 0.6, 0.16) if look.handle != "long" else w * 0.55).moved(x, y, z),
            )
        return
    x = cell.x - cell.hinge * (w / 2 - 0.035)
    y = cell.y + cell.height * (0.5 if h > 1.0 else 0.6)
    length = min(h * 0.4, 0.2 if look.handle != "long" else 0.5)
    grip = _grip("bar" if look.handle in ("cup", "long") else look.handle, length)
    build.add(look.metal, grip.turned("z", 90).moved(x, y, z))


def _grip(kind: str, length: float) -> Solid:
    """A handle along x that stands out from z = 0 to the front."""
    if kind == "knob":
        profile = [(0.007, 0), (0.006, 0.012), (0.016, 0.02), (0.014, 0.03), (0.002, 0.034)]
        return shapes.lathe(profile, 10).turned("x", -90)
    if kind == "cup":
        return shapes.ellipsoid((0.045, 0.02, 0.025), sides=12)
    half = length / 2
    path = [(-half, 0, 0), (-half, 0, -0.03), (half, 0, -0.03), (half, 0, 0)]
    return shapes.tube(path, 0.006, sides=6)


def stand(rng: Generator, build: Builder, paint: Paint, width: float, depth: float, height: float) -> None:
    """What a case stands on, below z from 0 to depth: a plinth, legs or bracket feet."""
    if height < 0.03:
        return
    style = "plinth" if height < 0.07 else pick(rng, ("legs", "legs", "frame", "plinth"))
    if style == "plinth":
        build.add(
            paints.darker(paint, 0.75),
            shapes.box((width - 0.03, height, depth - 0.05), (0, height / 2, depth / 2 + 0.015)),
        )
        return
    other = paint if chance(rng, 0.6) else paints.metal(rng)
    thick = between(rng, 0.03, 0.05)
    kind = pick(rng, ("square", "taper", "round", "turned", "splayed"))
    if style == "frame":
        kind = "square"
        for z in (thick, depth - thick):
            build.add(other, shapes.box((width - thick, thick * 0.8, thick * 0.8), (0, thick * 0.5, z)))
    one = leg(kind, height + 0.01, thick)
    x, z = width / 2 - thick * 1.2, depth / 2 - thick * 1.2
    for sx in (1.0, -1.0):
        for sz in (1.0, -1.0):
            build.add(other, one.scaled(sx, 1, sz).moved(sx * x, 0, depth / 2 - sz * z))


def books(
    rng: Generator,
    build: Builder,
    covers: list[Paint],
    x0: float,
    x1: float,
    y: float,
    height: float,
    depth: float,
) -> None:
    """A row of books on a shelf from x0 to x1, some lying, with gaps."""
    x = x0 + between(rng, 0.0, 0.03)
    end = x1 - between(rng, 0.0, 0.4) * (x1 - x0)
    while x < end - 0.05:
        if chance(rng, 0.06):
            x += between(rng, 0.03, 0.12)
            continue
        paint = covers[int(rng.integers(len(covers)))]
        if chance(rng, 0.05) and end - x > 0.26:
            at, level = x + 0.12, y
            for _ in range(int(rng.integers(2, 5))):
                thick = between(rng, 0.02, 0.045)
                build.add(
                    covers[int(rng.integers(len(covers)))],
                    shapes.box((between(rng, 0.18, 0.24), thick, 0.16), (at, level + thick / 2, 0.11)),
                )
                level += thick
            x += 0.25
            continue
        thick = between(rng, 0.018, 0.055)
        tall = min(between(rng, 0.16, 0.29), height * 0.93)
        deep = min(between(rng, 0.13, 0.2), depth - 0.02)
        build.add(
            paint, shapes.box((thick * 0.95, tall, deep), (x + thick / 2, y + tall / 2, deep / 2 + 0.03))
        )
        x += thick


def ornament(rng: Generator, build: Builder, x: float, y: float, room: float) -> None:
    """A vase, a box or a ball on a shelf."""
    paint = paints.plastic(rng) if chance(rng, 0.6) else paints.wood(rng)
    kind = pick(rng, ("vase", "box", "ball"))
    size = min(room * 0.8, between(rng, 0.1, 0.26))
    if kind == "vase":
        r = size * 0.3
        profile = [
            (r * 0.5, 0),
            (r, size * 0.35),
            (r * 0.85, size * 0.6),
            (r * 0.35, size * 0.8),
            (r * 0.5, size),
        ]
        build.add(paint, shapes.lathe(profile, 14, (x, y, 0.14)))
    elif kind == "box":
        build.add(paint, shapes.rounded_box((size, size * 0.7, 0.2), (x, y + size * 0.35, 0.14), 0.006))
    else:
        build.add(paint, shapes.ellipsoid((size * 0.4,) * 3, (x, y + size * 0.4, 0.14), 14))
