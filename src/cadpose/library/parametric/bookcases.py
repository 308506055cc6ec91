"""Bookcases and shelves with what stands on them."""

from __future__ import annotations

from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.casework import Cell, Look, books, carcass, front, ornament, stand
from cadpose.library.parametric.seating import between, chance, pick
from cadpose.library.parametric.solids import Builder, Paint


def _fill(
    rng: Generator,
    build: Builder,
    covers: list[Paint],
    x0: float,
    x1: float,
    y: float,
    room: float,
    depth: float,
    full: float,
) -> None:
    if chance(rng, full):
        books(rng, build, covers, x0, x1, y, room, depth)
    elif chance(rng, 0.45):
        ornament(rng, build, between(rng, 0.3, 0.7) * (x1 - x0) + x0, y, min(room, x1 - x0) - 0.03)


def closed(rng: Generator, cubes: bool) -> Builder:
    """A case with shelves, in columns or in equal cubes, doors below now and then."""
    build = Builder()
    look = Look.draw(rng)
    board, depth = between(rng, 0.016, 0.04), between(rng, 0.24, 0.38)
    if cubes:
        side = between(rng, 0.33, 0.40)
        columns, rows = int(rng.integers(1, 5)), int(rng.integers(2, 6))
        width, high, legs = columns * side + board, rows * side + board, 0.0
    else:
        width, high = between(rng, 0.5, 1.6), between(rng, 1.0, 2.2)
        legs = between(rng, 0.0, 0.12)
        columns = max(1, round(width / between(rng, 0.6, 0.95)))
        rows = max(2, round((high - legs) / between(rng, 0.28, 0.42)))
    carcass(build, look.body, width, legs, high, depth, board)
    covers = [paints.plastic(rng) for _ in range(5)] + [paints.leather(rng) for _ in range(4)]
    full = between(rng, 0.35, 0.97)
    doors = 0 if cubes or chance(rng, 0.65) else int(rng.integers(1, max(2, rows // 2)))
    each, step = (width - board) / columns, (high - legs - board) / rows
    for k in range(columns):
        x = -width / 2 + board / 2 + each * (k + 0.5)
        if k:
            build.add(
                look.body,
                shapes.box(
                    (board, high - legs - board, depth * 0.98), (x - each / 2, (high + legs) / 2, depth / 2)
                ),
            )
        for row in range(rows):
            y = legs + board / 2 + step * row
            if row:
                build.add(look.body, shapes.box((each, board, depth * 0.98), (x, y, depth / 2)))
            if row < doors:
                continue
            if cubes and chance(rng, 0.2):
                front(build, look, Cell(x, y, each, step, "door" if chance(rng, 0.6) else "drawer"), depth)
                continue
            _fill(
                rng,
                build,
                covers,
                x - each / 2 + board / 2,
                x + each / 2 - board / 2,
                y + board / 2,
                step - board,
                depth,
                full,
            )
        if doors:
            front(
                build,
                look,
                Cell(x, legs + board / 2, each, step * doors, "door", -1 if k % 2 == 0 else 1),
                depth,
            )
    if not cubes:
        stand(rng, build, look.body, width, depth, legs)
        if chance(rng, 0.35):
            crown = between(rng, 0.02, 0.05)
            build.add(
                look.body,
                shapes.rounded_box(
                    (width + crown, 0.04, depth + crown), (0, high + 0.018, depth / 2 - crown / 4), 0.008
                ),
            )
    return build


def open_rack(rng: Generator) -> Builder:
    """Shelves between posts or ladders, open to all sides; the back, where it leans, is at +z."""
    build = Builder()
    frame = paints.metal(rng) if chance(rng, 0.6) else paints.wood(rng)
    wood = paints.wood(rng) if chance(rng, 0.8) else paints.painted(rng)
    width, high, depth = between(rng, 0.55, 1.2), between(rng, 1.3, 2.0), between(rng, 0.28, 0.42)
    rows, t = int(rng.integers(4, 7)), between(rng, 0.018, 0.035)
    leaning = chance(rng, 0.3)
    covers = [paints.plastic(rng) for _ in range(5)] + [paints.leather(rng) for _ in range(3)]
    full = between(rng, 0.3, 0.8)
    reach = depth * (1.3 if leaning else 1.0)
    x = width / 2
    for z in (0.0, reach):
        if leaning and z == 0.0:
            build.add(frame, shapes.bar((x, 0, -0.05), (x, high, reach - 0.06), t, t).pair())
        else:
            build.add(frame, shapes.bar((x, 0, z), (x, high, z), t, t).pair())
    for row in range(rows):
        share = row / (rows - 1)
        y = 0.10 + (high - 0.14) * share
        near = (reach - 0.06 + 0.05) * y / high - 0.05 if leaning else 0.0
        deep = reach - near
        build.add(wood, shapes.box((width, 0.022, deep), (0, y, near + deep / 2)))
        if row == rows - 1:
            continue
        part = Builder()
        _fill(
            rng,
            part,
            covers,
            -x + t,
            x - t,
            y + 0.011,
            (high - 0.14) / (rows - 1) - 0.03,
            max(deep, 0.16),
            full,
        )
        if part.parts:
            build.include(part, offset=(0.0, 0.0, near))
    if not leaning and chance(rng, 0.5):
        for a, b in (((-x, 0.1, reach), (x, high - 0.1, reach)), ((x, 0.1, reach), (-x, high - 0.1, reach))):
            build.add(frame, shapes.bar(a, b, 0.008))
    return build


def bookcase(rng: Generator) -> Mesh:
    """A bookcase; its open side is at -z."""
    kind = pick(rng, ("case", "cubes", "rack"), (0.6, 0.2, 0.2))
    build = open_rack(rng) if kind == "rack" else closed(rng, kind == "cubes")
    return build.mesh("bookcase")
