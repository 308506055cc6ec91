"""From where the models of an index are seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.records import Rotation


@dataclass(frozen=True)
class ViewGrid:
    """Azimuths around the object, at some elevations. Objects stand upright.

    Attributes:
        azimuths: How many, evenly spaced from 0.
        elevations: Degrees.

    Raises:
        ValueError: there are more than 256 views, none, or an elevation out of range.
    """

    azimuths: int = 8
    elevations: tuple[float, ...] = (0.0, 15.0, 35.0)

    def __post_init__(self) -> None:
        if not 1 <= self.azimuths * len(self.elevations) <= 256:
            raise ValueError(f"a model needs 1 to 256 views, got {self.azimuths} x {len(self.elevations)}")
        if not all(-90.0 <= elevation <= 90.0 for elevation in self.elevations):
            raise ValueError(f"elevations {self.elevations} must be within [-90, 90] degrees")

    def __len__(self) -> int:
        return self.azimuths * len(self.elevations)

    @cached_property
    def angles(self) -> FloatArray:
        """(V, 2) azimuth and elevation in degrees."""
        around = np.arange(self.azimuths) * (360.0 / self.azimuths)
        return np.array([(azimuth, up) for up in self.elevations for azimuth in around], np.float64)

    @cached_property
    def rotations(self) -> FloatArray:
        """(V, 3, 3) ``R_cv_from_s``."""
        return rotation_from_angles(self.angles[:, 0], self.angles[:, 1])

    def nearest(self, rotations: Sequence[Rotation], count: int = 4) -> NDArray[np.int64]:
        """The ``count`` views nearest to each rotation, once each and in ascending order; all without one.

        The in-plane rotation is left out. Nor does a model's symmetry play a part: where it is turned by one
        it looks the same, and so does what is kept of it.
        """
        if not rotations:
            return np.arange(len(self))
        R = rotation_from_angles([r.azimuth for r in rotations], [r.elevation for r in rotations])
        away = geodesic_degrees(R[:, None], self.rotations[None])
        return np.unique(np.argsort(away, axis=1, kind="stable")[:, :count])
