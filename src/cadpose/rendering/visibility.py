"""Which face is seen at every sample: vertex transform and z-buffer, compiled by numba.

A sample's word is ``depth << ID_BITS | (ID_MAX - face)``, with ``depth`` a quantised 1/z. The nearest
face is the largest word, so one integer maximum tests and writes depth and face at once; coplanar
faces fall into the same depth step, where the face that comes first in the mesh wins instead of
numerical noise.

Vertices snap to 1/4096 sample and edges are exact 64-bit integers, so the top-left rule holds exactly:
two triangles that share an edge cover each sample once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.rendering.jit import kernel

#: Nearest distance that is drawn, in units of the mesh.
NEAR = 0.01
#: Low bits of a sample's word, for the face.
ID_BITS = 24
ID_MAX = (1 << ID_BITS) - 1

_SUB = 12  # bits of a sample that a vertex snaps to
_ONE = 1 << _SUB
_GUARD = float(1 << 26)  # beyond that many 1/4096 samples, edges are drawn in floating point
_W_SCALE = float(1 << 30)  # fixed-point 1/z of the nearest vertex
_W_DROP = 13  # low bits of it that are noise: what is left resolves 2e-5 at z = 2
_SPAN = 6  # bounding boxes wider than this are cut to the row's exact span

Words = NDArray[np.int64]
Ints = NDArray[np.int32]
Doubles = NDArray[np.float64]


@kernel
def project(
    vertices: NDArray[np.float32],
    R: Doubles,
    t: Doubles,
    focal: float,
    cx: float,
    cy: float,
    width: int,
    height: int,
    ss: int,
    cam: Doubles,
    screen: Ints,
) -> tuple[int, int, int, int, bool, float]:
    """Vertices into the camera frame and onto the sample grid.

    Args:
        vertices: (V, 3).
        R: (3, 3) rotation to the camera frame.
        t: (3,) translation.
        focal: Pixels.
        cx: Principal point, continuous pixels.
        cy: Principal point, continuous pixels.
        width: Pixels.
        height: Pixels.
        ss: Samples a pixel along each axis.
        cam: (V, 3), written: positions in the camera frame.
        screen: (V, 4), written: x, y in 1/4096 samples, fixed-point 1/z, 1 if it cannot be snapped.

    Returns:
        Pixel rectangle [x0, y0, x1, y1) that may be covered, whether any vertex cannot be snapped, and the
        scale from 1/z to its fixed-point value.
    """
    z_min = np.inf
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        cam[i, 0] = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0]
        cam[i, 1] = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1]
        cam_z = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2]
        cam[i, 2] = cam_z
        z_min = min(z_min, cam_z)
    scale = _W_SCALE * max(z_min, NEAR)
    x_lo, y_lo, x_hi, y_hi = np.inf, np.inf, -np.inf, -np.inf
    unsnapped = False
    f = focal * ss * _ONE
    ox = (cx * ss - 0.5) * _ONE
    oy = (cy * ss - 0.5) * _ONE
    for i in range(len(vertices)):
        z = cam[i, 2]
        w = 1.0 / max(z, NEAR)
        x = f * cam[i, 0] * w + ox
        y = f * cam[i, 1] * w + oy
        bad = z < NEAR or abs(x) > _GUARD or abs(y) > _GUARD
        unsnapped |= bad
        x = min(max(x, -_GUARD), _GUARD)
        y = min(max(y, -_GUARD), _GUARD)
        screen[i, 0] = np.int32(np.floor(x + 0.5))
        screen[i, 1] = np.int32(np.floor(y + 0.5))
        screen[i, 2] = np.int32(w * scale)
        screen[i, 3] = bad
        x_lo, x_hi = min(x_lo, x), max(x_hi, x)
        y_lo, y_hi = min(y_lo, y), max(y_hi, y)
    if unsnapped:
        return 0, 0, width, height, True, scale
    unit = ss * _ONE
    return (
        min(max(int(np.floor(x_lo / unit)), 0), width),
        min(max(int(np.floor(y_lo / unit)), 0), height),
        min(max(int(np.ceil(x_hi / unit)) + 1, 0), width),
        min(max(int(np.ceil(y_hi / unit)) + 1, 0), height),
        False,
        scale,
    )


@kernel
def draw(
    faces: Ints,
    begin: int,
    end: int,
    screen: Ints,
    columns: int,
    rows: int,
    unsnapped: bool,
    words: Words,
) -> None:
    """Faces ``begin`` to ``end`` into ``words`` (rows, columns); unsnapped faces are left to draw_general."""
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, xb, xc = np.int64(screen[a, 0]), np.int64(screen[b, 0]), np.int64(screen[c, 0])
        c0 = (min(xa, min(xb, xc)) + (_ONE - 1)) >> _SUB
        c1 = max(xa, max(xb, xc)) >> _SUB
        c0 = max(c0, 0)
        c1 = min(c1, columns - 1)
        if c0 > c1:
            continue
        ya, yb, yc = np.int64(screen[a, 1]), np.int64(screen[b, 1]), np.int64(screen[c, 1])
        r0 = (min(ya, min(yb, yc)) + (_ONE - 1)) >> _SUB
        r1 = max(ya, max(yb, yc)) >> _SUB
        r0 = max(r0, 0)
        r1 = min(r1, rows - 1)
        if r0 > r1:
            continue
        if unsnapped and (screen[a, 3] | screen[b, 3] | screen[c, 3]):
            continue
        wa, wb, wc = screen[a, 2], screen[b, 2], screen[c, 2]
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        if area == 0:
            continue
        if area < 0:
            area = -area
            xb, xc = xc, xb
            yb, yc = yc, yb
            wb, wc = wc, wb
        # Edge functions at the box's first sample; >= 0 inside, a tie belongs to top and left edges only.
        px = (c0 << _SUB) - xa
        py = (r0 << _SUB) - ya
        abx, aby, cax, cay = xb - xa, yb - ya, xa - xc, ya - yc
        bcx, bcy = xc - xb, yc - yb
        e_ab = abx * py - aby * px
        e_ca = cax * py - cay * px
        e_bc = area - e_ab - e_ca
        t_ab = e_ab - (1 - int(aby < 0 or (aby == 0 and abx > 0)))
        t_bc = e_bc - (1 - int(bcy < 0 or (bcy == 0 and bcx > 0)))
        t_ca = e_ca - (1 - int(cay < 0 or (cay == 0 and cax > 0)))
        low = np.int64(ID_MAX - f)
        if c0 == c1 and r0 == r1:
            if (t_ab | t_bc | t_ca) >= 0:
                w = wa + (e_ca * np.float64(wb - wa) + e_ab * np.float64(wc - wa)) / area
                word = ((np.int64(w) >> _W_DROP) << ID_BITS) | low
                words[r0, c0] = max(words[r0, c0], word)
            continue
        per_area = 1.0 / area
        ub = np.float64(wb - wa) * per_area
        uc = np.float64(wc - wa) * per_area
        w_row = wa + e_ca * ub + e_ab * uc
        w_x = (-cay * ub - aby * uc) * _ONE
        w_y = (cax * ub + abx * uc) * _ONE
        s_ab, s_bc, s_ca = -(aby << _SUB), -(bcy << _SUB), -(cay << _SUB)
        wide = c1 - c0 >= _SPAN
        for r in range(r0, r1 + 1):
            if wide:
                lo, hi = c0, c1
                for k in range(3):
                    e, s = t_ab, s_ab
                    if k == 1:
                        e, s = t_bc, s_bc
                    elif k == 2:
                        e, s = t_ca, s_ca
                    if s > 0:
                        if e < 0:
                            lo = max(lo, c0 + (s - 1 - e) // s)
                    elif e < 0:
                        hi = -1
                    elif s < 0:
                        hi = min(hi, c0 + e // -s)
                for col in range(lo, hi + 1):
                    w = w_row + np.float64(col - c0) * w_x
                    word = (np.int64(np.int32(w) >> _W_DROP) << ID_BITS) | low
                    words[r, col] = max(words[r, col], word)
            else:
                u_ab, u_bc, u_ca, w = t_ab, t_bc, t_ca, w_row
                for col in range(c0, c1 + 1):
                    if (u_ab | u_bc | u_ca) >= 0:
                        word = (np.int64(np.int32(w) >> _W_DROP) << ID_BITS) | low
                        words[r, col] = max(words[r, col], word)
                    u_ab += s_ab
                    u_bc += s_bc
                    u_ca += s_ca
                    w += w_x
            t_ab += abx << _SUB
            t_bc += bcx << _SUB
            t_ca += cax << _SUB
            w_row += w_y


@kernel
def draw_general(
    faces: Ints,
    begin: int,
    end: int,
    only_unsnapped: bool,
    screen: Ints,
    cam: Doubles,
    focal: float,
    cx: float,
    cy: float,
    ss: int,
    scale: float,
    cutout: bool,
    corner_uv: NDArray[np.float32],
    uv_area: NDArray[np.float32],
    face_material: Ints,
    material_levels: Ints,
    levels: Ints,
    texels: NDArray[np.uint8],
    columns: int,
    rows: int,
    words: Words,
) -> None:
    """The slow road: faces that reach behind the camera, and cut-out faces (a texture with holes).

    Homogeneous edge functions d . (P_j x P_k) of the ray d through the sample (Olano and Greer 1997)
    need no clipping. A sample is drawn if z >= NEAR and, with ``cutout``, if the texel of the face's mip
    level there is at least half opaque.
    """
    n = np.empty((3, 3))
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if only_unsnapped and not (screen[a, 3] | screen[b, 3] | screen[c, 3]):
            continue
        x_lo, y_lo, x_hi, y_hi = np.inf, np.inf, -np.inf, -np.inf
        for k in range(3):
            i, j = faces[f, k], faces[f, (k + 1) % 3]
            n[k, 0] = cam[i, 1] * cam[j, 2] - cam[i, 2] * cam[j, 1]
            n[k, 1] = cam[i, 2] * cam[j, 0] - cam[i, 0] * cam[j, 2]
            n[k, 2] = cam[i, 0] * cam[j, 1] - cam[i, 1] * cam[j, 0]
            # Corners of the face cut off at z = NEAR, for the bounding box.
            zi, zj = cam[i, 2], cam[j, 2]
            if zi >= NEAR:
                x, y = cam[i, 0] / zi, cam[i, 1] / zi
                x_lo, x_hi, y_lo, y_hi = min(x_lo, x), max(x_hi, x), min(y_lo, y), max(y_hi, y)
            if (zi >= NEAR) != (zj >= NEAR):
                s = (NEAR - zi) / (zj - zi)
                x = (cam[i, 0] + s * (cam[j, 0] - cam[i, 0])) / NEAR
                y = (cam[i, 1] + s * (cam[j, 1] - cam[i, 1])) / NEAR
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
            last = level + material_levels[face_material[f], 1] - 1
            depths = cam[a, 2] * cam[b, 2] * cam[c, 2]
            ratio = uv_area[f] * levels[level, 1] * levels[level, 2] * 2.0 * depths
            ratio /= (focal * ss) ** 2 * abs(det)
            while ratio > 2.0 and level < last:
                ratio *= 0.25
                level += 1
        low = np.int64(ID_MAX - f)
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
                if w <= 0.0 or w * NEAR > 1.0:
                    continue
                word = ((np.int64(w * scale) >> _W_DROP) << ID_BITS) | low
                if word <= words[r, col]:
                    continue
                if cutout:
                    u = (la * corner_uv[f, 0, 0] + lb * corner_uv[f, 1, 0] + lc * corner_uv[f, 2, 0]) / w
                    v = (la * corner_uv[f, 0, 1] + lb * corner_uv[f, 1, 1] + lc * corner_uv[f, 2, 1]) / w
                    tw, th = levels[level, 1], levels[level, 2]
                    tx = min(int((u - np.floor(u)) * tw), tw - 1)
                    ty = min(int((1.0 - (v - np.floor(v))) * th), th - 1)
                    if texels[levels[level, 0] + ty * tw + tx, 3] < 128:
                        continue
                words[r, col] = word
