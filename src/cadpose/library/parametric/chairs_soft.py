"""Armchairs: club chairs, wing chairs and bergeres, tubs of cloth or cane, upholstered dining chairs."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.chairs_frame import outline_of
from cadpose.library.parametric.chairs_shell import star_base
from cadpose.library.parametric.seating import (
    Bend,
    between,
    chance,
    four_legs,
    panel,
    pick,
    seat_outline,
    slab,
)
from cadpose.library.parametric.solids import Builder
from cadpose.library.parametric.upholstered import cushion, upholstered


def club(rng: Generator) -> Builder:
    """A sofa for one."""
    return upholstered(rng, 1, 1)


def wing(rng: Generator) -> Builder:
    """A high back with wings at its sides that go over into the arms."""
    build = Builder()
    soft = paints.upholstery(rng)
    wood = paints.wood(rng, 0.5)
    w, d, h = between(rng, 0.50, 0.60), between(rng, 0.52, 0.64), between(rng, 0.40, 0.46)
    top, rest = between(rng, 0.95, 1.22), h + between(rng, 0.16, 0.24)
    legs, t = between(rng, 0.10, 0.22), between(rng, 0.07, 0.12)
    rake = between(rng, 6, 14)
    lean = float(np.tan(np.radians(rake)))
    z0, z1 = -d / 2, d / 2
    high = top - legs
    bend = Bend(w, high, legs, z1 - 0.04, rake, 0.02)
    crest = outline_of(pick(rng, ("plain", "arch")), w / 2 + t * 0.5, 0.02, high, rng)
    build.add(soft, panel(crest, between(rng, 0.10, 0.15), 0.05).warped(bend))
    build.add(soft, shapes.rounded_box((w + t, h - 0.12 - legs, d), (0, (h - 0.12 + legs) / 2, 0), 0.015))
    pad = cushion(w - 0.01, 0.14, d - 0.04, between(rng, 0.3, 0.9))
    build.add(soft, pad.moved(0, h - 0.13, -0.03))
    # From the side: a wing that comes forward at the head and sweeps down into the arm.
    reach = between(rng, 0.12, 0.24)

    def behind(y: float) -> float:
        return z1 + (y - legs) * lean

    side = [(behind(legs), legs), (behind(top * 0.97), top * 0.97)]
    sweep = [(behind(top * 0.97) - reach, top * 0.955), (behind(top * 0.8) - reach, top * 0.80),
             (behind(rest) - reach * 0.8, rest + 0.05), (z0 + 0.10, rest),
             (z0 + 0.02, rest - 0.04)]  # fmt: skip
    side += [tuple(p) for p in shapes.smooth_path(sweep, 3)]
    side += [(z0 + 0.03, legs)]
    build.add(soft, shapes.extrude(side, t, "zy", t * 0.42).moved(w / 2 + t / 2).pair())
    if chance(rng, 0.5):
        roll = shapes.tube(
            [(w / 2 + t / 2, rest - 0.02, z0), (w / 2 + t / 2, rest - 0.01, z1 - 0.05)], t * 0.72, sides=14
        )
        build.add(soft, roll.pair())
    four_legs(
        build,
        wood,
        pick(rng, ("taper", "turned", "cabriole", "square", "splayed")),
        w,
        d - 0.08,
        legs + 0.01,
        0.05,
    )
    if chance(rng, 0.3):
        one = shapes.pillow((0.40, 0.14, 0.26), puff=0.5).turned("x", -80)
        build.add(paints.fabric(rng, 0.6), one.moved(0, h + 0.15, z1 - 0.13))
    return build


def tub(rng: Generator) -> Builder:
    """A wall that curves around the seat, lower at the front: cloth, leather, velvet or cane."""
    build = Builder()
    cane = chance(rng, 0.25)
    body = paints.wicker(rng) if cane else paints.upholstery(rng)
    w, d = between(rng, 0.62, 0.80), between(rng, 0.60, 0.76)
    h = between(rng, 0.40, 0.46)
    legs = between(rng, 0.10, 0.2) if chance(rng, 0.75) else 0.02
    high, rest = h + between(rng, 0.28, 0.46), h + between(rng, 0.08, 0.22)
    t = between(rng, 0.03, 0.05) if cane else between(rng, 0.07, 0.13)
    open_to = between(rng, 118, 150)
    angle = np.radians(np.linspace(-open_to, open_to, 25))
    low = legs if chance(rng, 0.7) else h - 0.14
    # The wall's height falls from the back's middle to the arms' tips, soon or late.
    fall = 0.5 + 0.5 * np.cos(
        np.clip(np.abs(angle) / np.radians(open_to), 0, 1) ** between(rng, 0.8, 2.2) * np.pi
    )
    crest = rest + (high - rest) * fall
    rows = []
    lean = between(rng, 0.0, 0.08)
    square = between(rng, 2.0, 3.4)
    c, s = np.cos(angle), np.sin(angle)
    r = (np.abs(c) ** square + np.abs(s) ** square) ** (-1 / square)
    for k in range(len(angle)):
        outline = shapes.rectangle(t, crest[k] - low, t * 0.45, 3, centre=(0, (crest[k] + low) / 2))
        out = 1.0 + (outline[:, 1] - low) / (high - low) * lean
        x = (w / 2 - t / 2 + outline[:, 0]) * r[k] * s[k] * out
        z = (d / 2 - t / 2 + outline[:, 0]) * r[k] * c[k] * out
        rows.append(np.column_stack([x, outline[:, 1], z]))
    wall = shapes.loft(rows)
    build.add(body, wall)
    a = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    q = (np.abs(np.cos(a)) ** square + np.abs(np.sin(a)) ** square) ** (-1 / square)
    floor = np.column_stack([np.cos(a) * q * (w / 2 - t * 0.7), np.sin(a) * q * (d / 2 - t * 0.7)])
    floor[:, 1] = np.clip(floor[:, 1] * 1.08, None, d / 2)
    build.add(
        body,
        slab(
            floor,
            max(legs, low) if low == legs else h - 0.14,
            h - 0.12 - max(legs, low) if low == legs else 0.04,
            0.01,
        ),
    )
    pad = paints.upholstery(rng) if cane or chance(rng, 0.2) else body
    build.add(pad, slab(floor * 0.97, h - 0.13, 0.12, 0.045, 0.02))
    if legs > 0.05:
        if chance(rng, 0.15):
            star_base(rng, build, legs + 0.04, paints.metal(rng))
        else:
            wood = paints.metal(rng) if chance(rng, 0.3) else paints.wood(rng, 0.5)
            four_legs(
                build,
                wood,
                pick(rng, ("taper", "round", "splayed")),
                w * 0.58,
                d * 0.58,
                max(legs, low) + 0.02,
                0.045,
            )
    return build


def parsons(rng: Generator) -> Builder:
    """An upholstered dining chair: seat and back in cloth down to the legs, sometimes with arms."""
    build = Builder()
    soft = paints.upholstery(rng)
    wood = paints.wood(rng, 0.5) if chance(rng, 0.7) else paints.metal(rng)
    w, d, h = between(rng, 0.43, 0.56), between(rng, 0.42, 0.52), between(rng, 0.45, 0.50)
    high, t = between(rng, 0.32, 0.62), between(rng, 0.05, 0.10)
    skirt = between(rng, 0.08, 0.16)
    build.add(
        soft, slab(seat_outline(w, w * between(rng, 0.85, 1.0), d, 0.05), h - skirt, skirt, 0.03, 0.012)
    )
    bend = Bend(
        w,
        high + skirt,
        h - skirt,
        d / 2 - t / 2,
        between(rng, 3, 14),
        between(rng, 0, 0.1),
        between(rng, 0, 0.07),
    )
    gap = 0.0 if chance(rng, 0.8) else skirt + 0.06
    form = outline_of(
        pick(rng, ("plain", "arch", "round") if gap else ("plain", "arch")), w / 2, gap, high + skirt, rng
    )
    build.add(soft, panel(form, t, t * 0.4).warped(bend))
    if gap:
        for s in (1, -1):
            build.add(
                wood,
                shapes.tube([(s * w * 0.3, 0.02, 0.0), (s * w * 0.3, gap + 0.1, 0.0)], 0.014).warped(bend),
            )
    if chance(rng, 0.3):
        y = h + between(rng, 0.16, 0.22)
        arm = [(w / 2, h - 0.04, -d * 0.3), (w / 2 + 0.04, y, -d * 0.32)]
        arm += [(w / 2 + 0.03, y + 0.02, d * 0.1), (w / 2 - 0.01, y + 0.03, d * 0.5)]
        path = shapes.smooth_path(arm, 5)
        build.add(
            soft if chance(rng, 0.5) else wood, shapes.tube(path, between(rng, 0.018, 0.035), sides=9).pair()
        )
    style = pick(rng, ("square", "taper", "round", "splayed", "turned", "hairpin"))
    four_legs(build, wood, style, w * 0.8, d * 0.8, h - skirt + 0.02, between(rng, 0.035, 0.05))
    return build
