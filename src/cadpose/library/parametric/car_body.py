"""The painted shell of a car: cross-sections along its length, drawn in materials by row and station.

Lengths are metres; ``s`` runs from the front bumper (0) to the rear one (``length``), y is above the road.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# What a quad of the shell is made of.
PAINT, GLASS, DARK, TRIM, BED = range(5)


@dataclass(frozen=True)
class BodyShape:
    """Measures of one car.

    Attributes:
        length: Bumper to bumper.
        width: Without mirrors.
        clearance: Road to sill.
        wheel_radius: Tyre's radius.
        axles: ``s`` of the front and the rear axle.
        top: (K, 2) centre line of bonnet, windscreen, roof and tail as (s, y).
        belt: (K, 2) lower edge of the side windows as (s, y).
        windscreen: ``s`` of its foot and head.
        rear_glass: ``s`` of its head and foot; equal where the rear wall holds the window.
        side_glass: (start, end) of each side window along ``s``.
        doors: ``s`` of the gaps between doors.
        bed: (start, end, floor height) of an open bed or cockpit, or None.
        tumble: How far the windows lean in, metres of x a metre of y.
        wrap: How far the corners of nose and tail lie back, (front, rear).
        tilt: Lean of nose and tail, metres of z a metre of y, (front, rear).
        bow: How far the corners of the cabin lie in.
        cladding: Sills and arches are of dark plastic.
        roof: Material of the roof.
    """

    length: float
    width: float
    clearance: float
    wheel_radius: float
    axles: tuple[float, float]
    top: FloatArray
    belt: FloatArray
    windscreen: tuple[float, float]
    rear_glass: tuple[float, float]
    side_glass: tuple[tuple[float, float], ...]
    doors: tuple[float, ...]
    bed: tuple[float, float, float] | None = None
    tumble: float = 0.35
    wrap: tuple[float, float] = (0.25, 0.15)
    tilt: tuple[float, float] = (0.15, 0.1)
    bow: float = 0.1
    cladding: bool = False
    roof: int = PAINT

    @property
    def arch_radius(self) -> float:
        """Of the wheel arches."""
        return self.wheel_radius * 1.13 + 0.01

    def deform(self, points: FloatArray) -> FloatArray:
        """(..., 3) points of the straight car, with x across and z = ``s``, bent into the round one.

        Nose and tail curve back at their corners and lean; the result has z centred on the car.
        """
        x, y, s = points[..., 0], points[..., 1], points[..., 2]
        across = np.abs(x) / (self.width / 2)
        # The bend ends over the wheels, where the arches must stay round.
        reach = self.axles[0] - 0.55 * self.arch_radius, self.length - self.axles[1] - 0.55 * self.arch_radius
        front = np.clip(1 - s / reach[0], 0, 1) ** 1.5
        rear = np.clip(1 - (self.length - s) / reach[1], 0, 1) ** 1.5
        z = s + front * (self.wrap[0] * across**2.4 + self.tilt[0] * (y - 0.4))
        z = z - rear * (self.wrap[1] * across**2.4 + self.tilt[1] * (y - 0.4))
        first, last = self.windscreen[0], max(self.rear_glass)
        middle, half = (first + last) / 2, (last - first) / 2
        above = np.clip((y - np.interp(s, *self.belt.T)) / 0.25, 0, 1)
        along = np.clip((middle - s) / half, -1, 1)
        z = z + self.bow * across**2 * above * along * np.abs(along)
        return np.stack([x, y, z - self.length / 2], axis=-1)

    def side(self, y: FloatArray | float) -> FloatArray:
        """Half width of the body's side at a height, as a share of half the width."""
        top = float(self.belt[:, 1].max())
        heights = [0.0, self.clearance, self.clearance + 0.15, 0.42 * top + 0.1, top - 0.1, top]
        return np.asarray(np.interp(y, heights, [0.93, 0.95, 0.985, 1.0, 0.985, 0.955]), np.float64)


def _smooth_top(shape: BodyShape) -> tuple[FloatArray, FloatArray]:
    """The centre line on a fine grid, its corners rounded as pressed steel rounds them."""
    s = np.linspace(0.0, shape.length, 500)
    step = s[1] - s[0]
    offsets = np.arange(-20, 21)
    kernel = np.exp(-0.5 * (offsets * step / 0.035) ** 2)
    y = np.interp(s, *shape.top.T)
    padded = np.concatenate([np.full(20, y[0]), y, np.full(20, y[-1])])
    return s, np.convolve(padded, kernel / kernel.sum(), mode="valid")


def _stations(shape: BodyShape) -> FloatArray:
    marks = [*np.linspace(0, shape.length, 10), *shape.top[:, 0], *shape.windscreen, *shape.rear_glass]
    for end, sign in ((0.0, 1.0), (shape.length, -1.0)):
        marks += [end + sign * d for d in (0.012, 0.035, 0.07)]
    for axle in shape.axles:
        marks += [axle + shape.arch_radius * np.sin(a) for a in np.linspace(-np.pi / 2, np.pi / 2, 9)]
        marks += [axle - shape.arch_radius - 0.008, axle + shape.arch_radius + 0.008]
    for start, end in shape.side_glass:
        marks += [start, end]
    for door in shape.doors:
        marks += [door - 0.008, door + 0.008]
    if shape.bed is not None:
        marks += [shape.bed[0], shape.bed[0] + 0.02, shape.bed[1] - 0.02, shape.bed[1]]
    ordered = np.unique(np.clip(np.array(marks), 0, shape.length))
    keep = np.concatenate([[True], np.diff(ordered) > 0.006])
    keep[-1] = True
    return np.asarray(ordered[keep], np.float64)


def _section(shape: BodyShape, s: float, top: float, belt_line: float) -> FloatArray:
    """(13, 2) right half of the cross-section at ``s``, from the middle of the floor to that of the top."""
    end = min(s, shape.length - s)
    rounding = 0.06
    inset = rounding - np.sqrt(max(rounding**2 - max(rounding - end, 0.0) ** 2, 0.0))
    half = shape.width / 2 - inset
    floor = shape.clearance + 0.05 * np.clip(1 - end / 0.35, 0, 1)
    for axle in shape.axles:
        reach = shape.arch_radius**2 - (s - axle) ** 2
        if reach > -1e-9:
            floor = max(floor, shape.wheel_radius + np.sqrt(max(reach, 0.0)))
    top -= 0.5 * inset
    crown = 0.05
    belt = min(belt_line, top - crown - 0.03)
    floor = min(floor, belt - 0.06)
    height = top - crown - belt
    heights = np.array([floor, floor + 0.3 * (belt - floor), floor + 0.65 * (belt - floor), belt - 0.02])
    lower = np.array([[half * float(shape.side(y)), y] for y in heights])
    at_belt = half * float(shape.side(belt_line)) - 0.012
    low, high = min(0.03, 0.3 * height), max(height - 0.06, 0.7 * height)
    lean = shape.tumble
    edge = at_belt - lean * height - min(0.06, height)
    upper = [
        [at_belt, belt],
        [at_belt - lean * low - 0.004, belt + low],
        [at_belt - lean * high - 0.004, belt + high],
        [edge, belt + height],
    ]
    inner = [[0.8 * edge, top - 0.64 * crown], [0.42 * edge, top - 0.18 * crown], [0.0, top]]
    points = np.array([[0.0, floor], [0.8 * half, floor], *lower, *upper, *inner])
    if shape.bed is not None and shape.bed[0] < s < shape.bed[1]:
        rim = points[9].copy()
        points[10] = [rim[0] - 0.02, rim[1] - 0.01]
        depth = shape.bed[2] if min(s - shape.bed[0], shape.bed[1] - s) > 0.015 else rim[1] - 0.01
        points[11], points[12] = [rim[0] - 0.03, depth], [0.0, depth]
    return points


ROWS = 13


def _quad_materials(shape: BodyShape, s: FloatArray, sections: FloatArray) -> IntArray:
    """(S - 1, 12) material of the quads between neighbouring stations."""
    middle = (s[1:] + s[:-1]) / 2
    kind = np.full((len(middle), ROWS - 1), PAINT)
    kind[:, :2] = DARK
    height = sections[:, 9, 1] - sections[:, 6, 1]
    tall = np.minimum(height[1:], height[:-1]) > 0.05
    cabin = (middle > shape.windscreen[0]) & (middle < max(shape.rear_glass))
    for start, end in shape.side_glass:
        kind[(middle > start) & (middle < end) & tall, 7] = GLASS
    if shape.cladding:
        kind[:, 2] = TRIM
    for door in shape.doors:
        kind[np.abs(middle - door) < 0.008, 2:6] = DARK
    kind[cabin & (np.maximum(height[1:], height[:-1]) > 0.2), 9:] = shape.roof
    glass = (middle > shape.windscreen[0] + 0.02) & (middle < shape.windscreen[1])
    kind[glass, 9:] = GLASS
    glass = (middle > shape.rear_glass[0]) & (middle < shape.rear_glass[1])
    kind[glass, 9:] = GLASS
    if shape.bed is not None:
        kind[(middle > shape.bed[0]) & (middle < shape.bed[1]), 10:] = BED
    return kind


def body_shell(shape: BodyShape) -> tuple[FloatArray, IntArray, IntArray]:
    """The closed shell.

    Returns:
        ((V, 3) deformed points, (F, 3) triangles, (F,) material of each: ``PAINT``, ``GLASS`` ...).
    """
    s = _stations(shape)
    grid_s, grid_top = _smooth_top(shape)
    tops, belts = np.interp(s, grid_s, grid_top), np.interp(s, *shape.belt.T)
    half = np.array([_section(shape, *row) for row in zip(s, tops, belts, strict=True)])
    kinds = _quad_materials(shape, s, half)
    # Both sides: row 0 is the floor's middle, then up the right side, over the top and down the left.
    left = half[:, 1:-1][:, ::-1] * [-1, 1]
    ring = np.concatenate([half, left], axis=1)
    rows = ring.shape[1]
    points = np.concatenate([ring, np.broadcast_to(s[:, None, None], (*ring.shape[:2], 1))], axis=2)
    a, b = np.meshgrid(np.arange(len(s) - 1), np.arange(rows), indexing="ij")
    c = (b + 1) % rows
    corners = np.stack([a * rows + b, a * rows + c, (a + 1) * rows + c, (a + 1) * rows + b], axis=-1)
    kind = np.concatenate([kinds, kinds[:, ::-1]], axis=1)
    quads, quad_kinds = corners.reshape(-1, 4), kind.ravel()
    vertices = points.reshape(-1, 3)
    for station, flip in ((0, False), (len(s) - 1, True)):
        cap, cap_quads = _cap(half[station], float(s[station]), flip)
        quads = np.concatenate([quads, cap_quads + len(vertices)])
        vertices = np.concatenate([vertices, cap])
        quad_kinds = np.concatenate([quad_kinds, np.full(len(cap_quads), PAINT)])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return shape.deform(vertices), faces, np.concatenate([quad_kinds, quad_kinds])


_ACROSS = 11


def _cap(section: FloatArray, s: float, flip: bool) -> tuple[FloatArray, IntArray]:
    """The wall that closes an end: rows of the section across the car's width."""
    across = np.linspace(-1, 1, _ACROSS)
    rows = section[1:]
    wide = (len(rows), _ACROSS)
    points = np.stack([rows[:, :1] * across, np.broadcast_to(rows[:, 1:], wide), np.full(wide, s)], axis=-1)
    index = np.arange(points.size // 3).reshape(wide)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    quads = quads.reshape(-1, 4)
    return points.reshape(-1, 3), quads[:, ::-1] if flip else quads


def slab(
    corners: Sequence[tuple[float, float]], front: float, back: float, columns: int = 5, rows: int = 2
) -> tuple[FloatArray, IntArray]:
    """A plate across the car between two ``s``, cut finely enough to be bent with the body.

    Args:
        corners: Four (x, y) of its outline: lower left, lower right, upper right, upper left.
        front: ``s`` of its face.
        back: ``s`` of its other side.
        columns: Quads along x.
        rows: Quads along y.

    Returns:
        ((V, 3) straight points for `BodyShape.deform`, (F, 3) triangles).
    """
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    p = np.asarray(corners, np.float64)
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
    flat = weights.reshape(-1, 4) @ p
    count = len(flat)
    points = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in (front, back)])
    index = np.arange(count).reshape(rows + 1, columns + 1)
    face = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    after = np.roll(rim, -1)
    sides = np.stack([rim, rim + count, after + count, after], axis=-1)
    quads = np.concatenate([face[:, ::-1], face + count, sides])
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
