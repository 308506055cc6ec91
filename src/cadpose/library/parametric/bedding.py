"""What lies on a bed: mattress, duvet or bedspread, throw, pillows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import paints, shapes
from cadpose.library.parametric.seating import between, chance
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid

Waves = Callable[[Array, Array], Array]


def linen(rng: Generator) -> Paint:
    """Bed linen: white and pale often, else any fabric, with a pattern more often than furniture."""
    kind = rng.random()
    if kind < 0.35:
        shade = between(rng, 0.86, 0.96)
        return paints.plain((shade, shade, shade * between(rng, 0.94, 1.0)), "linen")
    return paints.fabric(rng, 0.45)


def _along(half: float, drop: float, inner: int, hang: int = 3) -> Array:
    """Where the threads of a cloth lie that hangs over both sides of a width."""
    flat = np.linspace(-half, half, inner)
    down = np.linspace(0.0, drop, hang + 1)[1:]
    return np.concatenate([-half - down[::-1], flat, half + down]) if drop > 0 else flat


def folds(rng: Generator) -> Waves:
    """Some shallow waves in two directions."""
    several = [
        (rng.uniform(2, 11), rng.uniform(2, 9) * rng.choice([-1, 1]), rng.uniform(0, 6.3)) for _ in range(4)
    ]
    amount = between(rng, 0.001, 0.007)

    def height(x: Array, z: Array) -> Array:
        return np.asarray(amount * np.sum([np.sin(a * x + b * z + c) for a, b, c in several], axis=0))

    return height


def drape(
    rng: Generator,
    half: float,
    top: float,
    z_from: float,
    z_to: float,
    drop: float,
    foot: float,
    lift: float,
    waves: Waves,
) -> Array:
    """(R, C, 3) grid of a cloth on a mattress, from ``z_from`` to ``z_to`` < ``z_from``.

    Args:
        rng: Draws the folds.
        half: Half the mattress's width.
        top: Height of the mattress.
        z_from: Where the cloth begins, towards the head.
        z_to: Where the mattress, or the cloth on it, ends towards the foot.
        drop: How far it hangs down at the sides.
        foot: How far it hangs down at the foot; 0 if not at all.
        lift: How far it lies above the mattress.
        waves: Height of the folds at x and z; the same for all cloths of a bed, so that none pokes through.
    """
    u = _along(half, drop, 13)
    v = np.linspace(z_from, z_to, 13)
    if foot > 0:
        v = np.concatenate([v, z_to - np.linspace(0.0, foot, 4)[1:]])
    x, z = np.meshgrid(u, v)
    over_x, over_z = np.maximum(np.abs(x) - half, 0.0), np.maximum(z_to - z, 0.0)
    on_top = (over_x == 0) & (over_z == 0)
    # Full in the middle, drawn down to the mattress's edges.
    round_ = 1.0 - 0.6 * np.clip(np.abs(x) / half, 0, 1) ** 6
    y = top + lift * round_ + np.where(on_top, waves(x, z), 0.0) - np.maximum(over_x, over_z)
    wave = 0.012 * np.sin(z * rng.uniform(9, 16)) * np.minimum(over_x / 0.1, 1.0)
    wave_z = 0.012 * np.sin(x * rng.uniform(9, 16)) * np.minimum(over_z / 0.1, 1.0)
    x = np.clip(x, -half, half) + np.sign(x) * np.where(over_x > 0, lift + 0.01 + wave, 0.0)
    z = np.maximum(z, z_to) - np.where(over_z > 0, lift + 0.01 + wave_z, 0.0)
    return np.stack([x, y, z], axis=2)


def hem(grid_row: Array, radius: float) -> Solid:
    """The thick edge of a duvet along a row of its grid."""
    return shapes.tube(grid_row, radius, sides=7).moved(y=-radius * 0.6)


def make_up(
    rng: Generator,
    build: Builder,
    width: float,
    length: float,
    low: float,
    thick: float,
    foot_free: bool,
    x: float = 0.0,
) -> float:
    """A mattress with its bedding, its head towards +z; returns the mattress's top.

    Args:
        rng: Draws everything.
        build: Takes the parts.
        width: Of the mattress.
        length: Of the mattress.
        low: Height of its underside.
        thick: Thickness of the mattress.
        foot_free: The cover may hang down at the foot.
        x: Where its middle is.
    """
    made = Builder()
    top, half = low + thick, width / 2
    sheet = paints.plain((0.93, 0.93, 0.91), "sheet") if chance(rng, 0.7) else linen(rng)
    made.add(
        sheet, shapes.rounded_box((width, thick, length), (0, low + thick / 2, 0), min(0.06, thick * 0.35), 2)
    )
    style = rng.random()
    head, end = length / 2, -length / 2
    cover, waves = linen(rng), folds(rng)
    if style < 0.92:
        spread = style < 0.22
        begin = head - between(rng, 0.05, 0.12) if spread else head - between(rng, 0.48, 0.8)
        drop = between(rng, 0.10, thick + 0.12) if chance(rng, 0.8) else 0.0
        foot = min(drop, low + thick - 0.02) if foot_free and chance(rng, 0.8) else 0.0
        lift = 0.012 if spread else between(rng, 0.025, 0.06)
        until = end + (0.0 if foot > 0 else 0.02)
        cloth = drape(rng, half, top, begin, until, drop, foot, lift, waves)
        made.add(cover, shapes.grid(cloth))
        if not spread:
            made.add(cover, hem(cloth[0], lift * 0.6))
            if chance(rng, 0.55):
                fold = between(rng, 0.16, 0.42)
                back = linen(rng) if chance(rng, 0.7) else sheet
                band = drape(rng, half, top, begin + 0.01, begin - fold, drop * 0.98, 0.0, lift * 1.45, waves)
                made.add(back, shapes.grid(band), hem(band[-1], lift * 0.4))
        if chance(rng, 0.35):
            deep = between(rng, 0.3, 0.6)
            at = end + between(rng, 0.05, 0.3) + deep
            throw = drape(
                rng,
                half,
                top,
                at,
                at - deep,
                max(drop, 0.08) * between(rng, 0.7, 1.1),
                0.0,
                lift + 0.016,
                waves,
            )
            made.add(paints.fabric(rng, 0.4), shapes.grid(throw))
    pillows(rng, made, width, head, top, cover, sheet)
    build.include(made, offset=(x, 0.0, 0.0))
    return top


def pillows(
    rng: Generator, build: Builder, width: float, head: float, top: float, cover: Paint, sheet: Paint
) -> None:
    """One or two side by side, perhaps a second row that leans, perhaps small ones in front."""
    count = 1 if width < 1.25 else 2
    wide = min(between(rng, 0.52, 0.74), width / count * 0.95)
    deep, thick = between(rng, 0.38, 0.5), between(rng, 0.12, 0.2)
    paint = pick_paint(rng, (cover, sheet, linen(rng)))
    lean = between(rng, 8, 22) if chance(rng, 0.6) else between(rng, 40, 70)
    rows = 2 if chance(rng, 0.35) else 1
    for row in range(rows):
        angle = np.radians(lean)
        y = top + deep / 2 * np.sin(angle) + thick * 0.32 * np.cos(angle) + 0.02
        z = head - 0.06 - deep / 2 * np.cos(angle) - thick * 0.4 * np.sin(angle) - row * (thick * 0.8 + 0.06)
        for k in range(count):
            x = (k - (count - 1) / 2) * width / count
            one = (
                shapes.pillow((wide, thick, deep), puff=0.5)
                .turned("x", -lean)
                .turned("y", between(rng, -5, 5))
            )
            build.add(paint, one.moved(x, float(y), float(z)))
        paint = pick_paint(rng, (cover, sheet, linen(rng)))
        lean = max(lean - 10, 8)
    if chance(rng, 0.3):
        paint = paints.fabric(rng, 0.6)
        small = between(rng, 0.28, 0.42)
        number = int(rng.integers(1, 1 + min(3, count + 1)))
        for k in range(number):
            one = (
                shapes.pillow((small, 0.12, small * 0.8), puff=0.55)
                .turned("x", -60)
                .turned("y", between(rng, -15, 15))
            )
            x = (k - (number - 1) / 2) * small * 1.05
            build.add(paint, one.moved(x, top + small * 0.42, head - 0.42 - (rows - 1) * 0.2))


def pick_paint(rng: Generator, several: tuple[Paint, ...]) -> Paint:
    """One of several paints."""
    return several[int(rng.integers(len(several)))]
