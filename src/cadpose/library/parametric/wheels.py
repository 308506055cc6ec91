"""Wheels of road vehicles."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric.paints import Colour, plain
from cadpose.library.parametric.shapes import bar, cylinder, lathe, loft, torus
from cadpose.library.parametric.solids import Builder, Paint, Solid

RUBBER = plain((0.07, 0.07, 0.075), "tyre")
_RIM_COLOURS: tuple[Colour, ...] = (
    (0.78, 0.79, 0.81), (0.65, 0.66, 0.69), (0.45, 0.46, 0.49), (0.16, 0.16, 0.18), (0.86, 0.86, 0.87),
)  # fmt: skip


def along_x(upright: Solid) -> Solid:
    """A solid whose axis is y, laid along x: its top points to the object's own right."""
    return upright.turned("z", -90.0)


def car_wheel(
    radius: float,
    width: float,
    rim: Paint,
    spokes: int,
    sides: int = 15,
    cap: bool = False,
    bright: float = 0.0,
) -> Builder:
    """A wheel about the origin, its axis along x, its outer side to +x.

    Args:
        radius: The tyre's.
        width: The tyre's.
        rim: Look of the rim.
        spokes: How many; 0 draws a steel disc.
        sides: Vertices around.
        cap: A large hub cap.
        bright: White wall of the tyre as a share of the radius, 0 for none.
    """
    r, w = radius, width
    tyre = lathe(
        [
            (0.66 * r, -0.5 * w), (0.92 * r, -0.5 * w), (r, -0.32 * w), (r, 0.32 * w), (0.92 * r, 0.5 * w),
            (0.70 * r, 0.5 * w), (0.67 * r, 0.22 * w),
        ],
        sides,
    )  # fmt: skip
    out = Builder()
    out.add(RUBBER, along_x(tyre))
    out.add(rim, along_x(torus(0.665 * r, 0.035 * r, (0, 0.44 * w, 0), sides, 3)))
    if bright:
        band = torus((0.90 - bright / 2) * r, 0.5 * bright * r, sides=sides, around=4)
        out.add(plain((0.9, 0.9, 0.88), "white wall"), along_x(band.scaled(y=0.15).moved(y=0.5 * w)))
    if spokes:
        for k in range(spokes):
            angle = 2 * np.pi * k / spokes
            tip = (0.38 * w, 0.65 * r * float(np.cos(angle)), 0.65 * r * float(np.sin(angle)))
            wide = min(0.28 * r, 1.1 * r / spokes)
            spoke = bar((0.42 * w, 0.0, 0.0), tip, wide, 0.12 * w)
            out.add(rim, spoke)
        out.add(rim, along_x(cylinder(0.17 * r, 0.1 * w, (0, 0.36 * w, 0), 10)))
    else:
        disc = lathe(
            [(0.63 * r, 0.2 * w), (0.62 * r, 0.36 * w), (0.45 * r, 0.40 * w), (0.3 * r, 0.36 * w)], sides
        )
        out.add(rim, along_x(disc))
        out.add(rim, along_x(lathe([(0.2 * r, 0.3 * w), (0.16 * r, 0.5 * w)], 10)))
    if cap:
        dome = lathe([(0.55 * r, 0.36 * w), (0.5 * r, 0.45 * w), (0.2 * r, 0.52 * w)], sides)
        out.add(plain((0.82, 0.83, 0.85), "hub cap"), along_x(dome))
    return out


def rim_paint(rng: Generator) -> Paint:
    """Alloy from silver to black."""
    return plain(_RIM_COLOURS[int(rng.choice(len(_RIM_COLOURS), p=[0.35, 0.25, 0.15, 0.15, 0.1]))], "rim")


MIRROR_X = np.diag([-1.0, 1.0, 1.0])


def spoked_wheel(
    radius: float,
    thickness: float,
    rim: Paint,
    tyre: Paint,
    spokes: int,
    sides: int = 30,
    wire: float = 0.0025,
) -> Builder:
    """A narrow wheel with wire spokes about the origin, its axis along x: of bicycles and motorbikes.

    Args:
        radius: The tyre's outer one.
        thickness: The tyre's.
        rim: Look of the rim and the spokes.
        tyre: Look of the tyre.
        spokes: How many.
        sides: Vertices around.
        wire: A spoke's radius.
    """
    out = Builder()
    ring = radius - thickness / 2
    out.add(tyre, along_x(torus(ring, thickness / 2, sides=sides, around=7)))
    inner = ring - 0.6 * thickness
    out.add(rim, along_x(torus(inner, 0.3 * thickness, sides=sides, around=4)))
    hub = min(0.09 * radius, 0.035)
    out.add(rim, along_x(cylinder(hub, 1.6 * thickness + 0.02, (0, -0.8 * thickness - 0.01, 0), 8)))
    for k in range(spokes):
        a = 2 * np.pi * k / spokes
        side = (1 if k % 2 else -1) * (0.6 * thickness + 0.005)
        b = a + (0.35 if k % 4 < 2 else -0.35)
        start = (side, hub * float(np.cos(b)), hub * float(np.sin(b)))
        end = (0.0, inner * float(np.cos(a)), inner * float(np.sin(a)))
        out.add(rim, bar(start, end, 2 * wire, 2 * wire))
    return out


def cast_wheel(radius: float, thickness: float, rim: Paint, spokes: int, sides: int = 28) -> Builder:
    """A motorbike's wheel with a few thick spokes, about the origin, its axis along x."""
    out = Builder()
    section = [(0.72, -0.45), (0.9, -0.5), (1.0, -0.2), (1.0, 0.2), (0.9, 0.5), (0.72, 0.45)]
    ring = _ring([(radius * a, thickness * b) for a, b in section], sides)
    out.add(RUBBER, along_x(ring))
    out.add(rim, along_x(torus(0.71 * radius, 0.035 * radius, sides=sides, around=4).scaled(y=2.2)))
    for k in range(spokes):
        a = 2 * np.pi * k / spokes + 0.3
        end = (0.0, 0.7 * radius * float(np.cos(a)), 0.7 * radius * float(np.sin(a)))
        out.add(rim, bar((0.0, 0.0, 0.0), end, 0.1 * radius, 0.35 * thickness))
    out.add(rim, along_x(cylinder(0.14 * radius, 0.9 * thickness, (0, -0.45 * thickness, 0), 12)))
    return out


def _ring(profile: list[tuple[float, float]], sides: int) -> Solid:
    """A closed (radius, y) outline turned about y, with a hole in the middle."""
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    outline = np.asarray(profile)
    rows = np.stack(
        [
            np.cos(angle)[:, None] * outline[:, 0],
            np.broadcast_to(outline[:, 1], (sides, len(outline))),
            np.sin(angle)[:, None] * outline[:, 0],
        ],
        axis=2,
    )
    return loft(rows, ring=True)
