"""Which camera an annotation's pose is written for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray


@dataclass(frozen=True, eq=False)
class View:
    """An object before a camera: p ~ K (R_cv_from_s X + t_cv), X in model diagonals.

    Attributes:
        R_cv_from_s: (3, 3).
        t_cv: (3,) in model diagonals.
        focal_px: Focal length in pixels.
        principal_px: (x, y) in continuous pixels.
    """

    R_cv_from_s: FloatArray
    t_cv: FloatArray
    focal_px: float
    principal_px: tuple[float, float]

    @property
    def K(self) -> FloatArray:
        """(3, 3) intrinsics."""
        (x, y), f = self.principal_px, self.focal_px
        return np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])

    @property
    def camera_key(self) -> tuple[float, float, float]:
        """Equal for objects before one camera."""
        return self.focal_px, *self.principal_px

    def cameras(self, width: int, height: int) -> Cameras:
        """One camera for a photo of that size."""
        return Cameras(
            R_cv_from_s=self.R_cv_from_s[None],
            t_cv=self.t_cv[None],
            focal_px=np.array([self.focal_px]),
            principal_px=np.array([self.principal_px]),
            width=width,
            height=height,
        )


def view_of(part: AnnotationPart, photo_camera: bool) -> View:
    """The annotation's view.

    Args:
        part: The annotation.
        photo_camera: In the camera that took the photo, where the annotation knows it; pixels then agree
            with the 4-DoF pose to first order only.
    """
    whole = part.pose_6dof
    if photo_camera and whole is not None:
        camera = whole.camera
        return View(np.array(whole.R_cv_from_s), np.array(whole.t_cv), camera.focal_px, camera.principal_px)
    pose = part.pose
    return View(np.array(pose.R_cv_from_s), np.array([0.0, 0.0, pose.t_z]), pose.focal_px, pose.principal_px)
