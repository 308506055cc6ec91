"""Azimuth, elevation and in-plane rotation to rotation matrices and back.

Azimuth 0 is the front view, 90 shows the object's own left side (its front points to image left),
180 the back, 270 its own right side. Positive elevation: the camera is above. Positive in-plane
rotation: the image turns counter-clockwise, as ``PIL.Image.rotate`` does. All angles in degrees.

    R_cv_from_s = R_cv_from_gl · Rz(inplane) · Rx(elevation - 90°) · Rz(-azimuth) · R_p_from_s
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cadpose.geometry.frames import FloatArray, R_cv_from_gl, R_p_from_s, R_s_from_p

# Below this hypot(G20, G21) the view is straight from above or below and azimuth and in-plane coincide.
_GIMBAL = 1e-9


def _rot_x(degrees: FloatArray) -> FloatArray:
    c, s, o = _cos_sin(degrees)
    return _stack([[o + 1, o, o], [o, c, -s], [o, s, c]])


def _rot_z(degrees: FloatArray) -> FloatArray:
    c, s, o = _cos_sin(degrees)
    return _stack([[c, -s, o], [s, c, o], [o, o, o + 1]])


def _cos_sin(degrees: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    radians = np.deg2rad(degrees)
    return np.cos(radians), np.sin(radians), np.zeros_like(radians)


def _stack(rows: list[list[FloatArray]]) -> FloatArray:
    out = np.empty((*rows[0][0].shape, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            out[..., i, j] = value
    return out


def rotation_from_angles(azimuth: ArrayLike, elevation: ArrayLike, inplane: ArrayLike = 0.0) -> FloatArray:
    """Angles in degrees to ``R_cv_from_s``.

    Args:
        azimuth: (...) degrees, any range.
        elevation: (...) degrees.
        inplane: (...) degrees.

    Returns:
        (..., 3, 3) rotation from ShapeNet axes to the OpenCV camera; the three inputs broadcast.
    """
    az, el, ip = np.broadcast_arrays(
        np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64), np.asarray(inplane, np.float64)
    )
    return np.asarray(R_cv_from_gl @ _rot_z(ip) @ _rot_x(el - 90.0) @ _rot_z(-az) @ R_p_from_s)


def angles_from_rotation(R_cv_from_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``R_cv_from_s`` to azimuth in [0, 360), elevation in [-90, 90], in-plane in (-180, 180].

    Straight from above or below only azimuth and in-plane together are known; in-plane is set to 0.

    Args:
        R_cv_from_s: (..., 3, 3) rotation.

    Returns:
        Three (...) arrays in degrees.
    """
    G = R_cv_from_gl.T @ np.asarray(R_cv_from_s, np.float64) @ R_s_from_p
    horizontal = np.hypot(G[..., 2, 0], G[..., 2, 1])
    gimbal = horizontal < _GIMBAL
    azimuth = np.where(
        gimbal,
        np.arctan2(-G[..., 1, 0] * np.sign(G[..., 2, 2]), G[..., 0, 0]),
        np.arctan2(G[..., 2, 0], -G[..., 2, 1]),
    )
    # Seen from above G00 = cos(az), G10 = -sin(az); from below G10 = +sin(az).
    elevation = np.arctan2(G[..., 2, 2], horizontal)
    inplane = np.where(gimbal, 0.0, np.arctan2(-G[..., 0, 2], G[..., 1, 2]))
    return wrap360(np.rad2deg(azimuth)), np.rad2deg(elevation), wrap180(np.rad2deg(inplane))


def flip_angles(azimuth: ArrayLike, elevation: ArrayLike, inplane: ArrayLike) -> tuple[FloatArray, ...]:
    """Angles after the image is mirrored left-right (exact for the x-mirrored CAD model)."""
    return (
        wrap360(-np.asarray(azimuth, np.float64)),
        np.asarray(elevation, np.float64),
        wrap180(-np.asarray(inplane, np.float64)),
    )


def geodesic_degrees(R_a: FloatArray, R_b: FloatArray) -> FloatArray:
    """Angle of the turn between two rotations, acos((tr(R_aᵀ R_b) - 1) / 2), in degrees.

    Computed from both the trace and the antisymmetric part, so that it stays exact near 0 and 180.

    Args:
        R_a: (..., 3, 3) rotation.
        R_b: (..., 3, 3) rotation; broadcasts against ``R_a``.

    Returns:
        (...) degrees in [0, 180].
    """
    R = np.swapaxes(np.asarray(R_a, np.float64), -1, -2) @ np.asarray(R_b, np.float64)
    cosine = (np.trace(R, axis1=-2, axis2=-1) - 1.0) / 2.0
    axis = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )
    return np.asarray(np.rad2deg(np.arctan2(np.linalg.norm(axis, axis=-1) / 2.0, cosine)))


def azimuth_error(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Smallest difference of two azimuths in degrees, in [0, 180]."""
    return np.abs(wrap180(np.asarray(a, np.float64) - np.asarray(b, np.float64)))


def wrap360(degrees: ArrayLike) -> FloatArray:
    """Degrees to [0, 360)."""
    wrapped = np.mod(np.asarray(degrees, np.float64), 360.0)
    # np.mod(-1e-17, 360) is 360 in floating point.
    return np.where(wrapped >= 360.0, 0.0, wrapped)


def wrap180(degrees: ArrayLike) -> FloatArray:
    """Degrees to (-180, 180]."""
    return np.asarray(180.0 - wrap360(180.0 - np.asarray(degrees, np.float64)))
