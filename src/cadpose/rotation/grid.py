"""The grid of rotations at which templates are drawn."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import flip_angles, geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray

#: (elevation, in-plane, azimuth step): dense where photographs are mostly taken, sparser elsewhere.
_RINGS = (
    (0.0, 0.0, 10.0),
    (10.0, 0.0, 10.0),
    (22.0, 0.0, 10.0),
    (36.0, 0.0, 10.0),
    (55.0, 0.0, 20.0),
    (5.0, -15.0, 15.0),
    (5.0, 15.0, 15.0),
    (25.0, -15.0, 20.0),
    (25.0, 15.0, 20.0),
    (5.0, -30.0, 20.0),
    (5.0, 30.0, 20.0),
    (25.0, -30.0, 20.0),
    (25.0, 30.0, 20.0),
)
#: Part of the cache key: change it when the grid changes.
GRID_VERSION = 1


@lru_cache(maxsize=1)
def grid_angles() -> FloatArray:
    """(N, 3) azimuth, elevation, in-plane rotation in degrees of every template."""
    rows = [
        (azimuth, elevation, inplane)
        for elevation, inplane, step in _RINGS
        for azimuth in np.arange(0.0, 360.0, step)
    ]
    angles = np.array(rows, dtype=np.float64)
    angles.setflags(write=False)
    return angles


@lru_cache(maxsize=1)
def grid_rotations() -> FloatArray:
    """(N, 3, 3) ``R_cv_from_s`` of every template."""
    R = rotation_from_angles(*grid_angles().T)
    R.setflags(write=False)
    return R


@lru_cache(maxsize=1)
def grid_mirrored() -> NDArray[np.int64]:
    """(N,) for every template the one that shows a mirror-symmetric model as in a mirror."""
    R = rotation_from_angles(*flip_angles(*grid_angles().T))
    found: NDArray[np.int64] = geodesic_degrees(R[:, None], grid_rotations()[None]).argmin(axis=1)
    found.setflags(write=False)
    return found


@lru_cache(maxsize=1)
def grid_distances() -> FloatArray:
    """(N, N) geodesic angles between templates, in degrees."""
    R = grid_rotations()
    D = geodesic_degrees(R[:, None], R[None])
    D.setflags(write=False)
    return D
