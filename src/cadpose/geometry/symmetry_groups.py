"""Rotations after which an object looks as it did before, and errors that forgive them.

A finite group is listed element by element. A body of revolution has a whole circle of them about its axis, a
ball has every rotation; both are kept in closed form and sampled only where a list is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.geometry.angles import geodesic_degrees
from cadpose.geometry.frames import FloatArray

_EXACT = 1e-5
# The largest finite groups about no single axis have 60 rotations; above this a list is no finite group.
_MOST = 120


@dataclass(frozen=True, eq=False, slots=True)
class SymmetryGroup:
    """The proper rotations ``R_s_from_s`` that leave an object as it looks.

    Attributes:
        rotations: (K, 3, 3) float64, identity first. With ``axis``, one a coset: the identity, and a half
            turn about a perpendicular axis where top and bottom are alike.
        axis: (3,) unit axis of continuous revolution, or None.
        every: Whether every rotation is in the group, as for a plain ball.

    Raises:
        ValueError: no identity first, an improper rotation, one that is there twice, a list that is not
            closed under products, or an axis that its rotations do not keep.
    """

    rotations: FloatArray
    axis: FloatArray | None = None
    every: bool = False

    def __post_init__(self) -> None:
        rotations = np.array(self.rotations, dtype=np.float64)
        if rotations.ndim != 3 or rotations.shape[1:] != (3, 3) or not 1 <= len(rotations) <= _MOST:
            raise ValueError(f"expected 1 to {_MOST} rotations of shape (3, 3), got {rotations.shape}")
        if not np.isfinite(rotations).all() or np.abs(rotations).max() > 2.0:
            raise ValueError("the symmetry group holds a matrix that is no rotation")
        gram = np.swapaxes(rotations, 1, 2) @ rotations
        if np.abs(gram - np.eye(3)).max() > _EXACT or (np.linalg.det(rotations) < 0.0).any():
            raise ValueError("the symmetry group holds a matrix that is no proper rotation")
        if np.abs(rotations[0] - np.eye(3)).max() > _EXACT:
            raise ValueError("the first rotation of a symmetry group is the identity")
        rotations.setflags(write=False)
        object.__setattr__(self, "rotations", rotations)
        if self.every:
            if self.axis is not None or len(rotations) != 1:
                raise ValueError("a group of every rotation has no axis and lists the identity alone")
        elif self.axis is not None:
            self._check_axis()
        else:
            self._check_closed()

    def _check_axis(self) -> None:
        axis = np.array(self.axis, dtype=np.float64)
        if axis.shape != (3,) or not abs(float(np.linalg.norm(axis)) - 1.0) < _EXACT:
            raise ValueError(f"the axis of revolution must be a unit vector, got {self.axis}")
        axis.setflags(write=False)
        object.__setattr__(self, "axis", axis)
        turned = self.rotations[1:] @ axis
        # One further coset at most: a rotation either keeps the axis or turns it over.
        if len(turned) > 1 or (len(turned) and np.abs(turned + axis).max() > _EXACT):
            raise ValueError("beside the identity, revolution allows one half turn across its axis")

    def _check_closed(self) -> None:
        apart, _ = _nearest(self.rotations, self.rotations, skip_self=True)
        if len(self.rotations) > 1 and apart.min() < _EXACT:
            raise ValueError("the symmetry group holds a rotation twice")
        products = (self.rotations[:, None] @ self.rotations[None]).reshape(-1, 3, 3)
        off, _ = _nearest(products, self.rotations)
        if off.max() > 10.0 * _EXACT:
            raise ValueError("the rotations are no group: a product of two of them is missing")

    # -- making ----------------------------------------------------------------------------------

    @classmethod
    def trivial(cls) -> Self:
        """Nothing but the identity."""
        return cls(np.eye(3)[None])

    @classmethod
    def cyclic(cls, n: int, axis: ArrayLike = (0.0, 1.0, 0.0)) -> Self:
        """n steps of 360/n degrees about ``axis``, which need not have unit length."""
        if not 1 <= n <= _MOST:
            raise ValueError(f"the order of a rotation must be 1 to {_MOST}, got {n}")
        return cls(rotation_about(axis, 360.0 / n * np.arange(n)))

    @classmethod
    def dihedral(
        cls, n: int, axis: ArrayLike = (0.0, 1.0, 0.0), perpendicular: ArrayLike = (1.0, 0.0, 0.0)
    ) -> Self:
        """`cyclic` and half turns about n axes across it, one of which is ``perpendicular``."""
        steps = cls.cyclic(n, axis).rotations
        return cls(np.concatenate([steps, steps @ rotation_about(_across(perpendicular, axis), 180.0)]))

    @classmethod
    def revolution(cls, axis: ArrayLike = (0.0, 1.0, 0.0), two_sided: bool = False) -> Self:
        """Every turn about ``axis``; ``two_sided`` where top and bottom are alike too."""
        unit = _unit(axis)
        turns = [np.eye(3)]
        if two_sided:
            turns.append(rotation_about(_across(np.eye(3)[np.abs(unit).argmin()], unit), 180.0))
        return cls(np.stack(turns), unit)

    @classmethod
    def sphere(cls) -> Self:
        """Every rotation."""
        return cls(np.eye(3)[None], every=True)

    @classmethod
    def generated_by(cls, rotations: Sequence[FloatArray], most: int = 60) -> Self:
        """The finite group that measured rotations, each some degrees off, mean.

        Products that lie close together count as one element. Then every element is replaced by the mean of
        what the others say about it, which converges to an exact group (averaging a near-representation).

        Raises:
            ValueError: more than ``most`` elements, or the rotations mean no group.
        """
        found = [np.eye(3)]
        # Elements are never closer than the smallest step, and products of measured ones drift.
        steps = [float(geodesic_degrees(generator, np.eye(3))) for generator in rotations]
        same = min(0.4 * min(steps, default=180.0), 30.0)
        for number, element in enumerate(found):  # grows while it is walked through
            for generator in rotations:
                product = element @ generator
                if geodesic_degrees(np.stack(found), product).min() > same:
                    if len(found) >= most:
                        raise ValueError(f"the rotations make a group of more than {most} after {number}")
                    found.append(product)
        group = np.stack(found)
        _, table = _nearest((group[:, None] @ group[None]).reshape(-1, 3, 3), group)
        table = table.reshape(len(group), len(group))
        for _ in range(20):
            said = group[table] @ np.swapaxes(group, 1, 2)[None]
            better = _project(said.mean(axis=1))
            moved, group = np.abs(better - group).max(), better
            if moved < 1e-13:
                break
        return cls(np.concatenate([np.eye(3)[None], group[1:]]))

    # -- what it is ------------------------------------------------------------------------------

    @property
    def is_trivial(self) -> bool:
        """Whether no rotation but the identity leaves the object alike."""
        return self.order == 1

    @property
    def order(self) -> float:
        """How many rotations: infinite for revolution and sphere."""
        return math.inf if self.every or self.axis is not None else float(len(self.rotations))

    @property
    def name(self) -> str:
        """``trivial``, ``C4``, ``D2``, ``tetrahedral``, ``octahedral``, ``icosahedral``, ``revolution``,
        ``revolution, two-sided`` or ``sphere`` (Schoenflies' letters)."""
        if self.every:
            return "sphere"
        if self.axis is not None:
            return "revolution" if len(self.rotations) == 1 else "revolution, two-sided"
        if self.is_trivial:
            return "trivial"
        count = len(self.rotations)
        smallest = float(geodesic_degrees(self.rotations[1:], np.eye(3)).min())
        steps = round(360.0 / smallest)
        if count == steps:
            return f"C{count}"
        solids = {(12, 3): "tetrahedral", (24, 4): "octahedral", (60, 5): "icosahedral"}
        return solids.get((count, steps), f"D{count // 2}")

    def about(self, axis: ArrayLike = (0.0, 1.0, 0.0)) -> SymmetryGroup:
        """The turns about ``axis`` alone: what is left for an object that is known to stand upright."""
        unit = _unit(axis)
        if self.every:
            return SymmetryGroup.revolution(unit)
        if self.axis is None:
            kept = np.abs(self.rotations @ unit - unit).max(axis=1) < 1e-3
            return SymmetryGroup(self.rotations[kept])
        along = abs(float(self.axis @ unit))
        if along > 1.0 - _EXACT:
            return SymmetryGroup.revolution(unit)
        if along < 1e-3 and len(self.rotations) > 1:
            return SymmetryGroup.cyclic(2, unit)
        return SymmetryGroup.trivial()

    # -- using -----------------------------------------------------------------------------------

    def geodesic_degrees(self, R_a: FloatArray, R_b: FloatArray) -> FloatArray:
        """Smallest angle between two rotations of the camera, whichever of the equal ones is taken.

        About an axis of revolution the best turn leaves the swing: the angle between the axis as the one and
        as the other rotation puts it.

        Args:
            R_a: (..., 3, 3) ``R_cv_from_s``.
            R_b: (..., 3, 3) ``R_cv_from_s``; broadcasts against ``R_a``.

        Returns:
            (...) degrees in [0, 180].
        """
        a, b = np.asarray(R_a, np.float64), np.asarray(R_b, np.float64)
        if self.every:
            return np.zeros(np.broadcast_shapes(a.shape, b.shape)[:-2])
        if self.axis is not None:
            there, here = a @ self.axis, b @ self.axis
            sine = np.linalg.norm(np.cross(there, here), axis=-1)
            cosine = (there * here).sum(axis=-1)
            if len(self.rotations) > 1:
                cosine = np.abs(cosine)
            return np.asarray(np.rad2deg(np.arctan2(sine, cosine)))
        best = geodesic_degrees(a, b)
        for turn in self.rotations[1:]:
            best = np.minimum(best, geodesic_degrees(a @ turn, b))
        return best

    def equivalents(self, R_cv_from_s: FloatArray, samples: int = 72) -> FloatArray:
        """Rotations of the camera that all look the same, the given one first.

        Args:
            R_cv_from_s: (3, 3).
            samples: Steps of a whole turn about an axis of revolution; a sphere gives ``samples``² rotations,
                spread evenly (Alexa's super-Fibonacci spiral, CVPR 2022).

        Returns:
            (M, 3, 3).
        """
        if samples < 1:
            raise ValueError(f"samples must be at least 1, got {samples}")
        R = np.asarray(R_cv_from_s, np.float64)
        if self.every:
            return np.asarray(R @ _spread(samples * samples))
        if self.axis is None:
            return np.asarray(R @ self.rotations)
        turns = rotation_about(self.axis, 360.0 / samples * np.arange(samples))
        return np.asarray(R @ (turns[None] @ self.rotations[:, None]).reshape(-1, 3, 3))

    def nearest(self, R_cv_from_s: FloatArray, to: FloatArray) -> FloatArray:
        """The equivalent of a rotation that is nearest to another one; exact for revolution too.

        Args:
            R_cv_from_s: (..., 3, 3).
            to: (..., 3, 3); broadcasts against it.

        Returns:
            (..., 3, 3).
        """
        R, goal = np.broadcast_arrays(np.asarray(R_cv_from_s, np.float64), np.asarray(to, np.float64))
        if self.every:
            return goal.copy()
        choices = []
        for turn in self.rotations:
            if self.axis is None:
                choices.append(R @ turn)
                continue
            # tr(M Rot(phi)) = a + b cos(phi) + c sin(phi) is largest at phi = atan2(c, b).
            M = turn @ np.swapaxes(goal, -1, -2) @ R
            cosine = np.trace(M, axis1=-2, axis2=-1) - (M @ self.axis) @ self.axis
            sine = np.einsum("ij,...ji->...", _cross_matrix(self.axis), M)
            choices.append(R @ rotation_about(self.axis, np.rad2deg(np.arctan2(sine, cosine))) @ turn)
        table = np.stack(choices)
        best = geodesic_degrees(table, goal).argmin(axis=0)
        return np.asarray(np.take_along_axis(table, best[None, ..., None, None], axis=0)[0])

    # -- keeping ---------------------------------------------------------------------------------

    def to_json(self) -> dict[str, Any]:
        """Plain lists and numbers; `from_json` gives the same group back."""
        return {
            "name": self.name,
            "rotations": self.rotations.tolist(),
            "axis": None if self.axis is None else self.axis.tolist(),
            "every": self.every,
        }

    @classmethod
    def from_json(cls, data: Any) -> Self:
        """What `to_json` gave.

        Raises:
            ValueError: it is something else.
        """
        if not isinstance(data, dict) or not isinstance(data.get("every"), bool):
            raise ValueError("expected a symmetry group: an object with rotations, axis and every")
        try:
            axis = data.get("axis")
            return cls(
                np.array(data["rotations"], np.float64),
                None if axis is None else np.array(axis, np.float64),
                data["every"],
            )
        except (KeyError, TypeError, OverflowError) as error:
            raise ValueError(f"expected a symmetry group: rotations and axis of numbers ({error})") from error


def rotation_about(axis: ArrayLike, degrees: ArrayLike) -> FloatArray:
    """Right-handed turns about an axis (Rodrigues).

    Args:
        axis: (..., 3), any length but zero.
        degrees: (...); broadcasts against the axes.

    Returns:
        (..., 3, 3).
    """
    unit, angle = _unit(axis), np.deg2rad(np.asarray(degrees, np.float64))[..., None, None]
    K = _cross_matrix(unit)
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))


def _cross_matrix(unit: FloatArray) -> FloatArray:
    K = np.zeros((*unit.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = unit[..., 0], unit[..., 1], unit[..., 2]
    return np.asarray(K - np.swapaxes(K, -1, -2))


def _unit(axis: ArrayLike) -> FloatArray:
    vector = np.asarray(axis, np.float64)
    length = np.linalg.norm(vector, axis=-1, keepdims=True) if vector.shape[-1:] == (3,) else np.zeros(1)
    if not (np.isfinite(length).all() and (length > 0.0).all()):
        raise ValueError(f"an axis is three numbers that are not all zero, got {axis!r}")
    return np.asarray(vector / length)


def _across(direction: ArrayLike, axis: ArrayLike) -> FloatArray:
    """The part of a direction at right angles to an axis."""
    unit, along = _unit(axis), _unit(direction)
    left = along - (along @ unit) * unit
    if np.linalg.norm(left) < 1e-6:
        raise ValueError("the perpendicular of a dihedral group must not lie along its axis")
    return _unit(left)


def _nearest(
    R: FloatArray, among: FloatArray, skip_self: bool = False
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Largest entry of the difference to the nearest of some rotations, and which that is."""
    # The Frobenius product is largest for the rotation nearest by angle.
    likeness = R.reshape(-1, 9) @ among.reshape(-1, 9).T
    if skip_self:
        np.fill_diagonal(likeness, -np.inf)
    which = likeness.argmax(axis=1)
    return np.abs(R - among[which]).max(axis=(1, 2)), which


def _project(M: FloatArray) -> FloatArray:
    """The rotations nearest to some matrices."""
    U, _, Vt = np.linalg.svd(M)
    U[..., -1] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    return np.asarray(U @ Vt)


def _spread(count: int) -> FloatArray:
    """(count, 3, 3) rotations spread evenly over all of them, the identity first."""
    s = np.arange(count) + 0.5
    low, high = np.sqrt(s / count), np.sqrt(1.0 - s / count)
    alpha, beta = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / 1.533751168755204288118041
    x, y, z, w = low * np.sin(alpha), low * np.cos(alpha), high * np.sin(beta), high * np.cos(beta)
    R = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )
    return np.asarray(R[0].T @ R)
