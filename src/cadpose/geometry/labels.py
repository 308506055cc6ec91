"""Pose labels of published data sets, to and from the project's convention."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cadpose.geometry.angles import wrap180, wrap360
from cadpose.geometry.frames import FloatArray, R_cv_from_p3d

#: Pix3D gives focal lengths in millimetres on a sensor 32 mm wide.
PIX3D_SENSOR_MM = 32.0


@dataclass(frozen=True, eq=False)
class Pix3dCamera:
    """The exact camera of a Pix3D label.

    Attributes:
        R_cv_from_s: (3, 3) rotation; Pix3D's model files are in ShapeNet axes already (front -z).
        t_cv: (3,) position of the model file's origin in the camera frame.
        focal_px: Focal length in pixels.
        principal_px: Principal point, the middle of the image.
        azimuth: Degrees, computed from ``cam_position`` as Pix3D's authors do. It belongs to a camera
            that looks straight at the object; ``R_cv_from_s`` differs from it by the angle between the
            optical axis and the line of sight to the object.
        elevation: Degrees, computed from ``cam_position`` likewise.
    """

    R_cv_from_s: FloatArray
    t_cv: FloatArray
    focal_px: float
    principal_px: tuple[float, float]
    azimuth: float
    elevation: float


def from_pix3d(
    rot_mat: FloatArray,
    trans_mat: FloatArray,
    focal_mm: float,
    image_size: tuple[int, int],
    cam_position: FloatArray,
) -> Pix3dCamera:
    """A Pix3D label (its JSON's rot_mat, trans_mat, focal_length, img_size, cam_position).

    X_cv = diag(-1, -1, 1)(R·X + t), f_px = focal_mm / 32 · width.
    """
    width, height = image_size
    x, y, z = np.asarray(cam_position, np.float64)
    return Pix3dCamera(
        R_cv_from_s=R_cv_from_p3d @ np.asarray(rot_mat, np.float64),
        t_cv=R_cv_from_p3d @ np.asarray(trans_mat, np.float64),
        focal_px=focal_mm / PIX3D_SENSOR_MM * width,
        principal_px=(width / 2.0, height / 2.0),
        azimuth=float(wrap360(np.rad2deg(np.arctan2(-x, -z)))),
        elevation=float(np.rad2deg(np.arctan2(y, np.hypot(x, z)))),
    )


def to_pix3d(R_cv_from_s: FloatArray, t_cv: FloatArray, focal_px: float, width: int) -> dict[str, object]:
    """rot_mat, trans_mat, focal_length and cam_position as Pix3D stores them.

    Its ``inplane_rotation`` is not the in-plane rotation of this module and is not written.
    """
    R = R_cv_from_p3d @ np.asarray(R_cv_from_s, np.float64)
    t = R_cv_from_p3d @ np.asarray(t_cv, np.float64)
    return {
        "rot_mat": R.tolist(),
        "trans_mat": t.tolist(),
        "focal_length": focal_px * PIX3D_SENSOR_MM / width,
        "cam_position": (-R.T @ t).tolist(),
    }


def from_pascal3d(azimuth: float, elevation: float, theta: float) -> tuple[float, float, float]:
    """PASCAL3D+ viewpoint (degrees) to azimuth, elevation, in-plane rotation.

    The three mean the same there: PASCAL3D+'s own projection turns the drawing by ``theta``
    counter-clockwise after Rx(elevation - 90°)·Rz(-azimuth), before it flips the y axis downwards.
    """
    return float(wrap360(azimuth)), float(elevation), float(wrap180(theta))


def to_pascal3d(azimuth: float, elevation: float, inplane: float) -> tuple[float, float, float]:
    """Azimuth, elevation, in-plane rotation to PASCAL3D+'s azimuth, elevation, theta (degrees)."""
    return float(wrap360(azimuth)), float(elevation), float(wrap180(inplane))
