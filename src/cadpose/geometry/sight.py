"""Rotations seen along the line of sight to an object, and those of the camera that took the whole photo.

A camera with its principal point in the middle of the photo sees an object off that middle from the side.
The allocentric rotation is that of a camera turned to look straight at the object; it is what a crop of the
object shows, and what the project calls the object's rotation (docs/conventions.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cadpose.geometry.frames import FloatArray


def turn_to_sight(pixel: ArrayLike, focal_px: float, principal_px: ArrayLike) -> FloatArray:
    """The smallest turn of the camera that puts a pixel's line of sight on the optical axis.

    Args:
        pixel: (x, y) in continuous pixels.
        focal_px: Focal length in pixels.
        principal_px: (x, y) principal point in continuous pixels.

    Returns:
        (3, 3) R_turned_from_cv (Rodrigues' formula).

    Raises:
        ValueError: the focal length is not positive or a number is not finite.
    """
    x, y = np.asarray(pixel, np.float64) - np.asarray(principal_px, np.float64)
    if not np.isfinite([x, y, focal_px]).all() or focal_px <= 0:
        raise ValueError(f"no line of sight through {pixel!r} with focal length {focal_px}")
    sight = np.array([x, y, focal_px]) / np.sqrt(x * x + y * y + focal_px * focal_px)
    v, c = np.cross(sight, [0.0, 0.0, 1.0]), sight[2]
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + c))


def allocentric_rotation(
    R_cv_from_s: FloatArray, pixel: ArrayLike, focal_px: float, principal_px: ArrayLike
) -> FloatArray:
    """(3, 3) rotation seen by a camera turned towards a pixel, from that of the photo's own camera.

    Raises:
        ValueError: as `turn_to_sight`.
    """
    return turn_to_sight(pixel, focal_px, principal_px) @ np.asarray(R_cv_from_s, np.float64)


def egocentric_rotation(
    R_turned_from_s: FloatArray, pixel: ArrayLike, focal_px: float, principal_px: ArrayLike
) -> FloatArray:
    """The other way: (3, 3) rotation in the photo's own camera.

    Raises:
        ValueError: as `turn_to_sight`.
    """
    return turn_to_sight(pixel, focal_px, principal_px).T @ np.asarray(R_turned_from_s, np.float64)
