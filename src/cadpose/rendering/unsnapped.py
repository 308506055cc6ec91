"""Visibility of the few faces that reach behind the camera or far out of the image, compiled by numba."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.jit import kernel

# Mirrors of visibility.py: a kernel may only freeze constants of its own file.
_NEAR = 0.01
_ID_MAX = (1 << 24) - 1
_W_TO_WORD = float(1 << 24)

_int64: Any = np.int64  # a scalar of numpy is not an int to a type checker


@kernel
def draw_general(
    faces: NDArray[np.int32],
    begin: int,
    end: int,
    screen: NDArray[np.int32],
    cam: NDArray[np.float64],
    focal: float,
    cx: float,
    cy: float,
    ss: int,
    scale: float,
    tie: int,
    cutout: bool,
    corner_uv: NDArray[np.float32],
    face_material: NDArray[np.int32],
    material_levels: NDArray[np.int32],
    levels: NDArray[np.int32],
    texels: NDArray[np.uint32],
    columns: int,
    rows: int,
    words: NDArray[np.int64],
) -> None:
    """The slow road, for faces that reach behind the camera or far out of the image.

    Homogeneous edge functions d . (P_j x P_k) of the ray d through the sample (Olano and Greer 1997)
    need no clipping. A sample is drawn if z >= NEAR. Cut-outs are looked up in the finest texture.
    """
    n = np.empty((3, 3))
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if not (screen[a, 3] | screen[b, 3] | screen[c, 3]):
            continue
        x_lo, y_lo, x_hi, y_hi = np.inf, np.inf, -np.inf, -np.inf
        for k in range(3):
            i, j = faces[f, k], faces[f, (k + 1) % 3]
            n[k, 0] = cam[i, 1] * cam[j, 2] - cam[i, 2] * cam[j, 1]
            n[k, 1] = cam[i, 2] * cam[j, 0] - cam[i, 0] * cam[j, 2]
            n[k, 2] = cam[i, 0] * cam[j, 1] - cam[i, 1] * cam[j, 0]
            # Corners of the face cut off at z = NEAR, for the bounding box.
            zi, zj = cam[i, 2], cam[j, 2]
            if zi >= _NEAR:
                x, y = cam[i, 0] / zi, cam[i, 1] / zi
                x_lo, x_hi, y_lo, y_hi = min(x_lo, x), max(x_hi, x), min(y_lo, y), max(y_hi, y)
            if (zi >= _NEAR) != (zj >= _NEAR):
                s = (_NEAR - zi) / (zj - zi)
                x = (cam[i, 0] + s * (cam[j, 0] - cam[i, 0])) / _NEAR
                y = (cam[i, 1] + s * (cam[j, 1] - cam[i, 1])) / _NEAR
                x_lo, x_hi, y_lo, y_hi = min(x_lo, x), max(x_hi, x), min(y_lo, y), max(y_hi, y)
        if x_lo > x_hi:
            continue
        c0 = int(np.ceil(min(max((focal * x_lo + cx) * ss - 0.5, 0.0), float(columns))))
        r0 = int(np.ceil(min(max((focal * y_lo + cy) * ss - 0.5, 0.0), float(rows))))
        c1 = int(np.floor(max(min((focal * x_hi + cx) * ss - 0.5, columns - 1.0), -1.0)))
        r1 = int(np.floor(max(min((focal * y_hi + cy) * ss - 0.5, rows - 1.0), -1.0)))
        if c0 > c1 or r0 > r1:
            continue
        det = cam[c, 0] * n[0, 0] + cam[c, 1] * n[0, 1] + cam[c, 2] * n[0, 2]
        if det == 0.0:
            continue
        level = 0
        if cutout:
            level = material_levels[face_material[f], 0]
        low = _int64(f + 1)
        for r in range(r0, r1 + 1):
            dy = ((r + 0.5) / ss - cy) / focal
            for col in range(c0, c1 + 1):
                dx = ((col + 0.5) / ss - cx) / focal
                lc = (dx * n[0, 0] + dy * n[0, 1] + n[0, 2]) / det
                la = (dx * n[1, 0] + dy * n[1, 1] + n[1, 2]) / det
                lb = (dx * n[2, 0] + dy * n[2, 1] + n[2, 2]) / det
                if la < 0.0 or lb < 0.0 or lc < 0.0:
                    continue
                w = la + lb + lc
                if w <= 0.0 or w * _NEAR > 1.0:
                    continue
                word = (_int64(w * scale * _W_TO_WORD) & ~_ID_MAX) | low
                if word + tie <= words[r, col]:
                    continue
                if cutout:
                    u = (la * corner_uv[f, 0, 0] + lb * corner_uv[f, 1, 0] + lc * corner_uv[f, 2, 0]) / w
                    v = (la * corner_uv[f, 0, 1] + lb * corner_uv[f, 1, 1] + lc * corner_uv[f, 2, 1]) / w
                    tw, th = levels[level, 1], levels[level, 2]
                    tx = min(int((u - np.floor(u)) * tw), tw - 1)
                    ty = min(int((1.0 - (v - np.floor(v))) * th), th - 1)
                    if texels[levels[level, 0] + ty * tw + tx] >> 31 == 0:
                        continue
                words[r, col] = word
