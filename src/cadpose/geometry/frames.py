"""Coordinate frames and the constant turns between them.

======== ================================================================
``s``     object, ShapeNet axes: y up, front -z, the object's own right +x
``p``     object, PASCAL3D+ axes: z up, front -y, the object's own left +x
``cv``    camera, OpenCV: x right, y down, z forward (the project's camera)
``gl``    camera, OpenGL and Blender: x right, y up, z backward
``p3d``   camera, PyTorch3D: x left, y up, z forward
``b``     world, Blender after its OBJ import: z up, front +y, own right +x
======== ================================================================

``R_a_from_b`` turns column vectors: ``X_a = R_a_from_b @ X_b``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def _constant(rows: list[list[float]]) -> FloatArray:
    matrix = np.array(rows, dtype=np.float64)
    matrix.setflags(write=False)
    return matrix


R_p_from_s = _constant([[-1, 0, 0], [0, 0, 1], [0, 1, 0]])
R_s_from_p = _constant([[-1, 0, 0], [0, 0, 1], [0, 1, 0]])
R_cv_from_gl = _constant([[1, 0, 0], [0, -1, 0], [0, 0, -1]])
R_gl_from_cv = R_cv_from_gl
R_cv_from_p3d = _constant([[-1, 0, 0], [0, -1, 0], [0, 0, 1]])
R_p3d_from_cv = R_cv_from_p3d
R_b_from_s = _constant([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
R_s_from_b = _constant([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
# Sweet Home 3D models look along +z: half a turn about the vertical axis.
R_s_from_front_plus_z = _constant([[-1, 0, 0], [0, 1, 0], [0, 0, -1]])


def blender_camera_matrix_world(R_cv_from_s: FloatArray, t_z: float = 2.0) -> FloatArray:
    """Blender's ``camera.matrix_world`` for an object kept at the origin of Blender's world.

    Args:
        R_cv_from_s: (3, 3) rotation, ShapeNet axes to OpenCV camera.
        t_z: Distance of the object's origin along the optical axis.

    Returns:
        (4, 4) matrix that takes Blender camera coordinates to Blender world coordinates.
    """
    R_gl_from_b = R_gl_from_cv @ R_cv_from_s @ R_s_from_b
    matrix = np.eye(4)
    matrix[:3, :3] = R_gl_from_b.T
    matrix[:3, 3] = R_gl_from_b.T @ np.array([0.0, 0.0, t_z])
    return matrix


def extrinsics_to_opengl(T_cv_from_s: FloatArray) -> FloatArray:
    """(4, 4) OpenCV extrinsics to the OpenGL view matrix (x right, y up, z backward)."""
    return _turn_camera(R_gl_from_cv, T_cv_from_s)


def extrinsics_from_opengl(T_gl_from_s: FloatArray) -> FloatArray:
    """(4, 4) OpenGL view matrix to OpenCV extrinsics."""
    return _turn_camera(R_cv_from_gl, T_gl_from_s)


def extrinsics_to_pytorch3d(T_cv_from_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(4, 4) OpenCV extrinsics to PyTorch3D's ``R`` and ``T``.

    PyTorch3D multiplies row vectors, ``X_cam = X @ R + T``, so its ``R`` is the transpose.
    """
    T_p3d_from_s = _turn_camera(R_p3d_from_cv, T_cv_from_s)
    return T_p3d_from_s[:3, :3].T.copy(), T_p3d_from_s[:3, 3].copy()


def extrinsics_from_pytorch3d(R: FloatArray, T: FloatArray) -> FloatArray:
    """PyTorch3D's ``R`` (3, 3; row vectors) and ``T`` (3,) to (4, 4) OpenCV extrinsics."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.asarray(R, dtype=np.float64).T
    matrix[:3, 3] = T
    return _turn_camera(R_cv_from_p3d, matrix)


def _turn_camera(R_new_from_old: FloatArray, T_old_from_s: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3] = R_new_from_old @ np.asarray(T_old_from_s, dtype=np.float64)[:3]
    return matrix
