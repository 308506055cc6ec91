"""Bodies along the length of a vehicle or a device: hulls through sections, mudguards, panels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cadpose.library.parametric.shapes import extrude, loft, plate
from cadpose.library.parametric.solids import Array, Solid


def hull(rows: Sequence[tuple[float, float, float, float]], square: float = 0.7, sides: int = 14) -> Solid:
    """A body along z through superellipses.

    Args:
        rows: (z, middle y, half width, half height) of each section, z growing.
        square: Exponent: 1 for ellipses, near 0 for rectangles.
        sides: Points of a section.
    """
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False) + np.pi / sides
    c, s = np.cos(angle), np.sin(angle)
    across, up = np.sign(c) * np.abs(c) ** square, np.sign(s) * np.abs(s) ** square
    sections = [
        np.stack([half * across, middle + high * up, np.full(sides, z)], axis=1)
        for z, middle, half, high in rows
    ]
    return loft(np.array(sections))


def tower(rows: Sequence[tuple[float, float, float, float]], square: float = 0.7, sides: int = 16) -> Solid:
    """A body along y through superellipses: (y, middle z, half width in x, half depth in z), y growing."""
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False) + np.pi / sides
    c, s = np.cos(angle), np.sin(angle)
    across, deep = np.sign(c) * np.abs(c) ** square, np.sign(s) * np.abs(s) ** square
    sections = [
        np.stack([half * across, np.full(sides, y), middle - depth * deep], axis=1)
        for y, middle, half, depth in rows
    ]
    return loft(np.array(sections))


def mudguard(
    radius: float, width: float, start: float, end: float, centre: tuple[float, float, float], steps: int = 9
) -> Solid:
    """A curved plate over a wheel whose axis is x.

    Args:
        radius: Of its crown.
        width: Across.
        start: Degrees from the front (-z) over the top (90) to the back (180), where it begins.
        end: Where it ends.
        centre: The axle.
        steps: Points along it.
    """
    angle = np.radians(np.linspace(start, end, steps))[:, None]
    side = np.array([-1.0, -0.75, 0.0, 0.75, 1.0])[None]
    r = radius - 0.3 * width * np.abs(side) ** 3
    rows = np.stack(
        [np.broadcast_to(side * width / 2, (steps, 5)), r * np.sin(angle), -r * np.cos(angle)], axis=2
    )
    return plate(rows, 0.006).moved(*centre)


def side_panel(outline: ArrayLike, x: float, thick: float, narrow: tuple[float, float] = (0.0, 0.0)) -> Solid:
    """A panel to each side, cut out in side view.

    Args:
        outline: (N, 2) corners as (z, y).
        x: Where the panels' middles lie, at the outline's highest, rearmost corner.
        thick: Thickness.
        narrow: How far the panels lie in at the front and at the bottom.
    """
    flat = np.asarray(outline, np.float64)
    (z0, y0), (z1, y1) = flat.min(axis=0), flat.max(axis=0)

    def bend(points: Array) -> Array:
        ahead = (z1 - points[:, 2]) / max(z1 - z0, 1e-6)
        below = (y1 - points[:, 1]) / max(y1 - y0, 1e-6)
        out = points.copy()
        out[:, 0] += x - narrow[0] * ahead**2 - narrow[1] * below**2
        return out

    return extrude(flat, thick, "zy").warped(bend).pair()
