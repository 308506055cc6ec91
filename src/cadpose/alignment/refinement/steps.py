"""Small changes of a pose as six numbers, and the ways in which a pose is seen."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup, rotation_about
from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation

#: Gives the camera that sees a pose, in pixels of the photo.
Seen = Callable[[Pose4Dof], Cameras]


def stepped(pose: Pose4Dof, step: FloatArray, side: float) -> Pose4Dof:
    """A pose changed by six numbers.

    Args:
        pose: The pose.
        step: (6,) rotation vector in the camera's frame in radians, change of ln f, and shift of the
            principal point to the right and down in shares of ``side``.
        side: Pixels of the photo that count as 1.
    """
    angle = float(np.linalg.norm(step[:3]))
    rotation = pose.rotation
    if angle > 0.0:
        R_cv_from_s = rotation_about(step[:3], np.degrees(angle)) @ rotation.to_matrix()
        rotation = Rotation.from_matrix(R_cv_from_s)
    x, y = pose.principal_px
    return Pose4Dof(
        rotation,
        pose.focal_px * float(np.exp(step[3])),
        (x + side * float(step[4]), y + side * float(step[5])),
        pose.t_z,
    )


def observable(step: FloatArray, pose: Pose4Dof, symmetry: SymmetryGroup | None) -> FloatArray:
    """(6,) the step without what nobody can see: a turn about an axis of revolution."""
    if symmetry is None or (symmetry.axis is None and not symmetry.every):
        return step
    turn = np.zeros(3)
    if symmetry.axis is not None:
        axis_cv = pose.rotation.to_matrix() @ symmetry.axis
        turn = step[:3] - (step[:3] @ axis_cv) * axis_cv
    return np.concatenate([turn, step[3:]])


def in_virtual_camera(pose: Pose4Dof) -> Cameras:
    """As the 4-DoF annotation defines it: from two diagonals, along the line of sight."""
    return pose.to_cameras(1, 1)


def in_photo_camera(camera: PhotoCamera) -> Seen:
    """From the real distance, in the camera that took the photo."""

    def seen(pose: Pose4Dof) -> Cameras:
        return Pose6Dof.from_4dof(pose, camera).to_cameras(1, 1)

    return seen
