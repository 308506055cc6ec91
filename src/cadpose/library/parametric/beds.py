"""Beds: the head with its board at +z, the foot at the front, -z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.bedding import make_up
from cadpose.library.parametric.chairs_frame import outline_of
from cadpose.library.parametric.seating import Bend, between, chance, leg, panel, pick, rail, upright
from cadpose.library.parametric.solids import Builder, Paint, Solid, joined

Painted = tuple[Paint, Solid]


@dataclass(frozen=True)
class Size:
    """A mattress and where it lies, in metres."""

    width: float
    length: float
    low: float
    thick: float

    @classmethod
    def draw(cls, rng: Generator) -> Size:
        """From a single bed to a king's."""
        width = float(
            rng.choice([0.9, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0], p=[0.2, 0.07, 0.1, 0.2, 0.22, 0.16, 0.05])
        )
        return cls(width, between(rng, 1.9, 2.1), between(rng, 0.16, 0.38), between(rng, 0.15, 0.30))


def board(
    rng: Generator, kind: str, width: float, low: float, high: float, wood: Paint, soft: Paint
) -> list[Painted]:
    """A flat headboard or footboard about x = 0, from ``low`` to ``high``; its legs are not part of it."""
    half, tall = width / 2, high - low
    if kind == "panel":
        form = outline_of(pick(rng, ("plain", "arch"), (3, 1)), half, low, high, rng)
        parts = [(wood, panel(form, between(rng, 0.025, 0.06), 0.006))]
        if chance(rng, 0.4):
            count = int(rng.integers(2, 5))
            each = width * 0.92 / count
            for k in range(count):
                x = (k - (count - 1) / 2) * each
                field = shapes.rectangle(each * 0.85, tall * 0.5, centre=(x, low + tall * 0.55))
                parts.append((paints.darker(wood, 0.86), shapes.extrude(field, 0.075)))
        return parts
    if kind == "soft":
        thick = between(rng, 0.07, 0.13)
        form = outline_of(pick(rng, ("plain", "arch"), (3, 1)), half, low, high, rng)
        parts = [(soft, panel(form, thick, thick * 0.4))]
        style = pick(rng, ("plain", "buttons", "channels", "squares"))
        if style == "channels":
            count = round(width / between(rng, 0.10, 0.25))
            for k in range(count):
                x = (k - (count - 1) / 2) * width / count
                rib = shapes.superellipsoid(
                    (width / count / 2, tall / 2, thick * 0.75), (x, low + tall / 2, 0), 0.25, 0.9, 10
                )
                parts.append((soft, rib))
        elif style != "plain":
            rows, columns = max(2, round(tall / 0.2)), max(3, round(width / 0.22))
            seam = paints.darker(soft, 0.6)
            for i in range(rows):
                y = low + tall * (i + 0.7) / (rows + 0.4)
                if style == "squares":
                    parts.append((seam, rail(y, half * 0.97, 0.012, thick * 1.03)))
                    continue
                for k in range(columns - i % 2):
                    x = (k - (columns - 1 - i % 2) / 2) * width / columns
                    parts.append((seam, shapes.ellipsoid((0.018, 0.018, thick * 0.56), (x, y, 0), 8)))
        return parts
    if kind == "bars":
        r = between(rng, 0.012, 0.022)
        bow = between(rng, 0.0, 0.16)
        count = int(rng.integers(4, 12))
        posts = [upright(s * half, 0.0, high - bow, 2 * r) for s in (1, -1)]
        parts = [(wood, p) for p in posts]
        across = np.linspace(-half, half, 15)
        arch = np.column_stack([across, high - bow * (across / half) ** 2, 0 * across])
        parts += [(wood, shapes.tube(arch, r, sides=8)), (wood, rail(low, half, r * 1.6, r * 1.2))]
        for v in np.linspace(-half, half, count + 2)[1:-1]:
            parts.append((wood, upright(float(v), low, high - bow * float(v / half) ** 2, r * 1.1)))
        return parts
    count = int(rng.integers(5, 14)) if kind == "slats" else int(rng.integers(2, 5))
    thick = between(rng, 0.025, 0.04)
    crest = between(rng, 0.0, 0.12) if chance(rng, 0.4) else 0.0
    parts = [
        (wood, rail(high - crest - 0.05, half, between(rng, 0.07, 0.12), thick, crest)),
        (wood, rail(low, half, 0.08, thick)),
    ]
    if kind == "slats":
        for v in np.linspace(-half, half, count + 2)[1:-1]:
            rise = crest * (1 - float(v / half) ** 2)
            parts.append(
                (wood, upright(float(v), low, high - crest - 0.05 + rise, width / count * 0.4, thick * 0.5))
            )
    else:
        for y in np.linspace(low, high - crest, count + 2)[1:-1]:
            parts.append((wood, rail(float(y), half, tall / count * 0.5, thick * 0.6)))
    return parts


def post(rng: Generator, style: str, height: float, thick: float) -> Solid:
    """An upright post that stands at the origin: square, or turned with a knob on top."""
    if style == "turned":
        one = leg("turned", height, thick)
        return _with_knob(one, height, thick)
    if style == "knob":
        return _with_knob(shapes.box((thick, height, thick), (0, height / 2, 0)), height, thick)
    return shapes.rounded_box((thick, height, thick), (0, height / 2, 0), 0.006)


def _with_knob(one: Solid, height: float, thick: float) -> Solid:
    """A post with a ball on its top."""
    return joined([one, shapes.ellipsoid((thick * 0.55,) * 3, (0, height + thick * 0.35, 0), 12)])


def standard(rng: Generator, canopy: bool = False) -> Builder:
    """Headboard, side rails, legs, and a footboard or none."""
    build = Builder()
    size = Size.draw(rng)
    kind = pick(
        rng,
        ("panel", "soft", "bars", "slats", "rungs", "none"),
        (2.6, 2.4, 1.2, 1.3, 0.6, 0 if canopy else 0.7),
    )
    metal = kind == "bars"
    frame = paints.metal(rng) if metal else paints.wood(rng) if chance(rng, 0.75) else paints.painted(rng)
    soft = paints.upholstery(rng)
    body = soft if kind == "soft" and chance(rng, 0.8) else frame
    w, half_length = size.width + 0.06, size.length / 2
    top = size.low + size.thick
    z_head, z_foot = half_length + 0.03, -half_length - 0.03
    high = top + between(rng, 0.22, 0.75)
    foot_high = (
        pick(rng, ("none", "low", "high"), (1.1, 0.7, 0.7)) if kind not in ("soft", "none") else "none"
    )
    sleigh = kind == "panel" and chance(rng, 0.25)
    posts = kind in ("slats", "rungs") or (kind == "panel" and not sleigh and chance(rng, 0.5)) or canopy
    style = pick(rng, ("plain", "turned", "knob"), (2, 1, 1))
    thick = between(rng, 0.05, 0.10)
    if kind != "none":
        bend = Bend(
            w,
            high,
            0.0,
            z_head,
            between(rng, 0, 8) if kind in ("panel", "soft") else 0.0,
            0.25 if sleigh else 0.0,
        )
        wide = w * (between(rng, 1.0, 1.25) if kind == "soft" else 1.0)
        for paint, solid in board(rng, kind, wide, max(size.low - 0.12, 0.04), high, frame, soft):
            build.add(paint, solid.warped(bend) if not posts else solid.moved(z=z_head))
    if foot_high != "none":
        rise = (
            top + between(rng, 0.0, 0.08)
            if foot_high == "low"
            else top + between(rng, 0.1, min(0.3, high - top))
        )
        bend = Bend(w, rise, 0.0, z_foot, 0.0, -0.22 if sleigh else 0.0)
        for paint, solid in board(rng, kind, w, size.low - 0.12, rise, frame, soft):
            build.add(paint, solid.warped(bend))
    if posts:
        tall = between(rng, 1.9, 2.2) if canopy else high + between(rng, 0.02, 0.12)
        build.add(frame, post(rng, style, tall, thick).moved(w / 2, 0, z_head).pair())
        short = tall if canopy else rise_of(foot_high, top) + 0.04
        build.add(
            frame,
            post(rng, style if canopy else "plain" if foot_high == "none" else style, short, thick)
            .moved(w / 2, 0, z_foot)
            .pair(),
        )
        if canopy:
            canopy_top(rng, build, frame, w, z_foot, z_head, tall, thick)
    base(rng, build, size, body, frame, posts or (metal and foot_high != "none"))
    make_up(rng, build, size.width, size.length, size.low, size.thick, foot_high == "none" and not canopy)
    return build


def rise_of(foot_high: str, top: float) -> float:
    """Height of the posts at the foot."""
    return {"none": top - 0.06, "low": top + 0.05, "high": top + 0.25}[foot_high]


def base(rng: Generator, build: Builder, size: Size, body: Paint, frame: Paint, has_posts: bool) -> None:
    """The box or the rails that carry the mattress, with legs, drawers, or down to the floor."""
    w, length, low = size.width + 0.05, size.length + 0.05, size.low
    kind = pick(rng, ("rails", "box", "drawers"), (2.0, 1.0, 0.5))
    if kind == "rails" or low < 0.2:
        tall = between(rng, 0.10, 0.18)
        y0 = max(low - tall + 0.06, 0.05)
        build.add(
            body, shapes.rounded_box((w, low + 0.04 - y0, length), (0, (low + 0.04 + y0) / 2, 0), 0.015)
        )
        if not has_posts:
            style = pick(rng, ("square", "taper", "round"))
            thick = between(rng, 0.05, 0.09)
            one = leg(style, y0 + 0.01, thick).moved(w / 2 - 0.09, 0, -length / 2 + 0.09)
            build.add(frame, one.pair(), one.mirrored("z").pair())
        return
    build.add(body, shapes.rounded_box((w, low + 0.02, length), (0, low / 2 + 0.01, 0), 0.015))
    if kind == "drawers":
        count = int(rng.integers(2, 4))
        each = length * 0.9 / count
        knob = paints.metal(rng)
        for k in range(count):
            z = (k - (count - 1) / 2) * each
            front = shapes.box((0.015, low * 0.7, each * 0.94), (w / 2 + 0.006, low * 0.5, z))
            build.add(paints.darker(body, 0.92), front.pair())
            build.add(knob, shapes.box((0.03, 0.015, 0.12), (w / 2 + 0.02, low * 0.6, z)).pair())


def canopy_top(
    rng: Generator,
    build: Builder,
    frame: Paint,
    w: float,
    z_foot: float,
    z_head: float,
    tall: float,
    thick: float,
) -> None:
    """Bars between the posts' tops, with a valance, curtains, or nothing on them."""
    t = thick * 0.7
    for z in (z_foot, z_head):
        build.add(frame, shapes.bar((-w / 2, tall - t / 2, z), (w / 2, tall - t / 2, z), t, t))
    build.add(frame, shapes.bar((w / 2, tall - t / 2, z_foot), (w / 2, tall - t / 2, z_head), t, t).pair())
    cloth = paints.fabric(rng)
    if chance(rng, 0.35):
        valance = between(rng, 0.12, 0.25)
        length = z_head - z_foot
        build.add(
            cloth,
            shapes.box(
                (w + 0.06, valance, length + 0.06), (0, tall - valance / 2 + 0.01, (z_foot + z_head) / 2)
            ),
        )
    elif chance(rng, 0.5):
        for z, side in ((z_foot, 1.0), (z_head, -1.0)):
            waves = np.linspace(0, between(rng, 0.25, 0.45), 15)
            rows = np.array(
                [
                    [(w / 2 + 0.02 * np.sin(k * 1.9), y, z + side * v) for k, v in enumerate(waves)]
                    for y in (0.05, tall)
                ]
            )
            build.add(cloth, shapes.grid(rows).pair())


def divan(rng: Generator) -> Builder:
    """A mattress, or two, on a clothed box; a headboard on the wall side or none."""
    build = Builder()
    size = Size.draw(rng)
    soft = paints.upholstery(rng)
    legs = between(rng, 0.03, 0.12)
    low = between(rng, 0.28, 0.4)
    build.add(soft, shapes.rounded_box((size.width, low - legs, size.length), (0, (low + legs) / 2, 0), 0.02))
    one = shapes.cylinder(0.03, legs + 0.02, (size.width / 2 - 0.1, 0, -size.length / 2 + 0.1), 10)
    build.add(paints.metal(rng), one.pair(), one.mirrored("z").pair())
    top = low + size.thick
    if chance(rng, 0.7):
        high = top + between(rng, 0.25, 0.8)
        wood = paints.wood(rng)
        kind = "soft" if chance(rng, 0.75) else "panel"
        for paint, solid in board(rng, kind, size.width * between(rng, 1.0, 1.15), 0.1, high, wood, soft):
            build.add(paint, solid.moved(z=size.length / 2 + 0.05))
    make_up(rng, build, size.width, size.length, low, size.thick, True)
    return build


def bunk(rng: Generator) -> Builder:
    """Two beds, one above the other, with guards and a ladder at one side."""
    build = Builder()
    frame = (
        paints.wood(rng)
        if chance(rng, 0.55)
        else paints.painted(rng)
        if chance(rng, 0.6)
        else paints.metal(rng)
    )
    w, length, t = 0.95, 2.0, between(rng, 0.045, 0.08)
    tall, decks = between(rng, 1.55, 1.8), (between(rng, 0.2, 0.32), between(rng, 1.05, 1.2))
    x, z = w / 2, length / 2
    one = shapes.rounded_box((t, tall, t), (x, tall / 2, -z), 0.006)
    build.add(frame, one.pair(), one.mirrored("z").pair())
    for number, low in enumerate(decks):
        build.add(frame, shapes.box((w, 0.12, length), (0, low, 0)))
        guard = [low + 0.24 + 0.12 * number, low + 0.34 + 0.12 * number]
        for y in guard:
            for end in (z, -z):
                build.add(frame, shapes.box((w, 0.07, 0.02), (0, y, end)))
            if number:
                build.add(frame, shapes.box((0.02, 0.07, length), (-x, y, 0)))
                build.add(frame, shapes.box((0.02, 0.07, length * 0.7), (x, y, length * 0.15)))
        make_up(rng, build, w - 0.06, length - 0.06, low + 0.03, 0.13, False)
    lean = between(rng, 0.05, 0.2)
    z0 = -z + 0.08
    for zz in (z0, z0 + 0.38):
        build.add(frame, shapes.bar((x + 0.03 + lean, 0, zz), (x + 0.03, decks[1] + 0.35, zz), 0.03, 0.05))
    for y in np.linspace(0.25, decks[1], 5):
        at = x + 0.03 + lean * (1 - y / (decks[1] + 0.35))
        build.add(frame, shapes.bar((at, float(y), z0), (at, float(y), z0 + 0.38), 0.03))
    if chance(rng, 0.5):
        mirrored = Builder()
        mirrored.include(build, np.diag([-1.0, 1.0, 1.0]))
        return mirrored
    return build


def crib(rng: Generator) -> Builder:
    """A child's bed with bars all around."""
    build = Builder()
    frame = paints.wood(rng) if chance(rng, 0.5) else paints.painted(rng)
    w, length, low, t = 0.66, 1.26, between(rng, 0.28, 0.45), 0.045
    side, head = low + between(rng, 0.4, 0.55), low + between(rng, 0.5, 0.75)
    x, z = w / 2, length / 2
    build.add(frame, shapes.rounded_box((t, head, t), (x, head / 2, z), 0.006).pair())
    build.add(frame, shapes.rounded_box((t, side, t), (x, side / 2, -z), 0.006).pair())
    build.add(frame, shapes.box((w, 0.06, length), (0, low - 0.03, 0)))
    for y in (low - 0.02, side - 0.02):
        build.add(frame, shapes.box((0.03, 0.05, length), (x, y, 0)).pair())
    for zz in np.linspace(-z, z, int(rng.integers(11, 17)))[1:-1]:
        build.add(frame, shapes.tube([(x, low, float(zz)), (x, side, float(zz))], 0.010, sides=6).pair())
    for end, high in ((z, head), (-z, side)):
        for paint, solid in board(rng, pick(rng, ("slats", "panel", "bars")), w, low, high, frame, frame):
            build.add(paint, solid.moved(z=end))
    make_up(rng, build, w - 0.05, length - 0.05, low, 0.10, False)
    return build


KINDS = {"standard": 0.68, "divan": 0.14, "canopy": 0.07, "bunk": 0.07, "crib": 0.04}


def bed(rng: Generator) -> Mesh:
    """A bed; the head is at +z, the foot at -z."""
    kind = pick(rng, tuple(KINDS), tuple(KINDS.values()))
    makers = {"standard": standard, "divan": divan, "bunk": bunk, "crib": crib}
    build = standard(rng, canopy=True) if kind == "canopy" else makers[kind](rng)
    return build.mesh("bed")
