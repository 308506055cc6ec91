"""What chairs, benches and sofas have in common: legs, seats, and backs that are built flat and then bent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cadpose.library.parametric import shapes
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid, joined


def chance(rng: Generator, share: float) -> bool:
    """True in that share of draws."""
    return bool(rng.random() < share)


def pick(rng: Generator, names: Sequence[str], weights: Sequence[float] | None = None) -> str:
    """One of several names."""
    p = None if weights is None else np.asarray(weights) / np.sum(weights)
    return names[int(rng.choice(len(names), p=p))]


def between(rng: Generator, low: float, high: float) -> float:
    """A number drawn evenly."""
    return float(rng.uniform(low, high))


def leg(style: str, height: float, thick: float) -> Solid:
    """A leg that stands at the origin, to be moved into the corner at +x, -z (front, own right)."""
    if style == "square":
        return shapes.rounded_box((thick, height, thick), (0, height / 2, 0), thick * 0.1)
    if style == "taper":
        return shapes.tube(
            [(0, height, 0), (0, 0, 0)], [thick, thick * 0.55], section=shapes.rectangle(1, 1), up=(0, 0, -1)
        )
    if style in ("round", "splayed"):
        lean = height * 0.16 if style == "splayed" else 0.0
        return shapes.tube([(0, height, 0), (lean, 0, -lean)], [thick * 0.55, thick * 0.32])
    if style == "turned":
        h, r = height, thick / 2
        profile = [
            (r * 0.5, 0), (r * 0.8, 0.03 * h), (r * 0.5, 0.10 * h), (r * 0.75, 0.35 * h), (r, 0.52 * h),
            (r * 0.5, 0.60 * h), (r * 0.95, 0.66 * h), (r * 0.5, 0.71 * h), (r, 0.78 * h), (r, h),
        ]  # fmt: skip
        return shapes.lathe(profile, 12)
    if style == "hairpin":
        wire = thick * 0.16
        return shapes.tube(
            [(-thick, height, 0), (thick * 0.2, 0.01, -thick * 0.2), (0, height, thick)], wire, sides=6
        )
    if style == "cabriole":
        h, t = height, thick
        path = [
            (0, h, 0),
            (t * 0.55, h * 0.8, -t * 0.55),
            (t * 0.1, h * 0.35, -t * 0.1),
            (t * 0.5, 0, -t * 0.5),
        ]
        return shapes.tube(shapes.smooth_path(path, 4), np.linspace(0.62, 0.28, 13) * t, sides=10)
    raise ValueError(f"no leg is called {style!r}")


def four_legs(
    builder: Builder, paint: Paint, style: str, width: float, depth: float, height: float, thick: float
) -> None:
    """A leg at each corner, width and depth from middle to middle."""
    one = leg(style, height, thick).moved(width / 2, 0, -depth / 2)
    builder.add(paint, one.pair(), one.mirrored("z").pair())


def seat_outline(front: float, back: float, depth: float, corner: float = 0.04) -> Array:
    """(N, 2) outline seen from above: (x, forward), rounded corners, wider in front than behind or not."""
    outline = shapes.rectangle(1.0, depth, corner, 4)
    share = outline[:, 1] / depth + 0.5
    half = np.sign(outline[:, 0]) * (0.5 - np.abs(outline[:, 0]))
    outline[:, 0] = np.sign(outline[:, 0]) * (back + (front - back) * share) / 2 - half
    return outline


def slab(outline: Array, y: float, thickness: float, radius: float, crown: float = 0.0) -> Solid:
    """A level plate of an outline (x, forward) about the origin; it lies on ``y``.

    ``crown`` lifts its middle, as a pad's.
    """
    solid = shapes.extrude(outline * (1.0, -1.0), thickness, "xz", radius).moved(0, y + thickness / 2, 0)
    if crown <= 0:
        return solid
    # The plate's top has no inner corners to lift: a low dome is laid on it.
    rings = []
    half = np.abs(outline).max(axis=0)
    to_ellipse = 1.0 / np.maximum(np.linalg.norm(outline / half, axis=1, keepdims=True), 1e-9)
    for angle in np.linspace(0.0, np.pi / 2, 5):
        # Rounder rings further in: the corners of square ones would show as folds.
        blend = 1.0 + (to_ellipse - 1.0) * np.sin(angle)
        flat = outline * blend * max(0.985 * float(np.cos(angle)), 1e-4)
        rise = y + thickness - radius * 0.5 + (crown + radius * 0.5) * np.sin(angle)
        rings.append(np.column_stack([flat[:, 0], np.full(len(flat), rise), -flat[:, 1]]))
    return joined([solid, shapes.loft(rings, capped=False)])


@dataclass(frozen=True)
class Bend:
    """How a back that was built flat, x across, y up from 0 and z = 0, takes its shape and place.

    Attributes:
        width: Of the flat back.
        height: Of the flat back.
        y: Where its foot stands.
        z: Where its foot stands.
        rake: Degrees that it leans back.
        curl: How much further back its top bends, as a fraction of the height.
        bow: How far the middle lies behind the sides.
        flare: How much wider the top is than the foot, as a fraction.
    """

    width: float
    height: float
    y: float
    z: float
    rake: float = 8.0
    curl: float = 0.0
    bow: float = 0.0
    flare: float = 0.0

    def __call__(self, v: Array) -> Array:
        """(V, 3) points of the flat back, bent and put in place."""
        x, y, z = v.T
        up = y / self.height
        across = np.clip(2 * x / self.width, -1.0, 1.0)
        behind = self.bow * (1 - across**2) + self.curl * self.height * np.maximum(up, 0.0) ** 2
        tilt = np.radians(self.rake)
        depth = z + behind
        return np.stack(
            [
                x * (1 + self.flare * up),
                self.y + y * np.cos(tilt) - depth * np.sin(tilt),
                self.z + y * np.sin(tilt) + depth * np.cos(tilt),
            ],
            axis=1,
        )


def rail(y: float, half: float, height: float, thick: float, crest: float = 0.0, pieces: int = 8) -> Solid:
    """A flat bar across a flat back, fine enough to be bent; ``crest`` raises its middle."""
    x = np.linspace(-half, half, pieces + 1)
    path = np.column_stack([x, y + crest * (1 - (x / half) ** 2), np.zeros(pieces + 1)])
    return shapes.tube(path, 1.0, section=shapes.rectangle(thick, height))


def upright(x: float, low: float, high: float, width: float, thick: float = 0.0, pieces: int = 5) -> Solid:
    """An upright bar in a flat back; round if no thickness is given."""
    y = np.linspace(low, high, pieces + 1)
    path = np.column_stack([np.full(pieces + 1, x), y, np.zeros(pieces + 1)])
    if thick <= 0:
        return shapes.tube(path, width / 2, sides=8)
    return shapes.tube(path, 1.0, section=shapes.rectangle(width, thick), up=(0, 0, -1))


def panel(outline: Array, thickness: float, radius: float, cells: int = 7) -> Solid:
    """A flat panel of an outline (x, y) that can be bent: a grid within the outline's spans, both sides.

    The outline must be cut at most twice by every level line.
    """
    low, high = float(outline[:, 1].min()), float(outline[:, 1].max())
    inset = min(radius, (high - low) * 0.2)
    # Denser towards both ends, where round outlines turn.
    inner = low + inset + (high - low - 2 * inset) * (1 - np.cos(np.linspace(0, np.pi, cells + 2))) / 2
    ends = np.array([0.0, inset * 0.3])
    levels = np.concatenate([low + ends, inner, high - ends[::-1]])
    step = float(np.ptp(outline[:, 0])) / cells
    sections = []
    for y in levels:
        left, right = _span(outline, float(np.clip(y, low + 1e-6, high - 1e-6)))
        edge = min(y - low, high - y)
        full = thickness * (np.sqrt(1 - (1 - min(edge / max(inset, 1e-9), 1.0)) ** 2) * 0.8 + 0.2)
        middle, width = (left + right) / 2, max(right - left, 1e-4)
        flat = shapes.rectangle(width, full, min(radius, width * 0.45, full * 0.49), 2)
        # Further points along both faces, so that a bow shows.
        flat = _refined(flat, step)
        sections.append(np.column_stack([middle + flat[:, 0], np.full(len(flat), y), -flat[:, 1]]))
    count = max(len(s) for s in sections)
    return shapes.loft([_resampled(s, count) for s in sections])


def _span(outline: Array, y: float) -> tuple[float, float]:
    a, b = outline, np.roll(outline, -1, axis=0)
    cut = (a[:, 1] - y) * (b[:, 1] - y) <= 0
    cut &= a[:, 1] != b[:, 1]
    t = (y - a[cut, 1]) / (b[cut, 1] - a[cut, 1])
    x = a[cut, 0] + t * (b[cut, 0] - a[cut, 0])
    return float(x.min()), float(x.max())


def _refined(flat: Array, step: float) -> Array:
    pieces = []
    for a, b in zip(flat, np.roll(flat, -1, axis=0), strict=True):
        count = max(1, round(float(np.linalg.norm(b - a)) / max(step, 1e-6)))
        pieces.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.concatenate(pieces)


def _resampled(loop: Array, count: int) -> Array:
    """A closed loop with more points, split evenly by index."""
    at = np.linspace(0.0, len(loop), count, endpoint=False)
    i = np.floor(at).astype(int)
    t = (at - i)[:, None]
    return np.asarray(loop[i % len(loop)] * (1 - t) + loop[(i + 1) % len(loop)] * t)
