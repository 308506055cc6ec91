"""Which rotations leave a set of surface points as it looks: `find_symmetry`.

Candidate axes come from the object's own axes, from the principal axes of the points, from a ring of half
turns across each of those, and, where no principal axis stands out as with a cube, from directions all over
the half sphere; each is refined by local search in a distance field. A rotation is a symmetry when almost
every point, turned, lands within the tolerance of a point of like colour. The rotations found are closed to
a group.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import geodesic_degrees
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup, rotation_about

__all__ = ["SymmetryGroup", "find_symmetry", "rotation_about"]

HIGHEST_ORDER = 12
_LEAST_POINTS = 50
_QUERIES = 3000
_SOFT_QUERIES = 500
# Steps of no small order, so that a shape that passes all of them is round.
_ROUND = np.array([17.3, 41.9, 67.1, 101.7, 131.3, 163.9, 205.1, 251.7, 293.3, 331.9])
# Steps of the orders 2 to 12 as parts of a whole turn, up to a half; one a prime comes first.
_FRACTIONS = sorted({min(k, n - k) / n for n in range(2, HIGHEST_ORDER + 1) for k in range(1, n)})
_FIRST = [1 / 2, 1 / 3, 1 / 5, 1 / 7, 1 / 11]
_SAME_AXIS = np.cos(np.deg2rad(6.0))
_SOFT_CELLS = 48
_SOFT_REACH = 7
_COLOURS = 8
_COLOUR_DISTANCE = 0.2
# Distance from one random sample to the next, in medians: one in 5000 is as far.
_GAPS = 3.5


def find_symmetry(
    points: FloatArray | NDArray[np.float32],
    normals: FloatArray | NDArray[np.float32] | None = None,
    colours: FloatArray | NDArray[np.float32] | None = None,
    *,
    tested: NDArray[np.bool_] | None = None,
    tolerance: float = 0.02,
    outliers: float = 0.003,
) -> SymmetryGroup:
    """The proper rotations about the middle of some points that leave them as they look.

    Mirror images are no rotations and do not count. Orders up to 12 are told apart; what passes at any angle
    is of revolution. Details finer than the tolerance, or than the gaps between sparse points, are not seen.

    Args:
        points: (N, 3) on the surface, uniform by area, at least 50. More points see finer details.
        normals: (N, 3) outward normals, shorter (down to zero) where the side is not sure. With them the two
            faces of a thin sheet are told apart.
        colours: (N, C) in [0, 1], if they count: red, green, blue, or whatever else a turn leaves as it is.
        tested: (N,) points that have to meet others when turned; the rest are only there to be met. All by
            default.
        tolerance: How far a turned point may lie from the surface, relative to the bounding box's diagonal.
        outliers: Share of points that may lie farther, beyond what sparse sampling alone explains.

    Returns:
        The group; `SymmetryGroup.trivial` where nothing was found.

    Raises:
        ValueError: shapes disagree, too few points, or a value is not finite.
    """
    shape = _Shape.of(points, normals, colours, tested, tolerance, outliers)
    axes = _axes(shape)
    found = [turn for axis in axes if (turn := _about(shape, axis)) is not None]
    return _group(shape, _distinct(found))


@dataclass(frozen=True, eq=False)
class _Shape:
    """Points to be turned, and what tells how far they then lie from the surface."""

    points: FloatArray
    kind: NDArray[np.int64]
    soft_points: FloatArray
    near: NDArray[np.bool_]
    soft: FloatArray
    radius: float
    cells: int
    outliers: float

    @classmethod
    def of(
        cls,
        points: FloatArray | NDArray[np.float32],
        normals: FloatArray | NDArray[np.float32] | None,
        colours: FloatArray | NDArray[np.float32] | None,
        tested: NDArray[np.bool_] | None,
        tolerance: float,
        outliers: float,
    ) -> _Shape:
        P = np.asarray(points, np.float64)
        given = [P, *(np.asarray(a, np.float64) for a in (normals, colours) if a is not None)]
        wrong = any(a.ndim != 2 or len(a) != len(P) for a in given) or P.shape[1:] != (3,)
        if wrong or (normals is not None and np.shape(normals) != P.shape):
            raise ValueError(
                f"expected (N, 3) points and arrays of their length, got {[a.shape for a in given]}"
            )
        if tested is not None and (tested.shape != P.shape[:1] or not tested.any()):
            raise ValueError("tested points: expected one bool a point, at least one true")
        if len(P) < _LEAST_POINTS or not all(np.isfinite(a).all() for a in given):
            raise ValueError(f"expected at least {_LEAST_POINTS} finite points, got {len(P)}")
        diagonal = float(np.linalg.norm(np.ptp(P, axis=0)))
        if not diagonal > 0.0:
            raise ValueError("all points are one")
        seen = slice(None) if tested is None else tested
        P = P - P.mean(axis=0)
        P = (P - _centre(P[seen])) / diagonal
        rng = np.random.default_rng(0)
        order = rng.permutation(len(P))
        gap = _median_gap(P, order[: min(400, 1_500_000 // len(P) + 1)])
        reach = max(tolerance, _GAPS * gap)
        # A point at an edge has neighbours on one side only, and may have none this near by chance.
        outliers += 0.4 * 0.5 ** (0.5 * (reach / max(gap, 1e-9)) ** 2)
        if normals is not None:
            # Far enough to part the two faces of a sheet, near enough that its rim stays with them.
            P = P + 0.55 * reach * np.asarray(normals, np.float64)
            P = P - _centre(P[seen])
        radius = float(np.linalg.norm(P, axis=1).max()) + 1e-6
        kinds, like = _colour_kinds(None if colours is None else np.asarray(colours, np.float64)[order])
        P = P[order]
        near, cells = _near(P, like, radius, reach)
        chosen = (np.arange(len(P)) if tested is None else np.flatnonzero(tested[order]))[:_QUERIES]
        return cls(
            P[chosen],
            kinds[chosen % len(kinds)] * cells**3,
            P[chosen[:_SOFT_QUERIES]],
            near,
            _distance_field(P, radius),
            radius,
            cells,
            outliers,
        )

    def outlying(self, R: FloatArray) -> FloatArray:
        """(M,) share of points that (M, 3, 3) rotations take away from the surface of their colour."""
        shares = np.empty(len(R))
        for i, turn in enumerate(R):
            cell = ((self.points @ turn.T + self.radius) * (self.cells / (2.0 * self.radius))).astype(
                np.int64
            )
            flat = (cell[:, 0] * self.cells + cell[:, 1]) * self.cells + cell[:, 2]
            shares[i] = 1.0 - self.near[self.kind + flat].mean()
        return shares

    def distance(self, R: FloatArray, some: int = _SOFT_QUERIES) -> FloatArray:
        """(M,) mean distance, cut off at a seventh of the size, of turned points from the surface."""
        turned = self.soft_points[:some] @ np.swapaxes(R, 1, 2)
        cell = ((turned + self.radius) * (_SOFT_CELLS / (2.0 * self.radius))).astype(np.int64)
        flat = (cell[..., 0] * _SOFT_CELLS + cell[..., 1]) * _SOFT_CELLS + cell[..., 2]
        return np.asarray(self.soft[flat].mean(axis=1))


def _centre(P: FloatArray) -> FloatArray:
    """The Steiner point of the convex hull: symmetries keep it, and unlike the centroid it does not depend on
    how evenly the points are spread."""
    u = _half_sphere(200)
    u = np.concatenate([u, -u])
    support = (P @ u.T).max(axis=0)
    return np.asarray(np.linalg.solve(u.T @ u, u.T @ support))


def _median_gap(P: FloatArray, some: NDArray[np.int64]) -> float:
    """Median distance from a point to the nearest other one."""
    square = (P[some] ** 2).sum(1)[:, None] - 2.0 * P[some] @ P.T + (P**2).sum(1)
    square[np.arange(len(some)), some] = np.inf
    return float(np.sqrt(np.maximum(np.median(square.min(axis=1)), 0.0)))


def _colour_kinds(colours: FloatArray | None) -> tuple[NDArray[np.int64], list[NDArray[np.int64] | slice]]:
    """Each point's kind of colour, and for every kind the points that are like it: the kinds overlap."""
    if colours is None:
        return np.zeros(1, np.int64), [slice(None)]
    centres = [np.median(colours, axis=0)]
    for _ in range(_COLOURS - 1):
        apart = np.min([np.linalg.norm(colours - c, axis=1) for c in centres], axis=0)
        # The colour that one point in a hundred exceeds, so that a speck makes no kind of its own.
        rank = int(np.argsort(apart)[int(0.997 * (len(apart) - 1))])
        if apart[rank] < 0.5 * _COLOUR_DISTANCE:
            break
        centres.append(colours[rank])
    table = np.stack([np.linalg.norm(colours - c, axis=1) for c in centres])
    kind = table.argmin(axis=0)
    # A colour may vary within its kind; what is like one of the kind is within that much more.
    spread = [
        float(np.percentile(table[k][kind == k], 95)) if (kind == k).any() else 0.0 for k in range(len(table))
    ]
    like = [np.flatnonzero(row <= _COLOUR_DISTANCE + s) for row, s in zip(table, spread, strict=True)]
    return kind, list(like)


def _near(
    P: FloatArray, like: list[NDArray[np.int64] | slice], radius: float, reach: float
) -> tuple[NDArray[np.bool_], int]:
    """Cells within reach of a point of each kind: flat (kinds * cells³,) and the cells a side."""
    cells = int(min(np.ceil(2.0 * radius / (reach / 3.0)), 200))
    width = 2.0 * radius / cells
    # A little less: points lie anywhere in their cells.
    steps = int(np.ceil(reach / width))
    ball = np.stack(np.meshgrid(*[np.arange(-steps, steps + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    ball = ball[np.linalg.norm(ball, axis=1) * width <= reach - 0.3 * width]
    cell = np.floor((P + radius) / width).astype(np.int64)
    near = np.zeros(len(like) * cells**3, np.bool_)
    for kind, members in enumerate(like):
        own = np.unique((cell[members] @ np.array([cells**2, cells, 1]))[:, None], axis=0)[:, 0]
        at = np.stack(np.unravel_index(own, (cells,) * 3), 1)
        for offset in ball:
            moved = np.clip(at + offset, 0, cells - 1)
            near[kind * cells**3 + moved @ np.array([cells**2, cells, 1])] = True
    return near, cells


def _distance_field(P: FloatArray, radius: float) -> FloatArray:
    """Distance of each cell of a coarse grid to the surface, exact up to the reach: one pass an axis."""
    n = _SOFT_CELLS
    cell = np.minimum(((P + radius) * (n / (2.0 * radius))).astype(np.int64), n - 1)
    far = (_SOFT_REACH + 1) ** 2
    field = np.full((n, n, n), far, np.int32)
    field[tuple(cell.T)] = 0
    for axis in range(3):
        moved = np.moveaxis(field, axis, 0)
        best = moved.copy()
        for step in range(1, _SOFT_REACH + 1):
            np.minimum(best[step:], moved[:-step] + step * step, out=best[step:])
            np.minimum(best[:-step], moved[step:] + step * step, out=best[:-step])
        field = np.moveaxis(best, 0, axis)
    return np.asarray(np.sqrt(field).ravel() * (2.0 * radius / n))


def _axes(shape: _Shape) -> list[FloatArray]:
    """Candidate axes, the object's own first."""
    own = [np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])]
    moments, principal = np.linalg.eigh(np.cov(shape.points.T))
    axes = list(principal.T)
    found = own + axes
    for axis in axes:
        found += [_refined(shape, axis, 360.0 / n) for n in (2, 3, 4, 5, 7, 11)]
    ring = np.deg2rad(np.arange(0.0, 180.0, 4.0))[:, None]
    for one, other in [(f[i - 2], f[i - 1]) for f in (own, axes) for i in range(3)]:
        across = np.cos(ring) * one + np.sin(ring) * other
        score = shape.distance(rotation_about(across, 180.0), 250)
        low = np.flatnonzero((score <= np.roll(score, 1)) & (score <= np.roll(score, -1)))
        low = low[np.argsort(score[low])][:4]
        found += [_refined(shape, across[k], 180.0) for k in low]
    # No axis stands out: a cube, a ball, or a cabinet that happens to be about as wide as high.
    if moments[0] > 0.75 * moments[2]:
        everywhere = _half_sphere(500)
        for n in (2, 3, 4, 5):
            score = shape.distance(rotation_about(everywhere, 360.0 / n), 250)
            for k in _apart(everywhere, score, 6):
                found.append(_refined(shape, everywhere[k], 360.0 / n))
    return found


def _refined(shape: _Shape, axis: FloatArray, degrees: float) -> FloatArray:
    """The axis nearby about which a turn fits best: a pattern search with shrinking steps."""
    best = float(shape.distance(rotation_about(axis, degrees)[None])[0])
    for step in np.deg2rad([5.0, 2.5, 1.2, 0.6, 0.3]):
        for _ in range(3):
            across = np.linalg.svd(axis[None])[2][1:]
            around = np.arange(8) * (np.pi / 4.0)
            tried = axis + step * (np.cos(around)[:, None] * across[0] + np.sin(around)[:, None] * across[1])
            score = shape.distance(rotation_about(tried, degrees))
            if score.min() >= best:
                break
            best = float(score.min())
            axis = tried[score.argmin()] / np.linalg.norm(tried[score.argmin()])
    return axis


def _half_sphere(count: int) -> FloatArray:
    """(count, 3) directions spread evenly over a half sphere (Fibonacci)."""
    i = np.arange(count) + 0.5
    height = 1.0 - i / count
    round_, across = i * np.pi * (3.0 - np.sqrt(5.0)), np.sqrt(1.0 - height * height)
    return np.stack([across * np.cos(round_), height, across * np.sin(round_)], 1)


def _apart(directions: FloatArray, score: FloatArray, count: int) -> list[int]:
    """The lowest scores, none within 15 degrees of a lower one."""
    chosen: list[int] = []
    for k in np.argsort(score):
        if all(abs(directions[k] @ directions[c]) < np.cos(np.deg2rad(15.0)) for c in chosen):
            chosen.append(int(k))
            if len(chosen) == count:
                break
    return chosen


@dataclass(frozen=True, eq=False)
class _Turn:
    """An axis, how many steps of a whole turn look alike about it (0: any), and how badly it fits."""

    axis: FloatArray
    order: int
    share: float


def _about(shape: _Shape, axis: FloatArray) -> _Turn | None:
    """The order of rotation about an axis, None where there is none."""
    # Whoever made the model meant its own axes: a tilted axis must not win by a hair.
    most = shape.outliers * (1.5 if _is_own(axis) else 1.0)
    first = dict(zip(_FIRST, shape.outlying(rotation_about(axis, 360.0 * np.array(_FIRST))), strict=True))
    if min(first.values()) > most:
        return None
    rest = [f for f in _FRACTIONS if f not in first]
    share = first | dict(zip(rest, shape.outlying(rotation_about(axis, 360.0 * np.array(rest))), strict=True))
    # Every step of an order has to fit; a step and its inverse fit alike.
    fits = {
        n: max(share[min(k, n - k) / n] for k in range(1, n))
        for n in range(2, HIGHEST_ORDER + 1)
        if all(share[min(k, n - k) / n] <= most for k in range(1, n))
    }
    if not fits:
        return None
    # A prism of eight sides is nearly round: what fits clearly better than the rest is its order.
    off = dict(
        zip(_FRACTIONS, shape.distance(rotation_about(axis, 360.0 * np.array(_FRACTIONS))), strict=True)
    )
    mean_off = {n: float(np.mean([off[min(k, n - k) / n] for k in range(1, n)])) for n in fits}
    close = 1.15 * min(mean_off.values()) + 0.0003
    round_ = rotation_about(axis, _ROUND)
    if shape.distance(round_).mean() <= close and (shares := shape.outlying(round_)).max() <= most:
        return _Turn(axis, 0, float(shares.max()))
    order = max(n for n in fits if mean_off[n] <= close)
    return _Turn(axis, order, float(fits[order]))


def _distinct(turns: list[_Turn]) -> list[_Turn]:
    """One turn an axis: revolution before high orders before low ones, own axes before what fits best."""
    ranked = sorted(turns, key=lambda t: (-(t.order or 99), -1.0 if _is_own(t.axis) else t.share))
    chosen: list[_Turn] = []
    for turn in ranked:
        if all(abs(turn.axis @ c.axis) < _SAME_AXIS for c in chosen):
            chosen.append(turn)
    return chosen


def _group(shape: _Shape, turns: list[_Turn]) -> SymmetryGroup:
    """The largest group that the turns make and that the shape bears out."""
    circles = [t for t in turns if t.order == 0]
    if len(circles) > 1:
        return SymmetryGroup.sphere()
    if circles:
        axis = circles[0].axis
        two_sided = SymmetryGroup.revolution(axis, two_sided=True)
        over = rotation_about(axis, _ROUND[:6]) @ two_sided.rotations[1]
        alike = shape.outlying(over).max() <= 2.0 * shape.outliers
        return two_sided if alike else SymmetryGroup.revolution(axis)
    group = SymmetryGroup.trivial()
    generators: list[FloatArray] = []
    own = False
    for turn in turns:
        one = rotation_about(turn.axis, 360.0 / turn.order)
        if geodesic_degrees(group.rotations, one).min() < 8.0:
            continue
        try:
            larger = SymmetryGroup.generated_by([*generators, one])
        except ValueError:
            continue
        # Half turns about axes that are a little off would make steps finer than any that was tested.
        if geodesic_degrees(larger.rotations[1:], np.eye(3)).min() < 359.0 / HIGHEST_ORDER:
            continue
        # Averaging moves the elements a little: each is looked at again, less strictly.
        if shape.outlying(larger.rotations).max() <= 2.0 * shape.outliers:
            group = larger
            own = own or (not generators and _is_own(turn.axis))
            generators.append(one)
    # The object's own axes are exact where they fit.
    return group if group.is_trivial or own else _polished(shape, group)


def _is_own(axis: FloatArray) -> bool:
    """Whether an axis is exactly one of the object's."""
    return bool(np.abs(axis).max() == 1.0)


def _polished(shape: _Shape, group: SymmetryGroup) -> SymmetryGroup:
    """The same group turned as a whole to where it fits best: a pattern search with shrinking steps."""
    most = 1 + np.linspace(0, len(group.rotations) - 2, min(len(group.rotations) - 1, 12)).astype(np.int64)
    turn, best = np.eye(3), float(shape.distance(group.rotations[most]).mean())
    start = best
    for step in (3.0, 1.5, 0.7, 0.3):
        for _ in range(3):
            tried = rotation_about(np.concatenate([np.eye(3), -np.eye(3)]), step) @ turn
            scores = [float(shape.distance(R @ group.rotations[most] @ R.T).mean()) for R in tried]
            if min(scores) >= best:
                break
            best, turn = min(scores), tried[int(np.argmin(scores))]
    return SymmetryGroup(turn @ group.rotations @ turn.T) if best < 0.96 * start else group
