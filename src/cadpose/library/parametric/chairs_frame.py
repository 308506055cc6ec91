"""Chairs with a frame of wood or tube: dining, Windsor, bentwood, rocking, folding, bar stools."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.seating import (
    Bend,
    between,
    chance,
    leg,
    panel,
    pick,
    rail,
    seat_outline,
    slab,
    upright,
)
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid

BACKS = ("ladder", "slats", "spindles", "panel", "pad", "splat", "cross", "cane", "open", "rails")


@dataclass(frozen=True)
class Frame:
    """The measures that the parts of one chair share, in metres."""

    width: float
    depth: float
    seat: float
    back: float
    thick: float

    @classmethod
    def draw(cls, rng: Generator, seat: tuple[float, float] = (0.43, 0.49)) -> Frame:
        """Measures of a dining chair."""
        return cls(
            between(rng, 0.39, 0.52),
            between(rng, 0.38, 0.48),
            between(rng, *seat),
            between(rng, 0.30, 0.62),
            between(rng, 0.026, 0.045),
        )


def outline_of(kind: str, half: float, low: float, high: float, rng: Generator) -> Array:
    """Outline of a panel in a back: plain, arched, round or shield-shaped."""
    if kind == "round":
        angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        middle, r = (low + high) / 2, (high - low) / 2
        return np.column_stack([half * np.cos(angle), middle + r * np.sin(angle)])
    if kind == "arch":
        angle = np.linspace(0, np.pi, 13)
        rise = min(half * between(rng, 0.3, 0.9), (high - low) * 0.5)
        arch = np.column_stack([half * np.cos(angle), high - rise + rise * np.sin(angle)])
        return np.array([(half, low), *arch, (-half, low)])
    return shapes.rectangle(
        2 * half, high - low, min(half, high - low) * 0.15, 3, centre=(0, (low + high) / 2)
    )


def back_fill(
    rng: Generator, kind: str, half: float, low: float, high: float, thick: float, wood: Paint, soft: Paint
) -> list[tuple[Paint, Solid]]:
    """What stands between the posts of a flat back, from ``low`` to ``high``."""
    thin = thick * 0.45
    crest = between(rng, 0.0, 0.03) if chance(rng, 0.4) else 0.0
    top_height = between(rng, 0.03, 0.09)
    tall = high - low
    top: list[tuple[Paint, Solid]] = [(wood, rail(high - top_height / 2, half, top_height, thin, crest))]
    below = high - top_height
    if kind in ("ladder", "rails"):
        count = int(rng.integers(2, 6)) if kind == "ladder" else 1
        tallest = tall / (count + 1) * 0.55 if kind == "ladder" else between(rng, 0.10, 0.2)
        levels = np.linspace(low + tall * 0.2, high - tallest / 2, count)
        if kind == "rails":
            levels = np.array([high - tallest / 2])
        return [(wood, rail(float(y), half, tallest, thin, crest)) for y in levels]
    if kind == "open":
        return [*top, (wood, rail(low + tall * 0.35, half, top_height * 0.7, thin, crest))]
    bottom = low if chance(rng, 0.5) else low + tall * between(rng, 0.1, 0.25)
    foot = (wood, rail(bottom, half, 0.03, thin))
    if kind in ("slats", "spindles"):
        count = int(rng.integers(3, 8)) if kind == "slats" else int(rng.integers(5, 10))
        width = 2 * half / (count + 1) * between(rng, 0.35, 0.65) if kind == "slats" else 0.012
        x = np.linspace(-half, half, count + 2)[1:-1]
        flat = thin * 0.6 if kind == "slats" else 0.0
        return [*top, foot, *((wood, upright(float(v), bottom, below + crest, width, flat)) for v in x)]
    if kind == "splat":
        y = np.linspace(bottom, below + crest, 13)
        t = np.linspace(0, 1, 13)
        wave = 1 + between(rng, 0.1, 0.6) * np.sin(np.pi * t * float(rng.integers(1, 4)) + between(rng, 0, 3))
        spread = np.clip(half * between(rng, 0.25, 0.4) * wave, 0.02, half * 0.8)
        outline = np.concatenate([np.column_stack([spread, y]), np.column_stack([-spread, y])[::-1]])
        return [*top, foot, (wood, panel(outline, thin, 0.003, 12))]
    if kind == "cross":
        x, y = np.linspace(-half, half, 7), np.linspace(bottom, below, 7)
        flat_bar = shapes.rectangle(thick * 0.7, thin * 0.6)
        cross = [
            shapes.tube(np.column_stack([sign * x, y, 0 * x]), 1.0, section=flat_bar, up=(0, 0, -1))
            for sign in (1, -1)
        ]
        return [*top, foot, *((wood, c) for c in cross)]
    edge = half * 0.97
    shape = pick(rng, ("plain", "arch", "round"), (3, 1, 0.6)) if kind == "pad" else "plain"
    if kind == "pad":
        fill = panel(outline_of(shape, edge, bottom, high, rng), between(rng, 0.035, 0.07), 0.02)
        return [(soft, fill)]
    if kind == "cane":
        fill = panel(outline_of("plain", edge, bottom, below, rng), 0.008, 0.002)
        return [*top, foot, (paints.wicker(rng), fill)]
    return [(wood, panel(outline_of("plain", edge, bottom, high, rng), thin * 0.7, 0.003))]


def dining(rng: Generator, stool: bool = False, rocking: bool = False) -> Builder:
    """Posts that run from the floor to the top of the back, legs in front, a fill between the posts."""
    build = Builder()
    frame = Frame.draw(rng, (0.60, 0.78) if stool else (0.43, 0.49) if not rocking else (0.38, 0.44))
    back = frame.back * (0.55 if stool else 1.15 if rocking else 1.0)
    wood = pick(rng, ("wood", "painted", "metal"), (0.72, 0.2, 0.08))
    paint = {"wood": paints.wood, "painted": paints.painted, "metal": paints.metal}[wood](rng)
    soft = paints.upholstery(rng)
    w, d, h, t = frame.width, frame.depth, frame.seat, frame.thick
    narrow = w * between(rng, 0.82, 1.0)
    bend = Bend(
        narrow, back, h, d / 2 - t / 2, between(rng, 3, 16) + 6 * rocking, between(rng, 0, 0.10),
        between(rng, 0.0, 0.05), between(rng, -0.08, 0.12),
    )  # fmt: skip
    # Posts: the flat back's own, bent with it, and straight legs below.
    ears = between(rng, 0.0, 0.05) if chance(rng, 0.3) else 0.0
    half = narrow / 2 - t / 2
    kind = pick(rng, BACKS, (2, 2, 1.5, 1.2, 2.2, 1.5, 1, 0.8, 0.8, 1.2))
    low = between(rng, 0.03, 0.10)
    build.add(paint, *(upright(x, -0.03, back + ears, t, t * 0.8, 8).warped(bend) for x in (half, -half)))
    for fill_paint, solid in back_fill(rng, kind, half, low, back, t, paint, soft):
        build.add(fill_paint, solid.warped(bend))
    splay = between(rng, 0.0, 0.09)
    rear = shapes.tube(
        [(half, h, d / 2 - t / 2), (half * 1.02, 0, d / 2 - t / 2 + splay)],
        [1.0, 0.8], section=shapes.rectangle(t, t * 0.8), up=(0, 0, -1),
    )  # fmt: skip
    build.add(paint, rear.pair())
    style = pick(rng, ("square", "taper", "round", "turned", "cabriole"), (3, 3, 2, 1.5, 0.7 * (not stool)))
    front = leg(style, h - 0.02, t * 1.05).moved(w / 2 - t / 2, 0, -d / 2 + t / 2)
    build.add(paint, front.pair())
    seat(rng, build, frame, narrow, paint, soft)
    apron = between(rng, 0.04, 0.07)
    if chance(rng, 0.8):
        side = shapes.bar(
            (w / 2 - t, h - apron / 2, -d / 2 + t), (half, h - apron / 2, d / 2 - t), t * 0.5, apron
        )
        build.add(
            paint, side.pair(), shapes.box((w - 2 * t, apron, t * 0.5), (0, h - apron / 2, -d / 2 + t / 2))
        )
    stretchers(rng, build, frame, paint, half, stool)
    if rocking:
        rockers(rng, build, frame, paint)
    if chance(rng, 0.75 if rocking else 0.12 if stool else 0.28):
        arms(rng, build, frame, paint, bend)
    return build


def seat(rng: Generator, build: Builder, frame: Frame, narrow: float, wood: Paint, soft: Paint) -> None:
    """A board, a pad on a board, or a woven seat."""
    kind = pick(rng, ("board", "pad", "thick", "woven"), (2.5, 3, 1.5, 1))
    outline = seat_outline(frame.width + 0.01, narrow, frame.depth, between(rng, 0.01, 0.08))
    h = frame.seat
    if kind == "board":
        build.add(wood, slab(outline, h - 0.025, 0.025, 0.006))
    elif kind == "woven":
        build.add(paints.wicker(rng), slab(outline * 0.98, h - 0.03, 0.03, 0.012, 0.004))
    else:
        thick = between(rng, 0.03, 0.05) if kind == "pad" else between(rng, 0.06, 0.10)
        build.add(wood, slab(outline, h - 0.03, 0.02, 0.004))
        build.add(soft, slab(outline * 0.99, h - 0.012, thick, thick * 0.4, thick * 0.25))


def stretchers(rng: Generator, build: Builder, frame: Frame, paint: Paint, half: float, must: bool) -> None:
    """Bars between the legs: none, at the sides with one across, or all around."""
    kind = pick(rng, ("none", "h", "box"), (0.0 if must else 1.0, 1.0, 0.8))
    if kind == "none":
        return
    t, x, z = frame.thick * 0.55, frame.width / 2 - frame.thick / 2, frame.depth / 2 - frame.thick / 2
    y = frame.seat * between(rng, 0.25, 0.45)
    build.add(paint, shapes.bar((x, y, -z), (half, y, z + 0.02), t, t * 1.3).pair())
    if kind == "h":
        build.add(paint, shapes.bar((-x, y, 0), (x, y, 0), t, t * 1.3))
    else:
        build.add(
            paint, shapes.bar((-x, y + 0.04 * (not must), -z), (x, y + 0.04 * (not must), -z), t, t * 1.3)
        )
        build.add(paint, shapes.bar((-half, y, z + 0.02), (half, y, z + 0.02), t, t * 1.3))


def arms(rng: Generator, build: Builder, frame: Frame, paint: Paint, bend: Bend) -> None:
    """An arm from each rear post to a post that stands on the seat's side."""
    rise, t = between(rng, 0.18, 0.25), frame.thick
    x = frame.width / 2 - t * 0.2
    at = bend(np.array([[bend.width / 2 - t / 2, min(rise, bend.height * 0.9), 0.0]]))[0]
    z_front = -frame.depth / 2 + between(rng, 0.0, 0.12)
    tip = (x + between(rng, 0.0, 0.03), at[1] - between(rng, 0.0, 0.02), z_front - 0.02)
    mid = (x + 0.02, at[1], (z_front + at[2]) / 2)
    path = shapes.smooth_path([tuple(at), mid, tip], 5)
    build.add(
        paint,
        shapes.tube(path, 1.0, section=shapes.rectangle(t * between(rng, 1.0, 1.8), t * 0.6, 0.004)).pair(),
    )
    build.add(
        paint,
        shapes.bar(
            (x, frame.seat - 0.05, z_front + 0.03), (x + 0.01, tip[1], z_front + 0.02), t * 0.8, t * 0.8
        ).pair(),
    )


def rockers(rng: Generator, build: Builder, frame: Frame, paint: Paint) -> None:
    """Two runners below the legs."""
    reach, sag = frame.depth * 0.5 + between(rng, 0.16, 0.28), between(rng, 0.07, 0.11)
    z = np.linspace(-reach * 0.85, reach * 1.15, 13)
    y = sag * (z / reach) ** 2 - sag * 0.25
    path = np.column_stack([np.full(13, frame.width / 2 - frame.thick / 2), y, z])
    build.add(paint, shapes.tube(path, 1.0, section=shapes.rectangle(frame.thick * 0.8, 0.045)).pair())


def windsor(rng: Generator) -> Builder:
    """A board seat, spindles in a bow or under a comb, splayed turned legs; also the bentwood cafe chair."""
    build = Builder()
    frame = Frame.draw(rng)
    paint = paints.wood(rng) if chance(rng, 0.7) else paints.painted(rng)
    w, d, h = frame.width, frame.depth, frame.seat
    back, cafe = between(rng, 0.38, 0.62), chance(rng, 0.4)
    angle = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    outline = np.column_stack([np.cos(angle) * w / 2, np.sin(angle) * d / 2])
    outline *= 1 + 0.06 * np.cos(2 * angle)[:, None]
    if cafe:
        build.add(
            paints.wicker(rng) if chance(rng, 0.4) else paint, slab(outline * 0.9, h - 0.01, 0.015, 0.005)
        )
        build.add(paint, shapes.tube(np.column_stack([outline[:, 0], np.full(28, h - 0.015), -outline[:, 1]]),
                                     0.02, closed=True))  # fmt: skip
    else:
        build.add(paint, slab(outline, h - 0.035, 0.04, 0.015))
    bend = Bend(
        w * 0.86,
        back,
        h,
        d * 0.36,
        between(rng, 8, 16),
        0.02,
        between(rng, 0.03, 0.07),
        between(rng, -0.05, 0.15),
    )
    wide = bend.width / 2

    def hoop(scale: float, top: float) -> Array:
        a = np.linspace(0, np.pi, 17)
        arch = np.column_stack(
            [wide * scale * np.cos(a), top - wide * scale + wide * scale * np.sin(a), 0 * a]
        )
        return np.concatenate(
            [[(wide * scale * 0.95, -0.02, 0.0)], arch, [(-wide * scale * 0.95, -0.02, 0.0)]]
        )

    bow = chance(rng, 0.65) or cafe
    if bow:
        build.add(paint, shapes.tube(hoop(1.0, back), 0.013, sides=8).warped(bend))
    else:
        build.add(paint, rail(back, wide, between(rng, 0.05, 0.09), 0.02, 0.02).warped(bend))
    if cafe and chance(rng, 0.6):
        build.add(paint, shapes.tube(hoop(0.62, back * 0.82), 0.010, sides=8).warped(bend))
    else:
        for x in np.linspace(-wide, wide, int(rng.integers(7, 11)))[1 if bow else 0 : -1 if bow else None]:
            rest = np.sqrt(max(1 - (x / wide) ** 2, 0.0))
            high = back - wide + wide * rest if bow else back
            build.add(paint, upright(float(x), -0.02, float(high), 0.013).warped(bend))
    turned = chance(rng, 0.5) and not cafe
    for sz in (-1, 1):
        top, foot = (w * 0.30, h - 0.02, sz * d * 0.30), (w * 0.46, 0.0, sz * d * 0.50)
        radius = (
            np.array([0.012, 0.017, 0.022, 0.013, 0.02, 0.014, 0.018, 0.010])
            if turned
            else np.linspace(0.016, 0.011, 8)
        )
        path = np.linspace(top, foot, 8)
        build.add(paint, shapes.tube(path, radius * 1.15, sides=8).pair())
    if chance(rng, 0.7):
        y, x = h * 0.4, w * 0.40
        build.add(
            paint,
            shapes.bar((x, y, -d * 0.42), (x, y, d * 0.42), 0.022).pair(),
            shapes.bar((-x, y, 0), (x, y, 0), 0.022),
        )
    if not cafe and chance(rng, 0.35):
        arms(rng, build, frame, paint, bend)
    return build


def folding(rng: Generator) -> Builder:
    """Two crossing frames, a slatted or plain seat and a low back; also the director's chair."""
    build = Builder()
    paint = pick(rng, ("wood", "metal", "painted"))
    frame_paint = {"wood": paints.wood, "metal": paints.metal, "painted": paints.painted}[paint](rng)
    cloth = paints.fabric(rng) if chance(rng, 0.5) else frame_paint
    w, h, d = between(rng, 0.40, 0.48), between(rng, 0.42, 0.46), between(rng, 0.36, 0.42)
    high = between(rng, 0.76, 0.90)
    t = between(rng, 0.018, 0.03)
    x = w / 2
    # One frame runs from the front foot to the back's top, the other from the rear foot to the seat.
    lean = np.array([(x, 0, -d * 0.55), (x, h, d * 0.35), (x, high, d * 0.35 + (high - h) * 0.32)])
    build.add(frame_paint, shapes.tube(lean, 1.0, section=shapes.rectangle(t, t * 1.3), up=(0, 0, -1)).pair())
    build.add(frame_paint, shapes.bar((x - t, 0, d * 0.62), (x - t, h, -d * 0.5), t, t * 1.3).pair())
    for y, z in ((0.12, -d * 0.30), (0.12, d * 0.32)):
        build.add(frame_paint, shapes.bar((-x, y, z), (x, y, z), t * 0.7, t))
    slats = int(rng.integers(4, 8)) if chance(rng, 0.5) else 0
    if slats:
        for z in np.linspace(-d * 0.5, d * 0.38, slats):
            build.add(cloth, shapes.rounded_box((w - t, 0.014, d / slats * 0.75), (0, h, float(z)), 0.004))
    else:
        build.add(cloth, shapes.rounded_box((w - t, 0.03, d), (0, h, -d * 0.06), 0.012))
    bend = Bend(w, high - h, h, d * 0.35, 17.5, 0.0, between(rng, 0.0, 0.04))
    rows = int(rng.integers(1, 4))
    band = between(rng, 0.10, 0.2) / rows
    for k in range(rows):
        build.add(cloth, rail((high - h) * 1.02 - band * (0.6 + 1.35 * k), x, band, 0.012).warped(bend))
    return build


def bar_stool(rng: Generator) -> Builder:
    """A high seat with a low back or none, on four legs with foot bars or on a column."""
    if chance(rng, 0.3):
        return dining(rng, stool=True)
    build = Builder()
    metal, soft = paints.metal(rng), paints.upholstery(rng)
    h, r = between(rng, 0.62, 0.80), between(rng, 0.17, 0.22)
    pad = between(rng, 0.03, 0.09)
    angle = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    round_seat = chance(rng, 0.5)
    if round_seat:
        outline = np.column_stack([np.cos(angle), np.sin(angle)]) * r
    else:
        outline = shapes.rectangle(2 * r, 1.9 * r, r * between(rng, 0.2, 0.7), 4)
    build.add(soft, slab(outline, h - pad, pad, pad * 0.45, pad * 0.2))
    if chance(rng, 0.5):
        build.add(
            metal, shapes.lathe([(0.20, 0), (0.20, 0.012), (0.06, 0.03), (0.028, 0.05), (0.028, h - pad)], 24)
        )
        if chance(rng, 0.8):
            y = h * 0.38
            build.add(
                metal,
                shapes.tube(
                    [(0.02, y, 0), (r * 0.8, y, -r * 0.2), (r * 0.7, y, -r), (0, y, -r * 1.05)], 0.010
                ).pair(),
            )
    else:
        wood = metal if chance(rng, 0.4) else paints.wood(rng)
        style = pick(rng, ("square", "taper", "round"))
        lean = between(rng, 0.02, 0.06)
        foot = leg(style, h - pad, between(rng, 0.025, 0.04)).warped(
            lambda v: v + np.outer(1 - v[:, 1] / h, (lean, 0, -lean))
        )  # fmt: skip
        corner = r * (0.6 if round_seat else 0.78)
        one = foot.moved(corner, 0, -corner)
        build.add(wood, one.pair(), one.mirrored("z").pair())
        y = h * between(rng, 0.25, 0.4)
        e = corner + lean * (1 - y / h)
        for a, b in (
            ((-e, y, -e), (e, y, -e)),
            ((-e, y, e), (e, y, e)),
            ((e, y, -e), (e, y, e)),
            ((-e, y, -e), (-e, y, e)),
        ):
            build.add(wood, shapes.bar(a, b, 0.016, 0.022))
    # Without a back nobody can tell its front.
    if chance(rng, 0.95):
        back = between(rng, 0.14, 0.38)
        bend = Bend(2 * r, back, h - pad * 0.5, r * 0.85, between(rng, 2, 12), 0.0, between(rng, 0.03, 0.09))
        high = back * between(rng, 0.45, 1.0)
        if chance(rng, 0.5):
            build.add(
                soft, panel(outline_of("plain", r * 0.95, back - high, back, rng), 0.04, 0.015).warped(bend)
            )
        else:
            build.add(metal, rail(back - 0.03, r * 0.95, 0.06, 0.02).warped(bend))
        build.add(metal, *(upright(s * r * 0.7, -0.03, back - 0.02, 0.018).warped(bend) for s in (1, -1)))
    return build
