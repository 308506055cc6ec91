"""Surfaces of known symmetry, sampled at random: the samples themselves have no symmetry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray


def sample(triangles: FloatArray, count: int, seed: int) -> tuple[FloatArray, NDArray[np.intp]]:
    """(count, 3) points uniform by area of (T, 3, 3) triangles, and the triangle of each."""
    rng = np.random.default_rng(seed)
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = np.linalg.norm(np.cross(one, other), axis=1)
    pick = rng.choice(len(area), count, p=area / area.sum())
    u, v = rng.random((2, count))
    over = u + v > 1.0
    u[over], v[over] = 1.0 - u[over], 1.0 - v[over]
    return triangles[pick, 0] + u[:, None] * one[pick] + v[:, None] * other[pick], pick


def turned(profile: FloatArray, sides: int) -> FloatArray:
    """A profile of (radius, height) turned about y in ``sides`` flat steps: prisms, pyramids, bottles."""
    angle = 2.0 * np.pi * np.arange(sides + 1) / sides
    ring = np.stack([np.cos(angle), np.zeros(sides + 1), np.sin(angle)], 1)
    points = ring[:, None] * profile[None, :, :1] + np.array([0.0, 1.0, 0.0]) * profile[None, :, 1:]
    a, b = points[:-1, :-1].reshape(-1, 3), points[1:, :-1].reshape(-1, 3)
    c, d = points[:-1, 1:].reshape(-1, 3), points[1:, 1:].reshape(-1, 3)
    return np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])


def prism(sides: int, radius: float = 1.0, height: float = 1.0) -> FloatArray:
    """Closed, standing on y = -height/2."""
    h = height / 2.0
    return turned(np.array([[0.0, -h], [radius, -h], [radius, h], [0.0, h]]), sides)


def pyramid(sides: int, radius: float = 1.0, height: float = 2.0) -> FloatArray:
    """Closed below, its tip on y."""
    return turned(np.array([[0.0, 0.0], [radius, 0.0], [0.0, height]]), sides)


def box(x: float, y: float, z: float) -> FloatArray:
    """12 triangles, two a side in the order -x, +x, -y, +y, -z, +z."""
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corner = np.zeros((4, 3))
            corner[:, axis] = sign
            corner[:, (axis + 1) % 3] = [-1, 1, 1, -1]
            corner[:, (axis + 2) % 3] = [-1, -1, 1, 1]
            faces += [corner[[0, 1, 2]], corner[[0, 2, 3]]]
    return np.asarray(np.stack(faces) * np.array([x, y, z]) / 2.0)


def moved(triangles: FloatArray, x: float, y: float, z: float) -> FloatArray:
    """Shifted."""
    return np.asarray(triangles + np.array([x, y, z]))


def ball(steps: int = 24) -> FloatArray:
    """A round profile turned in many steps."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, steps)
    return turned(np.stack([np.cos(angle), np.sin(angle)], 1), 2 * steps)


def solid(corners: FloatArray) -> FloatArray:
    """The faces of a convex solid whose faces are triangles: every supporting plane of three corners."""
    faces = []
    for i in range(len(corners)):
        for j in range(i + 1, len(corners)):
            for k in range(j + 1, len(corners)):
                normal = np.cross(corners[j] - corners[i], corners[k] - corners[i])
                side = (corners - corners[i]) @ normal
                if (side < 1e-6).all() or (side > -1e-6).all():
                    faces.append(corners[[i, j, k]])
    return np.stack(faces)


def icosahedron() -> FloatArray:
    """20 faces, corners at distance 1.9."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    corners = [[0.0, s, t * golden] for s in (-1, 1) for t in (-1, 1)]
    return solid(np.array([np.roll(c, r) for c in corners for r in range(3)]))
