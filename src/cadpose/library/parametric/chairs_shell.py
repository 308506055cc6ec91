"""Chairs of the twentieth century: shells on legs, cantilevers, office chairs, garden chairs of one piece."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.chairs_frame import outline_of
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


def _shell(rng: Generator, seat: float, bucket: bool) -> tuple[Array, float]:
    """((R, C, 3) grid of a seat that goes over into a back, its width); the upper side is the front."""
    depth, high = between(rng, 0.38, 0.46), between(rng, 0.30, 0.44)
    width = between(rng, 0.44, 0.62) if bucket else between(rng, 0.40, 0.50)
    z0 = -depth / 2
    profile = [
        (z0 - 0.02, seat - 0.03), (z0 + 0.05, seat), (z0 + depth * 0.5, seat - 0.02),
        (z0 + depth * 0.9, seat + 0.0), (z0 + depth * 1.08, seat + high * 0.25),
        (z0 + depth * 1.16, seat + high * 0.65), (z0 + depth * 1.26, seat + high),
    ]  # fmt: skip
    line = shapes.smooth_path(profile, 4)
    line = np.concatenate([_split(line[:3]), line[3:-3], _split(line[-3:])])
    way = np.linalg.norm(np.diff(line, axis=0), axis=1)
    s = np.concatenate([np.zeros(1), np.cumsum(way)]) / way.sum()
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    inward = np.stack([-along[:, 1], along[:, 0]], 1)  # up on the seat, forward on the back
    top = between(rng, 0.65, 1.0)
    waist = 1.0 - between(rng, 0.0, 0.35) * np.exp(-(((s - 0.58) / 0.12) ** 2)) * (not bucket)
    half = width / 2 * waist * np.interp(s, [0, 0.12, 0.7, 0.93, 1], [0.96, 1, 1, top, top])
    # Round corners at the front and at the top.
    for end in (s, 1 - s):
        half *= 1 - between(rng, 0.15, 0.45) * (1 - np.clip(end / 0.14, 0, 1)) ** 3
    if bucket:
        # A high side would fold where the profile turns: its rise turns slowly from up to forward.
        way_up = np.radians(np.interp(s, [0.1, 1.0], [0.0, 70.0]))
        inward = np.stack([-np.sin(way_up), np.cos(way_up)], 1)
    curl = between(rng, 0.16, 0.24) if bucket else between(rng, 0.01, 0.06)
    lift = curl * np.interp(s, [0, 0.15, 0.4, 0.6, 0.8, 1], [0.1, 0.5, 1.0, 1.0, 0.5, 0.1])
    t = np.linspace(-1.0, 1.0, 13)
    grid = np.empty((len(line), len(t), 3))
    for j, x in enumerate(t):
        rise = lift * np.abs(x) ** 3
        grid[:, j, 0] = half * x * (1.0 - 0.12 * np.abs(x) ** 6 * (lift / max(curl, 1e-9)))
        grid[:, j, 1] = line[:, 1] + inward[:, 1] * rise
        grid[:, j, 2] = line[:, 0] + inward[:, 0] * rise
    return grid[:, ::-1], width


def _split(line: Array) -> Array:
    """The same line with three times as many points."""
    at = np.linspace(0, len(line) - 1, 3 * len(line))
    return np.column_stack([np.interp(at, np.arange(len(line)), c) for c in line.T])


def shell(rng: Generator) -> Builder:
    """A moulded shell, a bucket or a plain one, on dowels, tubes, a pedestal, a star or runners."""
    build = Builder()
    bucket = chance(rng, 0.4)
    h = between(rng, 0.41, 0.47)
    grid, width = _shell(rng, h, bucket)
    body = pick(rng, ("plastic", "wood", "soft"), (3, 1, 1))
    paint = {"plastic": paints.plastic, "wood": paints.wood, "soft": paints.upholstery}[body](rng)
    build.add(paint, shapes.plate(grid, 0.035 if body == "soft" else 0.012))
    if chance(rng, 0.3) and body != "soft":
        pad = paints.upholstery(rng)
        build.add(
            pad, slab(seat_outline(width * 0.72, width * 0.66, 0.34, 0.08), h - 0.03, 0.03, 0.014, 0.01)
        )
    low = h - 0.045
    base = pick(rng, ("dowel", "tube", "pedestal", "sled", "star"), (2.5, 2, 1, 1, 0.5))
    if base == "dowel":
        wood, metal = paints.wood(rng, 0.4), paints.metal(rng)
        x, z = width * 0.28, 0.11
        one = shapes.tube([(x, low, -z), (x + 0.07, 0, -z - 0.09)], [0.017, 0.010], sides=8)
        build.add(wood, one.pair(), one.mirrored("z").pair())
        y = low * 0.55
        for a, b in (((x, low, -z), (-x - 0.03, y, -z - 0.03)), ((x, low, z), (x + 0.03, y, -z - 0.03)),
                     ((x, low, z), (-x - 0.03, y, z + 0.03)),
                     ((x, low, -z), (x + 0.03, y, z + 0.03))):  # fmt: skip
            build.add(metal, shapes.tube([a, b], 0.004, sides=5).pair())
    elif base == "tube":
        metal = paints.metal(rng)
        r, spread = between(rng, 0.008, 0.013), between(rng, 0.02, 0.08)
        x, z = width * 0.30, 0.13
        one = shapes.tube([(0, low, -z), (x, low, -z), (x + spread, 0, -z - spread)], r, sides=8)
        build.add(metal, one.pair(), one.mirrored("z").pair())
    elif base == "pedestal":
        metal = paints.metal(rng) if chance(rng, 0.5) else paint
        r = between(rng, 0.20, 0.27)
        profile = [
            (r, 0.0),
            (r * 0.98, 0.012),
            (r * 0.4, 0.04),
            (0.03, 0.12),
            (0.025, low * 0.6),
            (0.07, low),
            (0.12, low + 0.02),
        ]
        build.add(metal, shapes.lathe(profile, 24))
    elif base == "sled":
        metal = paints.metal(rng)
        x, z = width * 0.40, 0.22
        path = [
            (0, low, -0.12),
            (x * 0.7, low, -0.12),
            (x, 0.01, -z),
            (x, 0.01, z),
            (x * 0.7, low, 0.12),
            (0, low, 0.12),
        ]
        build.add(metal, shapes.tube(path, 0.008, sides=7).pair())
    else:
        star_base(rng, build, low, paints.metal(rng))
    return build


def star_base(rng: Generator, build: Builder, top: float, paint: Paint, castors: bool = False) -> None:
    """A column on a star of four or five feet, with castors or without."""
    count = 5 if castors or chance(rng, 0.5) else 4
    reach, hub = between(rng, 0.26, 0.33), 0.11 if castors else 0.07
    low = 0.065 if castors else 0.02
    angle = between(rng, 0, 360)
    black = paints.plain((0.10, 0.10, 0.11))
    arm = shapes.tube([(0, hub, 0), (0, (hub + low) / 2 + 0.01, -reach * 0.6), (0, low, -reach)],
                      [1.0, 0.85, 0.6], section=shapes.rectangle(0.05, 0.035, 0.008))  # fmt: skip
    for k in range(count):
        turn = angle + 360.0 * k / count
        build.add(paint, arm.turned("y", turn))
        if castors:
            wheel = shapes.cylinder(0.028, 0.05, (0, -0.025, 0), 12).turned("z", 90).moved(0, 0.028, -reach)
            build.add(black, wheel.turned("y", 35, (0, 0, -reach)).turned("y", turn))
        else:
            build.add(paint, shapes.cylinder(0.02, low, (0, 0, -reach), 10).turned("y", turn))
    joint = (hub + top) / 2
    profile = [(0.035, hub - 0.03), (0.04, hub + 0.02), (0.028, hub + 0.03), (0.028, joint)]
    build.add(paint, shapes.lathe([*profile, (0.018, joint), (0.018, top)], 14))


def office(rng: Generator) -> Builder:
    """A swivel chair on castors: a task chair with a mesh or padded back, or a high one for the director."""
    build = Builder()
    h = between(rng, 0.45, 0.54)
    dark = paints.plain((0.11, 0.11, 0.12)) if chance(rng, 0.7) else paints.plastic(rng)
    metal = paints.metal(rng) if chance(rng, 0.45) else dark
    soft = paints.upholstery(rng) if chance(rng, 0.65) else paints.plain((0.13, 0.13, 0.14))
    boss = chance(rng, 0.35)
    w, d = between(rng, 0.46, 0.54), between(rng, 0.44, 0.50)
    thick = between(rng, 0.09, 0.14) if boss else between(rng, 0.05, 0.09)
    outline = shapes.rectangle(w, d, between(rng, 0.08, 0.18), 4)
    build.add(soft, slab(outline, h - thick, thick, thick * 0.45, thick * 0.2))
    build.add(dark, shapes.rounded_box((w * 0.5, 0.04, d * 0.6), (0, h - thick - 0.015, 0), 0.012))
    star_base(rng, build, h - thick - 0.02, metal, castors=True)
    back = between(rng, 0.62, 0.78) if boss else between(rng, 0.38, 0.62)
    gap = 0.0 if boss else between(rng, 0.06, 0.14)
    wide = w * (between(rng, 0.92, 1.05) if boss else between(rng, 0.80, 0.98))
    bend = Bend(wide, back + gap, h - 0.02, d * 0.46, between(rng, 6, 14), 0.04, between(rng, 0.03, 0.07),
                between(rng, -0.15, 0.05))  # fmt: skip
    mesh = not boss and chance(rng, 0.45)
    form = pick(rng, ("plain", "arch"), (2, 1))
    area = outline_of(form, wide / 2, gap, gap + back, rng)
    if mesh:
        net = paints.plain((0.16, 0.16, 0.17), "mesh", 0.75)
        build.add(net, panel(area, 0.008, 0.003).warped(bend))
        rim = np.column_stack([area, np.zeros(len(area))])
        build.add(dark, shapes.tube(rim, 0.014, sides=7, closed=True).warped(bend))
    else:
        build.add(soft, panel(area, 0.10 if boss else between(rng, 0.04, 0.07), 0.03).warped(bend))
        if boss:
            rows = int(rng.integers(2, 5))
            seam = paints.darker(soft, 0.6)
            for y in np.linspace(gap + back * 0.2, gap + back * 0.8, rows):
                build.add(seam, rail(float(y), wide * 0.44, 0.012, 0.104).warped(bend))
    spine = [(0, -0.06, -0.10), (0, -0.06, 0.06), (0, 0.05, 0.055), (0, gap + back * 0.45, 0.045)]
    build.add(
        dark,
        shapes.tube(np.array(spine), 1.0, section=shapes.rectangle(0.07, 0.02), up=(0, 0, -1)).warped(bend),
    )
    if not boss and chance(rng, 0.25):
        head = panel(shapes.rectangle(wide * 0.6, 0.14, 0.04, centre=(0, gap + back + 0.11)), 0.05, 0.02)
        build.add(soft, head.warped(bend))
        build.add(dark, upright(0.0, gap + back * 0.9, gap + back + 0.1, 0.04, 0.015).warped(bend))
    if chance(rng, 0.8):
        office_arms(rng, build, w, d, h, thick, dark)
    return build


def office_arms(
    rng: Generator, build: Builder, w: float, d: float, h: float, thick: float, paint: Paint
) -> None:
    """Rests on a single post, or loops from the seat to the back."""
    top, x = h + between(rng, 0.17, 0.23), w / 2 + 0.04
    rest = shapes.rounded_box((0.07, 0.03, between(rng, 0.22, 0.30)), (x, top, -0.02), 0.012)
    build.add(paint, rest.pair())
    low = h - thick - 0.01
    if chance(rng, 0.5):
        post = [(w * 0.2, low, 0), (x, low + 0.01, 0), (x, top, 0)]
        build.add(paint, shapes.tube(post, 1.0, section=shapes.rectangle(0.05, 0.022), up=(0, 0, -1)).pair())
    else:
        loop = [
            (w * 0.3, low, -d * 0.2),
            (x, low + 0.03, -d * 0.25),
            (x, top, -d * 0.30),
            (x, top, d * 0.25),
            (w * 0.45, h + 0.12, d * 0.46),
        ]
        build.add(paint, shapes.tube(shapes.smooth_path(loop, 4), 0.014, sides=7).pair())


def cantilever(rng: Generator) -> Builder:
    """A bent tube without rear legs, with two pads or one sling, arms or none."""
    build = Builder()
    metal = paints.metal(rng)
    w, d, h = between(rng, 0.42, 0.52), between(rng, 0.40, 0.48), between(rng, 0.43, 0.47)
    high, rake = between(rng, 0.34, 0.55), between(rng, 8, 18)
    x, lean = w / 2, np.tan(np.radians(rake))
    z0, z1 = -d / 2, d / 2
    r = between(rng, 0.010, 0.014)
    path = [
        (0, h + high, z1 + high * lean),
        (x, h + high, z1 + high * lean),
        (x, h + 0.05, z1 + 0.05 * lean),
        (x, h, z1 - 0.05),
    ]
    path += [
        (x, h, z0 + 0.04),
        (x, h - 0.05, z0),
        (x, 0.06, z0 + 0.01),
        (x, r, z0 + 0.06),
        (x, r, z1),
        (0, r, z1),
    ]
    build.add(metal, shapes.tube(path, r, sides=8).pair())
    paint = pick(rng, ("wicker", "leather", "fabric", "wood"))
    cover = {
        "wicker": paints.wicker,
        "leather": paints.leather,
        "fabric": paints.fabric,
        "wood": paints.wood,
    }[paint](rng)
    thick = between(rng, 0.012, 0.05)
    build.add(
        cover, slab(shapes.rectangle(w, d * 0.94, 0.03), h - thick * 0.3, thick, thick * 0.4, thick * 0.2)
    )
    bend = Bend(w, high, h, z1, rake, 0.0, between(rng, 0.0, 0.03))
    low = high * (between(rng, 0.35, 0.6) if chance(rng, 0.6) else 0.05)
    build.add(
        cover,
        panel(
            shapes.rectangle(w * 0.98, high - low, 0.02, centre=(0, (high + low) / 2)), thick, thick * 0.4
        ).warped(bend),
    )
    if chance(rng, 0.5):
        y = h + between(rng, 0.18, 0.23)
        arm = [
            (x, h - 0.08, z0 + 0.003),
            (x + 0.02, y - 0.03, z0 + 0.01),
            (x + 0.02, y, z0 + 0.05),
            (x, y, z1 + (y - h) * lean),
        ]
        build.add(metal, shapes.tube(arm, r, sides=8).pair())
        rest = paints.wood(rng) if chance(rng, 0.5) else cover
        build.add(rest, shapes.rounded_box((0.04, 0.02, d * 0.7), (x + 0.02, y + r, 0.02), 0.008).pair())
    return build


def garden(rng: Generator) -> Builder:
    """A stackable garden chair of one colour, its back slotted, its arms and legs flat."""
    build = Builder()
    paint = paints.plastic(rng) if chance(rng, 0.6) else paints.painted(rng)
    w, d, h, high = (
        between(rng, 0.44, 0.52),
        between(rng, 0.42, 0.48),
        between(rng, 0.38, 0.44),
        between(rng, 0.36, 0.56),
    )
    build.add(paint, slab(seat_outline(w, w * 0.86, d, 0.06), h - 0.02, 0.02, 0.008))
    bend = Bend(
        w * 0.9, high, h, d / 2, between(rng, 10, 20), 0.08, between(rng, 0.04, 0.08), between(rng, 0.0, 0.12)
    )
    half = w * 0.45
    count = int(rng.integers(4, 9))
    for x in np.linspace(-half, half, count):
        build.add(paint, upright(float(x), -0.01, high - 0.03, 2 * half / count * 0.62, 0.012).warped(bend))
    build.add(paint, rail(high - 0.03, half * 1.08, 0.07, 0.016, between(rng, 0.0, 0.05)).warped(bend))
    rest = h + between(rng, 0.17, 0.22)
    shoulder = bend(np.array([[half, rest - h, 0.0]]))[0]
    x = w / 2 + 0.05
    arm = [
        tuple(shoulder),
        (x, rest, 0.05),
        (x, rest, -d * 0.38),
        (x + 0.005, rest - 0.04, -d * 0.48),
        (x + 0.03, 0, -d * 0.62),
    ]
    build.add(paint, _strap(arm).pair())
    build.add(paint, leg("taper", h, 0.045).moved(w * 0.44, 0, d * 0.42).warped(
        lambda v: v + np.outer(1 - v[:, 1] / h, (0.0, 0.0, 0.07))).pair())  # fmt: skip
    build.add(
        paint, shapes.bar((w * 0.48, h - 0.02, -d * 0.44), (x + 0.01, h - 0.03, -d * 0.53), 0.03, 0.02).pair()
    )
    return build


def _strap(path: list[tuple[float, ...]]) -> Solid:
    """A flat band along an arm and down to the foot, round enough for either."""
    return shapes.tube(shapes.smooth_path(path, 4), 1.0, section=shapes.rectangle(0.045, 0.024, 0.006))
