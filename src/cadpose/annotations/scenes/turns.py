"""Rotations as the quaternions that scene files hold."""

from __future__ import annotations

import numpy as np

from cadpose.geometry.frames import FloatArray


def quaternion(R: FloatArray) -> list[float]:
    """(3, 3) rotation as x, y, z, w, w >= 0 (Shepperd's method: the largest component first)."""
    squares = np.array(
        [
            1.0 + R[0, 0] - R[1, 1] - R[2, 2],
            1.0 - R[0, 0] + R[1, 1] - R[2, 2],
            1.0 - R[0, 0] - R[1, 1] + R[2, 2],
            1.0 + np.trace(R),
        ]
    )
    products = np.array(
        [
            [squares[0], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
            [R[0, 1] + R[1, 0], squares[1], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], squares[2], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], squares[3]],
        ]
    )
    row = products[int(squares.argmax())]
    unit = row / np.linalg.norm(row)
    return [float(value) for value in (unit if unit[3] >= 0 else -unit)]
