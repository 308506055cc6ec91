"""Toilets: pedestal with tank behind, or hung on the wall; the bowl reaches to -z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.finishes import CHROME, STEEL
from cadpose.library.parametric.hulls import tower
from cadpose.library.parametric.paints import plain, wood
from cadpose.library.parametric.shapes import bar, box, cylinder, loft, rounded_box
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid


def _egg(wide: float, front: float, back: float, sides: int = 28) -> Array:
    """(N, 2) outline as (x, z): round at the front, flatter at the back."""
    a = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    x, z = wide * np.cos(a), -np.sin(a)
    z = np.where(z < 0, z * front, z * back)
    return np.stack([x * np.where(z > 0, 1 - 0.12 * (z / back) ** 2, 1.0), z], 1)


def _stack(rows: list[tuple[float, float, float, float, float]]) -> Solid:
    """A body through eggs: (y, half width, reach to the front, reach to the back, shift in z)."""
    sections = []
    for y, wide, front, back, shift in rows:
        flat = _egg(wide, front, back)
        sections.append(np.column_stack([flat[:, 0], np.full(len(flat), y), flat[:, 1] + shift]))
    return loft(np.array(sections))


def toilet(rng: Generator) -> Mesh:
    """Any kind of toilet."""
    u = rng.uniform
    build = Builder()
    white = plain([(0.95, 0.95, 0.94), (0.95, 0.95, 0.94), (0.90, 0.87, 0.78), (0.72, 0.80, 0.82), (0.2, 0.2,
        0.21)][int(rng.choice(5, p=[0.5, 0.3, 0.1, 0.06, 0.04]))], "ceramic")  # fmt: skip
    seat: Paint = white if rng.random() < 0.75 else (wood(rng) if rng.random() < 0.6 else plain((0.15, 0.15,
        0.16), "seat"))  # fmt: skip
    high = u(0.37, 0.42)
    wide, front, back = u(0.17, 0.19), u(0.3, 0.35), 0.2
    hung = rng.random() < 0.22
    low = 0.12 if hung else 0.0
    if hung:
        rows = [(low, 0.6 * wide, 0.1, 0.2, 0.05), (low + 0.05, 0.75 * wide, 0.55 * front, 0.2, 0.02),
            (0.8 * high, 0.97 * wide, 0.95 * front, back, 0.0), (high, wide, front, back, 0.0)]  # fmt: skip
    else:
        waist = u(0.5, 0.75)
        rows = [(0.0, 0.7 * wide, 0.5 * front, 0.26, 0.04), (0.03, 0.68 * wide, 0.48 * front, 0.25, 0.04),
            (0.4 * high, waist * wide, 0.45 * front, 0.24, 0.03), (0.72 * high, 0.9 * wide, 0.85 * front,
            0.22, 0.0), (0.94 * high, wide, front, back, 0.0), (high, wide, front, back, 0.0)]  # fmt: skip
    build.add(white, _stack(rows))
    build.add(white, rounded_box((1.5 * wide, 0.2, 0.16), (0, high - 0.1, back - 0.02), 0.04))
    y = high + 0.002
    if rng.random() < 0.6:
        build.add(seat, _stack([(y, 1.02 * wide, front + 0.008, 0.16, 0.0), (y + 0.018, 1.02 * wide,
            front + 0.008, 0.16, 0.0)]))  # fmt: skip
        build.add(seat, _stack([(y + 0.021, 1.02 * wide, front + 0.008, 0.16, 0.0), (y + 0.034, wide, front,
            0.16, 0.0), (y + 0.04, 0.9 * wide, 0.9 * front, 0.14, 0.0)]))  # fmt: skip
    else:
        _open_seat(build, seat, wide, front, y)
        lid = _stack([(0.0, 1.02 * wide, front + 0.008, 0.16, 0.0), (0.014, wide, front, 0.16, 0.0)])
        build.add(seat, lid.moved(z=-0.16).turned("x", 86).moved(y=y + 0.025, z=0.07))
    for x in (-0.07, 0.07):
        build.add(CHROME if rng.random() < 0.5 else seat, cylinder(0.014, 0.035, (x, y, 0.155), 10))
    if hung:
        build.add(white if rng.random() < 0.5 else plain((0.78, 0.77, 0.74), "wall box"), box((u(0.45, 0.6),
            u(0.95, 1.15), 0.12), (0, 0.5, back + 0.06)))  # fmt: skip
        build.add(CHROME, rounded_box((0.22, 0.15, 0.012), (0, 0.82, back - 0.004), 0.004))
        build.add(STEEL, cylinder(0.035, 0.008, sides=14).turned("x", -90).moved(0.04, 0.82, back - 0.008))
        return build.mesh("toilet")
    tall = u(0.32, 0.4)
    base = high - 0.01
    tank = u(0.18, 0.23)
    if rng.random() < 0.25:
        # A cistern high up on its pipe.
        rise = u(0.25, 0.5)
        build.add(white, bar((0, high - 0.1, back + 0.03), (0, base + rise + 0.02, back + 0.03), 0.05))
        base += rise
    build.add(white, tower([(base, back + 0.0, 0.9 * tank, 0.085), (base + 0.04, back + 0.0, tank, 0.095),
        (base + tall, back + 0.0, 1.04 * tank, 0.1)], 0.25, 20))  # fmt: skip
    build.add(white, rounded_box((2.16 * tank, 0.035, 0.225), (0, base + tall + 0.012, back), 0.014))
    if rng.random() < 0.5:
        build.add(CHROME, cylinder(0.025, 0.01, (0, base + tall + 0.028, back), 16))
    else:
        build.add(CHROME, bar((0.12, base + tall - 0.05, back - 0.105), (0.04, base + tall - 0.055,
            back - 0.115), 0.014), cylinder(0.015, 0.02, sides=10).turned("x", -90).moved(0.12,
            base + tall - 0.05, back - 0.095))  # fmt: skip
    return build.mesh("toilet")


def _open_seat(build: Builder, seat: Paint, wide: float, front: float, y: float) -> None:
    """A ring with the bowl's dark water in it."""
    outer, inner = _egg(1.02 * wide, front + 0.008, 0.16), _egg(0.66 * wide, 0.72 * front, 0.09)
    # Outline, top and hole: a ring of four loops.
    loops = []
    for flat, level in ((outer, y), (outer, y + 0.02), (inner, y + 0.02), (inner, y)):
        loops.append(np.column_stack([flat[:, 0], np.full(len(flat), level), flat[:, 1]]))
    build.add(seat, loft(np.array(loops), ring=True))
    pool = np.column_stack([inner[:, 0], np.full(len(inner), y + 0.003), inner[:, 1]])
    build.add(plain((0.55, 0.6, 0.63), "bowl"), loft(np.stack([pool, pool + np.array([0, 0.001, 0])])))
    water = _egg(0.36 * wide, 0.36 * front, 0.04)
    surface = np.column_stack([water[:, 0], np.full(len(water), y + 0.005), water[:, 1]])
    build.add(plain((0.30, 0.38, 0.43), "water"), loft(np.stack([surface, surface + np.array([0, 0.001,
        0])])))  # fmt: skip
