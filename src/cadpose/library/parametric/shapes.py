"""The shapes that parametric models are put together from; lengths in metres, y up, front -z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cadpose.library.parametric.solids import Array, Ints, Solid

_ORIGIN = (0.0, 0.0, 0.0)
Triple = tuple[float, float, float]


def box(size: Triple, centre: Triple = _ORIGIN) -> Solid:
    """An axis-aligned box of 12 faces."""
    corner = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Solid(corner * size + np.asarray(centre), np.array(faces, np.int64))


def rounded_box(size: Triple, centre: Triple = _ORIGIN, radius: float = 0.01, steps: int = 1) -> Solid:
    """A box whose edges and corners are round; 108 faces with one step, 300 with two."""
    half = np.asarray(size, np.float64) / 2.0
    r = min(radius, float(half.min()) * 0.98)
    ramp = np.linspace(-1.0, 0.0, steps + 1)
    t = np.concatenate([ramp, -ramp[::-1]])
    sign = np.concatenate([-np.ones(steps + 1), np.ones(steps + 1)])
    n = len(t)
    a, b = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    sa, sb = (g.ravel() for g in np.meshgrid(sign, sign, indexing="ij"))
    vertices: list[Array] = []
    normals: list[Array] = []
    faces: list[Ints] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            j, k = (axis + 1) % 3, (axis + 2) % 3
            way, corner = np.empty((n * n, 3)), np.empty((n * n, 3))
            # The tangent makes the steps of the arc even.
            way[:, axis], way[:, j], way[:, k] = side, np.tan(a * np.pi / 4), np.tan(b * np.pi / 4)
            corner[:, axis], corner[:, j], corner[:, k] = side, sa, sb
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            faces.append(_grid_faces(n, n, flip=side < 0) + len(vertices) * n * n)
            vertices.append(corner * (half - r) + way * r)
            normals.append(way)
    return Solid(
        np.concatenate(vertices) + np.asarray(centre), np.concatenate(faces), np.concatenate(normals)
    )


def _grid_faces(rows: int, columns: int, flip: bool = False) -> Ints:
    """((rows - 1) (columns - 1) 2, 3) faces of a grid of vertices numbered by rows."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij"))
    a, b = i * columns + j, i * columns + j + 1
    c, d = a + columns, b + columns
    faces = np.concatenate([np.stack([a, c, d], 1), np.stack([a, d, b], 1)])
    return np.asarray(faces[:, ::-1] if flip else faces, np.int64)


def grid(rows: Array) -> Solid:
    """An open surface through an (R, C, 3) grid of points; faces are drawn from both sides."""
    r, c = rows.shape[:2]
    return Solid(rows.reshape(-1, 3), _grid_faces(r, c))


def plate(rows: Array, thickness: float) -> Solid:
    """The surface through an (R, C, 3) grid, made solid towards its own normal's back."""
    r, c = rows.shape[:2]
    du, dv = np.gradient(rows, axis=0), np.gradient(rows, axis=1)
    normal = np.cross(du, dv)
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-12)
    back = rows - normal * thickness
    rim = [(0, j) for j in range(c)] + [(i, c - 1) for i in range(1, r)]
    rim += [(r - 1, j) for j in range(c - 2, -1, -1)] + [(i, 0) for i in range(r - 2, 0, -1)]
    loop = np.array([i * c + j for i, j in rim], np.int64)
    after = np.roll(loop, -1)
    half = r * c
    side = np.concatenate(
        [np.stack([loop, after, loop + half], 1), np.stack([after, after + half, loop + half], 1)]
    )
    front = _grid_faces(r, c)
    faces = np.concatenate([front, front[:, ::-1] + half, side])
    return Solid(np.concatenate([rows.reshape(-1, 3), back.reshape(-1, 3)]), faces)


def loft(sections: ArrayLike, capped: bool = True, ring: bool = False) -> Solid:
    """A skin through (S, N, 3) closed cross-sections of the same count, with flat ends.

    Args:
        sections: Each runs counter-clockwise seen from the way that the sections go to.
        capped: Close the ends with fans about their middles; sections have to be star-shaped.
        ring: The last section is joined to the first.
    """
    rows = np.asarray(sections, np.float64)
    s, n = rows.shape[:2]
    row = np.arange(s if ring else s - 1)
    i, j = (g.ravel() for g in np.meshgrid(row, np.arange(n), indexing="ij"))
    up, nxt = (i + 1) % s, (j + 1) % n
    a, b, c, d = i * n + j, i * n + nxt, up * n + j, up * n + nxt
    faces = [np.stack([a, b, d], 1), np.stack([a, d, c], 1)]
    vertices = [rows.reshape(-1, 3)]
    if capped and not ring:
        vertices.append(np.stack([rows[0].mean(axis=0), rows[-1].mean(axis=0)]))
        edge = np.arange(n)
        after = (edge + 1) % n
        first, last = np.full(n, s * n), np.full(n, s * n + 1)
        faces += [
            np.stack([first, after, edge], 1),
            np.stack([last, edge + (s - 1) * n, after + (s - 1) * n], 1),
        ]
    return Solid(np.concatenate(vertices), np.concatenate(faces).astype(np.int64))


def lathe(profile: Sequence[tuple[float, float]], sides: int = 24, centre: Triple = _ORIGIN) -> Solid:
    """A profile of (radius, y), from low to high, turned about the y axis and closed at both ends."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    circle = np.stack([np.cos(angle), np.zeros(sides), -np.sin(angle)], 1)
    rows = [circle * r + (0.0, y, 0.0) for r, y in profile]
    return loft(np.array(rows)).moved(*centre)


def frustum(low: float, high: float, height: float, foot: Triple = _ORIGIN, sides: int = 16) -> Solid:
    """A cone cut off: radius ``low`` at its foot, ``high`` at the top; upright."""
    return lathe([(low, 0.0), (high, height)], sides, foot)


def cylinder(radius: float, height: float, foot: Triple = _ORIGIN, sides: int = 16) -> Solid:
    """An upright cylinder that stands on ``foot``."""
    return frustum(radius, radius, height, foot, sides)


def superellipsoid(
    radii: Triple, centre: Triple = _ORIGIN, upright: float = 1.0, round_: float = 1.0, sides: int = 20
) -> Solid:
    """Barr's superellipsoid: exponents near 0 give a box, 1 an ellipsoid.

    Args:
        radii: Half the extents.
        centre: Its middle.
        upright: Exponent from pole to pole (y).
        round_: Exponent around the y axis.
        sides: Vertices around.
    """

    def power(x: Array, e: float) -> Array:
        return np.asarray(np.sign(x) * np.where(np.abs(x) < 1e-9, 0.0, np.abs(x)) ** e)

    v = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    u = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = power(np.maximum(np.cos(v), 0.0), upright)[:, None]
    rows = np.stack(
        [
            ring * power(np.cos(u), round_),
            np.repeat(power(np.sin(v), upright)[:, None], sides, 1),
            -ring * power(np.sin(u), round_),
        ],
        axis=2,
    )
    return loft(rows * np.asarray(radii), capped=False).moved(*centre)


def ellipsoid(radii: Triple, centre: Triple = _ORIGIN, sides: int = 20) -> Solid:
    """An ellipsoid; a sphere where the radii are equal."""
    return superellipsoid(radii, centre, sides=sides)


def pillow(size: Triple, centre: Triple = _ORIGIN, puff: float = 0.5, steps: int = 9) -> Solid:
    """A cushion that lies flat: full in the middle, thin at its seam.

    Args:
        size: Width, thickness, depth.
        centre: Its middle.
        puff: 0.1 for a firm block, 0.5 for a loose pillow.
        steps: Points along each side.
    """
    t = np.sin(np.linspace(-np.pi / 2, np.pi / 2, steps))
    x, z = np.meshgrid(t, t, indexing="ij")
    thick = np.clip((1 - x**4) * (1 - z**4), 0.0, 1.0) ** puff
    # The sides of a stuffed cushion are drawn in between its corners.
    draw = 1.0 - 0.12 * puff * (1.0 - np.minimum(x**2, z**2))
    top = np.stack([x * draw, thick, z * draw], 2) * (np.asarray(size) / 2.0)
    low = top * (1.0, -1.0, 1.0)
    n = steps * steps
    faces = np.concatenate([_grid_faces(steps, steps, True), _grid_faces(steps, steps) + n])
    return Solid(np.concatenate([top.reshape(-1, 3), low.reshape(-1, 3)]) + np.asarray(centre), faces)


def torus(ring: float, tube_: float, centre: Triple = _ORIGIN, sides: int = 32, around: int = 10) -> Solid:
    """A ring that lies flat (its axis is y)."""
    u = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    v = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
    radius = ring + tube_ * np.cos(v)[None]
    rows = np.stack(
        [
            radius * np.cos(u)[:, None],
            np.repeat(tube_ * np.sin(v)[None], sides, 0),
            radius * np.sin(u)[:, None],
        ],
        axis=2,
    )
    return loft(rows, ring=True).moved(*centre)


def smooth_path(path: ArrayLike, steps: int = 6, closed: bool = False) -> Array:
    """A Catmull-Rom curve through (N, D) points, ``steps`` points a stretch."""
    p = np.asarray(path, np.float64)
    if closed:
        padded = np.concatenate([p[-1:], p, p[:2]])
    else:
        padded = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    pieces = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        pieces.append(
            0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        )
    curve = np.concatenate(pieces)
    return curve if closed else np.concatenate([curve, p[-1:]])


def tube(
    path: ArrayLike,
    radius: float | Sequence[float] | Array = 0.01,
    sides: int = 10,
    section: ArrayLike | None = None,
    up: Triple = (0.0, 1.0, 0.0),
    closed: bool = False,
) -> Solid:
    """A tube along a polyline, round unless a section is given.

    Args:
        path: (N, 3) points.
        radius: One number, or one a point.
        sides: Of a round section.
        section: (M, 2) closed outline in units of ``radius``, counter-clockwise: first coordinate across,
            second towards ``up``; for a bar of 4 x 2 cm take ``rectangle(0.04, 0.02)`` with radius 1.
        up: Where the section's second coordinate points as far as the path allows.
        closed: The path is a loop.
    """
    p = np.asarray(path, np.float64)
    ahead = np.roll(p, -1, axis=0) - p
    behind = p - np.roll(p, 1, axis=0)
    if not closed:
        ahead[-1], behind[0] = behind[-1], ahead[0]
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
    behind /= np.maximum(np.linalg.norm(behind, axis=1, keepdims=True), 1e-12)
    way = ahead + behind
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    if section is None:
        angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
        outline = np.stack([np.cos(angle), np.sin(angle)], 1)
    else:
        outline = np.asarray(section, np.float64)
    r = np.broadcast_to(np.asarray(radius, np.float64), (len(p),))
    rows = np.empty((len(p), len(outline), 3))
    lift = np.asarray(up, np.float64)
    for i, tangent in enumerate(way):
        level = lift - (lift @ tangent) * tangent
        if float(np.linalg.norm(level)) < 0.05:
            level = _level(tangent)
        level /= np.linalg.norm(level)
        # The next section starts from this one: no sudden twist where the path runs along `up`.
        lift = level if section is None else np.asarray(up, np.float64)
        across = np.cross(tangent, level)
        # A mitre: the section stays as thick where the path bends.
        stretch = 1.0 / max(float(np.sqrt(0.5 + 0.5 * (ahead[i] @ behind[i]))), 0.5)
        bend = ahead[i] - behind[i]
        size = float(np.linalg.norm(bend))
        offset = (outline[:, :1] * across + outline[:, 1:] * level) * r[i]
        if size > 1e-6:
            bend = bend / size
            offset = offset + np.outer(offset @ bend, bend) * (stretch - 1.0)
        rows[i] = p[i] + offset
    return loft(rows[:, ::-1], ring=closed)


def _level(tangent: Array) -> Array:
    """Some direction square to a tangent."""
    other = np.array([0.0, 0.0, -1.0]) if abs(tangent[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    return np.asarray(other - (other @ tangent) * tangent)


def bar(start: Triple, end: Triple, width: float, depth: float | None = None, taper: float = 1.0) -> Solid:
    """A straight bar, round if only a width (its diameter) is given; ``taper`` scales its end."""
    if depth is None:
        return tube([start, end], [width / 2, width / 2 * taper])
    lift = (0.0, 0.0, -1.0) if abs(end[1] - start[1]) > abs(end[2] - start[2]) else (0.0, 1.0, 0.0)
    return tube([start, end], [1.0, taper], section=rectangle(width, depth), up=lift)


def rectangle(
    width: float, height: float, radius: float = 0.0, steps: int = 3, centre: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """(4 or 4 (steps + 1), 2) outline of a rectangle, counter-clockwise, with round corners if asked."""
    w, h = width / 2, height / 2
    if radius <= 0:
        return np.asarray(np.array([[w, -h], [w, h], [-w, h], [-w, -h]]) + centre)
    r = min(radius, w * 0.999, h * 0.999)
    outline = []
    for quarter, (sx, sy) in enumerate(((1, -1), (1, 1), (-1, 1), (-1, -1))):
        angle = np.radians(-90 + 90 * quarter) + np.linspace(0.0, np.pi / 2, steps + 1)
        middle = np.array([sx * (w - r), sy * (h - r)])
        outline.append(middle + centre + r * np.stack([np.cos(angle), np.sin(angle)], 1))
    return np.concatenate(outline)


def extrude(
    outline: ArrayLike, depth: float, plane: str = "xy", radius: float = 0.0, steps: int = 3
) -> Solid:
    """A simple polygon made solid, its middle in the plane.

    Args:
        outline: (N, 2) corners in either order; may be concave, holes are not possible.
        depth: Thickness across the plane.
        plane: ``"xy"`` (seen from the front or back), ``"zy"`` (from the side) or ``"xz"`` (from above).
        radius: The rims are rounded by so much, as upholstery is.
        steps: Facets of a rounded rim.
    """
    flat = np.asarray(outline, np.float64)
    x, y = flat.T
    if float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) < 0:
        flat = flat[::-1]
    n = len(flat)
    r = min(radius, depth / 2)
    angle = np.linspace(0.0, np.pi / 2, steps + 1) if r > 0 else np.zeros(1)
    rim = [(r * (1 - np.sin(a)), -depth / 2 + r * (1 - np.cos(a))) for a in angle]
    levels = rim + [(inset, -z) for inset, z in reversed(rim)]
    rows = np.array([np.column_stack([_inset(flat, inset), np.full(n, z)]) for inset, z in levels])
    skin = loft(rows, capped=False)
    cap = _ears(rows[0, :, :2])
    top = cap + (len(levels) - 1) * n
    solid = Solid(skin.vertices, np.concatenate([cap[:, ::-1], top, skin.faces]).astype(np.int64))
    if plane == "xy":
        return solid
    order = {"zy": [2, 1, 0], "xz": [0, 2, 1]}[plane]
    return Solid(solid.vertices[:, order], solid.faces[:, ::-1])


def _inset(flat: Array, by: float) -> Array:
    """A counter-clockwise polygon with its sides moved inwards."""
    if by <= 0:
        return flat
    ahead = np.roll(flat, -1, axis=0) - flat
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
    behind = np.roll(ahead, 1, axis=0)
    inward = np.stack([-ahead[:, 1] - behind[:, 1], ahead[:, 0] + behind[:, 0]], 1) / 2
    square = np.maximum((inward**2).sum(axis=1, keepdims=True), 0.25)
    return np.asarray(flat + by * inward / square)


def _ears(flat: Array) -> Ints:
    """(N - 2, 3) triangles of a counter-clockwise simple polygon, by cutting ears off."""
    left = list(range(len(flat)))
    faces: list[tuple[int, int, int]] = []

    def turn(a: Array, b: Array, c: Array) -> Array:
        return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))

    while len(left) > 3:
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = flat[i], flat[j], flat[m]
            if turn(a, b, c) <= 1e-15:
                continue
            rest = flat[[v for v in left if v not in (i, j, m)]]
            within = (turn(a, b, rest) > 0) & (turn(b, c, rest) > 0) & (turn(c, a, rest) > 0)
            if not within.any():
                break
        else:
            # Only corners on a line are left, or the outline crosses itself: cut somewhere.
            k, (i, j, m) = 1, (left[0], left[1], left[2])
        faces.append((i, j, m))
        left.pop(k)
    faces.append((left[0], left[1], left[2]))
    return np.array(faces, np.int64)
