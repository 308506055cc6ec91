"""Inner loops of synthetic photos, compiled by numba: one pass instead of several over temporary arrays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cadpose.jit import kernel

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]


@kernel
def blend(canvas: Bytes, rgb: Bytes, alpha: Bytes) -> None:
    """Draw (H, W, 3) ``rgb`` over ``canvas``, in place, by (H, W) ``alpha``."""
    for row in range(alpha.shape[0]):
        for column in range(alpha.shape[1]):
            a = np.int64(alpha[row, column])
            if a == 0:
                continue
            # In 1/256 rather than 1/255, which costs no division: solid is 256.
            a += a >> 7
            for k in range(3):
                mixed = rgb[row, column, k] * a + canvas[row, column, k] * (256 - a)
                canvas[row, column, k] = np.uint8(mixed >> 8)


@kernel
def darken(canvas: Bytes, dark: Floats) -> None:
    """Multiply a (H, W, 3) ``canvas``, in place, by 1 less (H, W) ``dark``."""
    for row in range(dark.shape[0]):
        for column in range(dark.shape[1]):
            if dark[row, column] <= 0.0:
                continue
            light = np.int64(256.0 * (1.0 - dark[row, column]) + 0.5)
            for k in range(3):
                canvas[row, column, k] = np.uint8(canvas[row, column, k] * light >> 8)


@kernel
def add_noise(picture: Bytes, noise: NDArray[np.int8], strength: int) -> None:
    """Add ``noise`` times ``strength`` / 128 to a picture, both flat, in place."""
    for i in range(len(picture)):
        value = np.int64(picture[i]) + ((np.int64(noise[i]) * strength) >> 7)
        picture[i] = np.uint8(0 if value < 0 else 255 if value > 255 else value)


@kernel
def extent(coordinates: Floats, R: NDArray[np.float64], t_z: float) -> tuple[float, float, float, float]:
    """Least and greatest x/z and y/z of (3, V) points seen from ``t_z`` before their origin."""
    x_low, y_low, x_high, y_high = np.inf, np.inf, -np.inf, -np.inf
    r00, r01, r02, r10, r11, r12 = R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2]
    r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
    for i in range(coordinates.shape[1]):
        x, y, z = coordinates[0, i], coordinates[1, i], coordinates[2, i]
        w = 1.0 / (r20 * x + r21 * y + r22 * z + t_z)
        u = (r00 * x + r01 * y + r02 * z) * w
        v = (r10 * x + r11 * y + r12 * z) * w
        x_low, x_high = min(x_low, u), max(x_high, u)
        y_low, y_high = min(y_low, v), max(y_high, v)
    return x_low, y_low, x_high, y_high


@kernel
def scaled_normals(normals: Floats, faces: NDArray[np.int32], slope: Floats, out: Floats) -> None:
    """(F, 3, 3) corner normals times their vertex's (V, 3) ``slope``, of unit length, into ``out``."""
    for f in range(len(faces)):
        for c in range(3):
            v = faces[f, c]
            x = normals[f, c, 0] * slope[v, 0]
            y = normals[f, c, 1] * slope[v, 1]
            z = normals[f, c, 2] * slope[v, 2]
            scale = np.float32(1.0) / np.float32(math.sqrt(x * x + y * y + z * z + np.float32(1e-12)))
            out[f, c, 0], out[f, c, 1], out[f, c, 2] = x * scale, y * scale, z * scale


@kernel
def project_along(
    vertices: Floats, faces: NDArray[np.int32], scale: float, u: float, v: float, uv: Floats
) -> None:
    """Texture coordinates (F, 3, 2) of each face, from the two axes that it lies along most.

    Args:
        vertices: (V, 3).
        faces: (F, 3).
        scale: From a length to a texture coordinate.
        u: Added to the first coordinate.
        v: Added to the second.
        uv: Written.
    """
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        px, py, pz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        qx, qy, qz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        nx, ny, nz = abs(py * qz - pz * qy), abs(pz * qx - px * qz), abs(px * qy - py * qx)
        first, second = 0, 1
        if nx >= ny and nx >= nz:
            first = 2
        elif ny >= nz:
            second = 2
        for k in range(3):
            uv[f, k, 0] = vertices[faces[f, k], first] * scale + u
            uv[f, k, 1] = vertices[faces[f, k], second] * scale + v
