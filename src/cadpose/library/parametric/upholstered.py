"""Upholstered seats from one place to many: the body that sofas and club chairs share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.seating import between, chance, leg, pick, slab
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid

ARMS = ("track", "rolled", "flared", "slope", "thin", "frame", "none")
BACKS = ("cushions", "tight", "camel", "channels", "tufted", "pillows", "low")


@dataclass(frozen=True)
class Body:
    """The measures of one seat, in metres.

    Attributes:
        places: How many sit side by side.
        inner: Width between the arms.
        depth: From the front of the seat to the back of the back.
        legs: Height of the legs; 0 stands on the floor.
        seat: Height of the seat's top.
        arm: Thickness of an arm; 0 without arms.
        arm_top: Height of the arms.
        back: Thickness of the back.
        top: Height of the back.
        rake: Degrees that the back leans.
    """

    places: int
    inner: float
    depth: float
    legs: float
    seat: float
    arm: float
    arm_top: float
    back: float
    top: float
    rake: float

    @property
    def front(self) -> float:
        """z of the seat's front."""
        return -self.depth / 2

    @property
    def behind(self) -> float:
        """z of the back's face at the seat."""
        return self.depth / 2 - self.back


def draw_body(rng: Generator, places: int, arms: str, back: str) -> Body:
    """Measures that go with the arms and the back."""
    each = between(rng, 0.54, 0.74) if places > 1 else between(rng, 0.50, 0.66)
    if places == 1:
        each = between(rng, 0.48, 0.62)
    seat = between(rng, 0.38, 0.47)
    top = seat + between(rng, 0.22, 0.34) if back == "low" else seat + between(rng, 0.32, 0.55)
    arm_top = min(seat + between(rng, 0.08, 0.26), top)
    if arms == "rolled" and back == "tufted":
        # The Chesterfield: arms as high as the back.
        top = arm_top = seat + between(rng, 0.24, 0.34)
    thick = {"thin": (0.05, 0.10), "frame": (0.03, 0.05), "none": (0.0, 0.0)}.get(arms, (0.10, 0.26))
    return Body(
        places, each * places, between(rng, 0.74, 1.0), between(rng, 0.03, 0.20), seat,
        between(rng, *thick), arm_top, between(rng, 0.12, 0.24), top, between(rng, 2, 16),
    )  # fmt: skip


def cushion(width: float, thick: float, depth: float, soft: float, corner: float = 0.05) -> Solid:
    """A seat cushion that lies on the ground about the origin; ``soft`` in [0, 1] rounds and swells it."""
    outline = shapes.rectangle(width, depth, corner, 3)
    return slab(outline, 0.0, thick * (1 - 0.2 * soft), thick * (0.2 + 0.25 * soft), thick * 0.35 * soft)


def arm_solid(rng: Generator, style: str, body: Body) -> Solid:
    """The arm at the own right (+x), from the floor of the body to its top."""
    low, high, t = body.legs, body.arm_top, body.arm
    x0 = body.inner / 2
    if style == "rolled":
        r = t * between(rng, 0.42, 0.6)
        angle = np.linspace(-0.35 * np.pi, 1.12 * np.pi, 13)
        roll = np.column_stack([x0 + t * 0.62 + r * np.cos(angle), high - r + r * np.sin(angle)])
        outline = np.array([(x0 + 0.005, low), (x0 + t * 0.85, low), *roll, (x0, high - 1.7 * r)])
        return _along_z(outline, body)
    if style == "flared":
        lean = between(rng, 0.03, 0.14)
        outline = shapes.rectangle(
            t, high - low, min(t * 0.45, 0.06), 3, centre=(x0 + t / 2, (high + low) / 2)
        )
        outline[:, 0] += lean * ((outline[:, 1] - low) / (high - low)) ** 2
        return _along_z(outline, body)
    if style == "slope":
        rise = min(between(rng, 0.10, 0.25), body.top - high)
        z0, z1 = body.front + 0.02, body.depth / 2
        side = [
            (z0, low),
            (z0 - 0.01, high * 0.97),
            (z0 + 0.05, high),
            (z0 + 0.3 * body.depth, high + rise * 0.15),
        ]
        side += [(z0 + 0.65 * body.depth, high + rise * 0.6), (z1, high + rise), (z1, low)]
        return shapes.extrude(side, t, "zy", t * 0.4).moved(x0 + t / 2)
    outline = shapes.rectangle(t, high - low, min(t * 0.3, 0.05), 3, centre=(x0 + t / 2, (high + low) / 2))
    return _along_z(outline, body)


def _along_z(outline: Array, body: Body) -> Solid:
    depth = body.depth - 0.02
    return shapes.extrude(outline, depth, "xy", 0.02, 2).moved(z=0.01)


def frame_arm(rng: Generator, body: Body, paint: Paint) -> list[tuple[Paint, Solid]]:
    """An open arm of wood or metal: two posts and a rest."""
    x, t = body.inner / 2 + body.arm / 2, body.arm
    z0, z1 = body.front + between(rng, 0.02, 0.10), body.depth / 2 - 0.06
    lean = between(rng, 0.0, 0.05)
    rest = shapes.rounded_box((t * 1.5, t * 0.7, z1 - z0 + 0.10), (x, body.arm_top, (z0 + z1) / 2), 0.008)
    solids = [
        rest,
        shapes.bar((x, 0, z0 - lean), (x, body.arm_top, z0), t, t),
        shapes.bar((x, 0, z1 + lean), (x, body.arm_top, z1), t, t),
        shapes.bar((x, body.legs + 0.06, z0), (x, body.legs + 0.06, z1), t, t * 1.4),
    ]
    return [(paint, s.pair()) for s in solids]


def back_solids(
    rng: Generator, kind: str, body: Body, width: float, main: Paint, loose: Paint, frame: bool
) -> list[tuple[Paint, Solid]]:
    """The back of a given width about x = 0, leaning as the body says."""
    low, high, t = body.legs + (0.10 if frame else 0.0), body.top, body.back
    pivot = (0.0, body.seat * 0.6, body.depth / 2 - t / 2)
    outline = shapes.rectangle(width, high - low, between(rng, 0.02, 0.08), 3, centre=(0, (high + low) / 2))
    if kind == "camel":
        across = np.linspace(width / 2, -width / 2, 17)
        humps = 1 if chance(rng, 0.7) else 2
        turn = np.pi * across / width
        wave = np.cos(turn) ** 2 if humps == 1 else np.sin(2 * turn) ** 2
        crest = np.column_stack([across, high - 0.12 * (1 - wave)])
        outline = np.array([(-width / 2, low), (width / 2, low), *crest])
    found: list[tuple[Paint, Solid]] = []
    depth = t * 0.6 if kind in ("cushions", "pillows") else t
    shell = shapes.extrude(outline, depth, "xy", min(depth * 0.4, 0.06)).moved(z=body.depth / 2 - depth / 2)
    found.append((main, shell))
    face = body.depth / 2 - depth
    tall = high - body.seat
    if kind in ("cushions", "pillows"):
        count = body.places
        each = body.inner / count
        soft = 0.9 if kind == "pillows" else between(rng, 0.2, 0.7)
        thick = t * 0.7
        height = tall * between(rng, 0.9, 1.15)
        one = cushion(each - 0.01, thick, height, soft, 0.06).turned("x", -90).moved(0, 0, thick * 0.5)
        for k in range(count):
            x = (k - (count - 1) / 2) * each
            found.append((loose, one.moved(x, body.seat + height / 2 - 0.02, face + 0.02)))
    elif kind == "channels":
        count = max(4, round(body.inner / between(rng, 0.10, 0.18)))
        r = body.inner / count / 2
        for k in range(count):
            x = (k - (count - 1) / 2) * 2 * r
            rib = shapes.superellipsoid(
                (r, tall / 2 + 0.01, 0.05), (x, body.seat + tall / 2, face), 0.3, 1.0, 10
            )
            found.append((main, rib))
    elif kind == "tufted":
        pad = shapes.extrude(
            shapes.rectangle(body.inner * 0.98, tall * 0.92, 0.04, centre=(0, body.seat + tall * 0.5)),
            0.08,
            "xy",
            0.035,
        ).moved(z=face)
        found.append((main, pad))
        rows, columns = int(rng.integers(2, 4)), max(3, round(body.inner / 0.17))
        button = paints.darker(main, 0.55)
        for i in range(rows):
            for k in range(columns - i % 2):
                x = (k - (columns - 1 - i % 2) / 2) * body.inner * 0.96 / columns
                y = body.seat + tall * (0.28 + 0.55 * i / max(rows - 1, 1))
                found.append((button, shapes.ellipsoid((0.016, 0.016, 0.008), (x, y, face - 0.041), 8)))
    return [(p, s.turned("x", body.rake, pivot)) for p, s in found]


def feet(
    rng: Generator, build: Builder, body: Body, width: float, depth: float, at: tuple[float, float]
) -> None:
    """Legs below a base of the given size whose middle is at (x, z)."""
    h = body.legs
    wood = paints.wood(rng, 0.3) if chance(rng, 0.65) else paints.metal(rng)
    style = pick(rng, ("square", "taper", "round", "splayed", "turned", "block"), (1.5, 2, 2, 1, 0.7, 1))
    thick = between(rng, 0.035, 0.06)
    one = (
        shapes.box((thick * 1.8, h, thick * 1.8), (0, h / 2, 0))
        if style == "block"
        else leg(style, h + 0.01, thick)
    )
    x, z = width / 2 - thick * 1.4, depth / 2 - thick * 1.4
    for sx in (1.0, -1.0):
        for sz in (1.0, -1.0):
            corner = one.scaled(sx, 1, sz).moved(at[0] + sx * x, 0, at[1] - sz * z)
            build.add(wood, corner)
    if width > 1.7:
        middle = one.scaled(0.9, 1, 0.9)
        build.add(wood, middle.moved(at[0], 0, at[1] - z), middle.moved(at[0], 0, at[1] + z))


def throw_pillows(rng: Generator, build: Builder, body: Body, most: int) -> None:
    """Some loose pillows that lean against the back."""
    count = int(rng.integers(0, most + 1))
    spots = np.linspace(-1, 1, max(count, 2)) * (body.inner / 2 - 0.2)
    paint = paints.fabric(rng, 0.6)
    for k in range(count):
        if chance(rng, 0.5):
            paint = paints.fabric(rng, 0.6)
        side = between(rng, 0.32, 0.48)
        one = shapes.pillow((side, between(rng, 0.12, 0.18), side * between(rng, 0.65, 1.0)), puff=0.55)
        one = one.turned("z", between(rng, -20, 20)).turned("x", -75 + between(rng, -8, 5))
        one = one.turned("y", -float(np.sign(spots[k])) * between(rng, 0, 30))
        build.add(
            paint, one.moved(float(spots[k]), body.seat + side * 0.42, body.behind - between(rng, 0.08, 0.2))
        )


def upholstered(rng: Generator, places: int, pillows: int = 0, chaise: float = 0.0, side: int = 1) -> Builder:
    """A seat of some places with arms and a back.

    Args:
        rng: Draws everything.
        places: People side by side; 1 is an armchair.
        pillows: Most loose pillows.
        chaise: How far the last place is drawn out to the front, in metres.
        side: 1 puts that place at the own right, -1 at the left.
    """
    arms = pick(rng, ARMS, (3, 2, 1.6, 1, 1, 1.2, 0.6 if places > 1 else 0.25))
    back = pick(rng, BACKS, (4, 1.6, 0.6, 0.8, 1.2, 1.6, 0.7))
    if arms == "frame" and chaise > 0:
        arms = "thin"
    body = draw_body(rng, places, arms, back)
    build = Builder()
    main = paints.upholstery(rng)
    loose = paints.upholstery(rng) if chance(rng, 0.12) else main
    wood = paints.wood(rng) if chance(rng, 0.8) else paints.metal(rng)
    seat_pad = between(rng, 0.12, 0.2)
    if arms == "frame":
        for paint, solid in frame_arm(rng, body, wood):
            build.add(paint, solid)
        seat_pad = between(rng, 0.10, 0.16)
    elif arms != "none":
        one = arm_solid(rng, arms, body)
        build.add(main, one.pair())
    base_low = body.seat - seat_pad - 0.07 if arms == "frame" else body.legs
    base_high = body.seat - seat_pad + 0.01
    whole = body.inner + 2 * body.arm * (arms not in ("frame", "none"))
    front = body.front + 0.02
    base = wood if arms == "frame" else main
    base_depth = body.depth / 2 - front
    build.add(base, _block(body.inner + 0.01, base_low, base_high, front, body.depth / 2))
    each = body.inner / places
    out_x = side * (body.inner - each) / 2
    if chaise > 0:
        build.add(base, _block(each, base_low, base_high, front - chaise, 0.0).moved(out_x))
    whole_back = body.inner if arms in ("rolled", "flared", "track", "slope") and chance(rng, 0.5) else whole
    for paint, solid in back_solids(
        rng, back, body, max(whole_back, body.inner), main, loose, arms == "frame"
    ):
        build.add(paint, solid)
    if arms == "rolled" and back == "tufted":
        x, r = whole / 2 - body.arm * 0.4, between(rng, 0.06, 0.09)
        y, z = body.top - r * 0.4, body.depth / 2 - body.back * 0.4
        build.add(main, shapes.tube([(-x, y, z), (x, y, z)], r, sides=14))
    soft = between(rng, 0.15, 0.9)
    one_piece = places > 1 and chaise == 0 and chance(rng, 0.18)
    count = 1 if one_piece else places
    reach = body.behind - body.front - (0.02 if back in ("cushions", "pillows") else 0.0)
    for k in range(count):
        x = (k - (count - 1) / 2) * body.inner / count
        longer = chaise if chaise > 0 and abs(x - out_x) < 1e-6 else 0.0
        pad = cushion(body.inner / count - 0.008, seat_pad, reach + longer, soft)
        build.add(loose, pad.moved(x, body.seat - seat_pad, body.front + (reach - longer) / 2))
    if arms != "frame":
        if body.legs < 0.06:
            skirt = _block(whole - 0.03, 0.0, body.legs + 0.02, front + 0.015, body.depth / 2 - 0.015)
            build.add(paints.darker(main, 0.5) if chance(rng, 0.5) else main, skirt)
            if chaise > 0:
                build.add(
                    main, _block(each - 0.03, 0, body.legs + 0.02, front - chaise + 0.015, 0.0).moved(out_x)
                )
        else:
            feet(rng, build, body, whole, base_depth, (0.0, (front + body.depth / 2) / 2))
            if chaise > 0:
                feet(rng, build, body, each, chaise, (out_x, front - chaise / 2))
    throw_pillows(rng, build, body, pillows)
    return build


def _block(width: float, low: float, high: float, front: float, behind: float) -> Solid:
    size = (width, max(high - low, 0.01), behind - front)
    return shapes.rounded_box(size, (0, (low + high) / 2, (front + behind) / 2), 0.012)
