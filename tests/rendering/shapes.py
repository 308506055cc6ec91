"""Meshes whose renders are known exactly, shared by the rendering tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Material, Mesh

# The front view: the object's own right (+x) lies at image left, its front (-z) is near.
FRONT = rotation_from_angles(0.0, 0.0)
RED, GREEN, BLUE = ((1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0))


def mesh_of(
    triangles: object,
    materials: tuple[Material, ...] = (Material(),),
    face_material: object = None,
    uv: object = None,
    normals: NDArray[np.float64] | None = None,
) -> Mesh:
    """A mesh of separate triangles (F, 3, 3), with face normals unless some are given."""
    corners = np.asarray(triangles, np.float64)
    f = len(corners)
    if normals is None:
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-30)
        normals = np.repeat(face[:, None], 3, axis=1)
    return Mesh(
        vertices=corners.reshape(-1, 3).astype(np.float32),
        faces=np.arange(3 * f, dtype=np.int32).reshape(f, 3),
        corner_normals=normals.astype(np.float32),
        corner_uv=np.zeros((f, 3, 2), np.float32) if uv is None else np.asarray(uv, np.float32),
        face_material=np.zeros(f, np.int32) if face_material is None else np.asarray(face_material, np.int32),
        materials=materials,
    )


def quad(z: float, size: float = 0.2) -> NDArray[np.float64]:
    """Two triangles (2, 3, 3): a square at depth z, seen from the front, corners in the order of QUAD_UV."""
    # Image left is +x, image bottom is -y.
    a, b, c, d = (size, -size, z), (-size, -size, z), (-size, size, z), (size, size, z)
    return np.array([[a, b, c], [a, c, d]])


QUAD_UV = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)


def sphere(radius: float = 0.4, rings: int = 64) -> Mesh:
    """A finely tessellated sphere with smooth normals."""
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    p = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    triangles = np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    return mesh_of(triangles * radius, normals=triangles)


def cube(side: float = 0.5) -> Mesh:
    """Twelve triangles about the origin."""
    s = side / 2
    faces = []
    for axis in range(3):
        for sign in (-s, s):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corner = []
            for x, y in ((-s, -s), (s, -s), (s, s), (-s, s)):
                p = [0.0, 0.0, 0.0]
                p[axis], p[u], p[v] = sign, x, y
                corner.append(p)
            faces += [[corner[0], corner[1], corner[2]], [corner[0], corner[2], corner[3]]]
    return mesh_of(faces)


def front_camera(
    size: int = 64, focal: float = 200.0, principal: tuple[float, float] | None = None, t_z: float = 2.0
) -> Cameras:
    """One camera looking at the object's front."""
    return Cameras.from_rotations(
        FRONT[None], focal_px=focal, width=size, height=size, principal_px=principal, t_z=t_z
    )
