"""From a file's own axes and units to the library's: ShapeNet axes, centred, unit diagonal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.library.mesh import Mesh

FloatArray = NDArray[np.float64]

AXES: dict[str, tuple[float, float, float]] = {
    "+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1),
}  # fmt: skip


def rotation_from_axes(front: str, up: str) -> FloatArray:
    """(3, 3) rotation that takes the file's front and up axes to ShapeNet's -z and +y.

    Args:
        front: Where the object's front points in the file: ``"+x"``, ``"-z"``; a bare ``"x"`` is ``"+x"``.
        up: Where its top points.

    Raises:
        InputError: an axis is not one of the six, or the two are parallel.
    """
    named = []
    for axis in (front, up):
        key = axis.strip().lower()
        key = key if key[:1] in "+-" else "+" + key
        if key not in AXES:
            raise InputError(f"{axis!r} is not an axis; use one of {', '.join(AXES)}.")
        named.append(np.array(AXES[key], dtype=np.float64))
    forward, top = named
    if abs(float(forward @ top)) > 0.5:
        raise InputError(f"front axis {front!r} and up axis {up!r} must be perpendicular.")
    # Rows: the file's directions that become +x (own right), +y (up), +z (back).
    return np.stack([np.cross(forward, top), top, -forward])


def normalise(mesh: Mesh, R_s_from_file: FloatArray | None = None) -> tuple[Mesh, float]:
    """Turn to ShapeNet axes, centre the bounding box, scale its diagonal to one.

    Args:
        mesh: In the file's axes.
        R_s_from_file: (3, 3) rotation; identity by default.

    Returns:
        (mesh, scale): ``scale`` is what the file's lengths were multiplied by.

    Raises:
        InputError: the rotation is none, or the mesh has no extent.
    """
    rotation = np.eye(3) if R_s_from_file is None else np.asarray(R_s_from_file, dtype=np.float64)
    if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3):
        raise InputError("the model's rotation is not a rotation matrix.")
    vertices = mesh.vertices.astype(np.float64) @ rotation.T
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    if not diagonal > 0:
        raise InputError("the model has no extent.")
    scale = 1.0 / diagonal
    mirrored = np.linalg.det(rotation) < 0
    turned = replace(
        mesh,
        vertices=((vertices - (low + high) / 2) * scale).astype(np.float32),
        corner_normals=(mesh.corner_normals.astype(np.float64) @ rotation.T).astype(np.float32),
    )
    if mirrored:
        order = [0, 2, 1]
        turned = replace(
            turned,
            faces=turned.faces[:, order],
            corner_normals=turned.corner_normals[:, order],
            corner_uv=turned.corner_uv[:, order],
        )
    return turned, scale
