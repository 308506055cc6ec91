"""Cabinets: wardrobes, chests of drawers, sideboards, nightstands, filing and display cabinets."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.casework import Cell, Look, books, carcass, front, ornament, stand
from cadpose.library.parametric.seating import between, chance, pick
from cadpose.library.parametric.solids import Builder

# Widths, heights and depths in metres; how tall what it stands on may be.
_SIZES = {
    "chest": ((0.6, 1.3), (0.7, 1.3), (0.40, 0.52), (0.0, 0.18)),
    "sideboard": ((1.2, 2.1), (0.6, 0.95), (0.38, 0.50), (0.0, 0.25)),
    "nightstand": ((0.36, 0.58), (0.45, 0.68), (0.32, 0.44), (0.0, 0.22)),
    "wardrobe": ((0.8, 2.4), (1.7, 2.3), (0.5, 0.64), (0.0, 0.12)),
    "tv": ((1.1, 2.0), (0.38, 0.6), (0.36, 0.48), (0.0, 0.18)),
    "filing": ((0.40, 0.9), (0.6, 1.35), (0.45, 0.62), (0.0, 0.05)),
    "display": ((0.7, 1.5), (1.4, 2.1), (0.34, 0.45), (0.0, 0.14)),
    "cupboard": ((0.6, 1.2), (0.8, 1.5), (0.35, 0.48), (0.0, 0.2)),
}

# About how wide a column is.
_COLUMN = {"chest": 0.9, "nightstand": 9.0, "tv": 0.55, "filing": 0.9, "display": 0.45}


def _column(
    rng: Generator, kind: str, x: float, width: float, low: float, high: float, hinge: int
) -> list[Cell]:
    """The cells of one column, from below."""
    tall = high - low

    def stack(count: int, what: str, bottom: float, top: float, falling: bool = False) -> list[Cell]:
        share = np.linspace(1.4, 1.0, count) if falling else np.ones(count)
        edge = bottom + (top - bottom) * np.concatenate([np.zeros(1), np.cumsum(share)]) / share.sum()
        return [Cell(x, float(a), width, float(b - a), what, hinge) for a, b in pairwise(edge)]

    if kind in ("chest", "filing"):
        return stack(max(2, round(tall / between(rng, 0.18, 0.28))), "drawer", low, high, kind == "chest")
    if kind == "nightstand":
        form = pick(rng, ("drawers", "shelf", "door"))
        if form == "drawers":
            return stack(int(rng.integers(2, 4)), "drawer", low, high)
        split = high - tall * between(rng, 0.28, 0.4)
        return [
            Cell(x, low, width, split - low, "open" if form == "shelf" else "door", hinge),
            Cell(x, split, width, high - split, "drawer"),
        ]
    if kind == "wardrobe":
        door = "mirror" if chance(rng, 0.15) else "door"
        if chance(rng, 0.35):
            split = low + between(rng, 0.25, 0.5)
            return [
                *stack(int(rng.integers(1, 3)), "drawer", low, split),
                Cell(x, split, width, high - split, door, hinge),
            ]
        return [Cell(x, low, width, tall, door, hinge)]
    if kind == "display":
        split = low + tall * between(rng, 0.2, 0.45)
        below = (
            stack(int(rng.integers(1, 4)), "drawer", low, split)
            if chance(rng, 0.4)
            else [Cell(x, low, width, split - low, "door", hinge)]
        )
        return [*below, Cell(x, split, width, high - split, "glass", hinge)]
    form = pick(rng, ("door", "drawers", "both", "open"), (2, 1.4, 1.2, 0.6 if kind == "tv" else 0.3))
    if form == "drawers":
        return stack(max(1, round(tall / 0.2)), "drawer", low, high)
    if form == "both":
        split = high - min(0.2, tall * 0.35)
        return [
            Cell(x, low, width, split - low, "door", hinge),
            Cell(x, split, width, high - split, "drawer"),
        ]
    if form == "open":
        return stack(max(1, round(tall / 0.3)), "open", low, high)
    return [Cell(x, low, width, tall, "door", hinge)]


def case(rng: Generator, kind: str) -> Builder:
    """A cabinet of a kind of `_SIZES`; doors and drawers face the front."""
    build = Builder()
    (width, high, depth, legs) = (between(rng, *span) for span in _SIZES[kind])
    look = Look.draw(rng, 0.6 if kind in ("filing", "wardrobe") else 0.4)
    board = between(rng, 0.016, 0.035)
    carcass(build, look.body, width, legs, high, depth, board)
    per = _COLUMN.get(kind, 0.5)
    columns = max(1, round(width / per * between(rng, 0.85, 1.15)))
    each = (width - 2 * board) / columns
    alike = chance(rng, 0.45) or kind == "wardrobe"
    kept: list[Cell] = []
    for k in range(columns):
        x = -width / 2 + board + each * (k + 0.5)
        # Doors open away from each other: the handles of a pair meet.
        hinge = -1 if k % 2 == 0 else 1
        if alike and kept:
            cells = [Cell(x, c.y, c.width, c.height, c.kind, hinge) for c in kept]
        else:
            cells = kept = _column(rng, kind, x, each, legs + board, high - board, hinge)
        for cell in cells:
            front(build, look, cell, depth)
            if cell.y > legs + board + 0.01:
                build.add(look.body, shapes.box((each, board, depth * 0.9), (x, cell.y, depth * 0.5)))
            if cell.kind == "open" and chance(rng, 0.7):
                covers = [paints.plastic(rng) for _ in range(4)]
                if chance(rng, 0.5):
                    books(
                        rng,
                        build,
                        covers,
                        x - each / 2 + board,
                        x + each / 2 - board,
                        cell.y + board / 2,
                        cell.height - board,
                        depth,
                    )
                else:
                    ornament(rng, build, x, cell.y + board / 2, min(cell.height, each) - 0.04)
        if k:
            build.add(
                look.body,
                shapes.box(
                    (board * 0.7, high - legs, depth * 0.97), (x - each / 2, (high + legs) / 2, depth * 0.5)
                ),
            )
    if chance(rng, 0.6):
        over = between(rng, 0.0, 0.03)
        top = paints.darker(look.body, 0.9) if chance(rng, 0.3) else look.body
        slab = shapes.rounded_box(
            (width + 2 * over, 0.03, depth + over + 0.02),
            (0, high + 0.014, depth / 2 - over / 2 - 0.01),
            0.006,
        )
        build.add(top, slab)
    stand(rng, build, look.body, width, depth, legs)
    if kind == "sideboard" and chance(rng, 0.2):
        ornament(rng, build, between(rng, -0.3, 0.3) * width, high + 0.03, 0.4)
    return build


def cabinet(rng: Generator) -> Mesh:
    """A cabinet; its doors and drawers are at -z."""
    kind = pick(rng, tuple(_SIZES), (2.0, 1.8, 1.4, 2.0, 0.9, 0.7, 0.9, 0.9))
    return case(rng, kind).mesh("cabinet")
