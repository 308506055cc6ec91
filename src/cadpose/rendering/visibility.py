"""Which face is seen at every sample: vertex transform and z-buffer, compiled by numba.

A sample's word is ``depth << ID_BITS | (face + 1)``, with ``depth`` a fixed-point 1/z: one comparison tests
and one store writes depth and face at once. Faces are drawn in the mesh's order, and one that lies behind by
no more than 4e-5 of its distance counts as coplanar and is drawn over: CAD models lay decals on surfaces,
rounded to their file's decimals.

Vertices snap to 1/4096 sample and edges are exact 64-bit integers, so the top-left rule holds exactly:
two triangles that share an edge cover each sample once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.jit import kernel

#: Nearest distance that is drawn, in units of the mesh.
NEAR = 0.01
#: Low bits of a sample's word, for the face.
ID_BITS = 24
ID_MAX = (1 << ID_BITS) - 1

_SUB = 12  # bits of a sample that a vertex snaps to
_ONE = 1 << _SUB
_GUARD = float(1 << 26)  # beyond that many 1/4096 samples, edges are drawn in floating point
_W_SCALE = float(1 << 30)  # fixed-point 1/z of the nearest vertex
_COPLANAR = 4e-5
_W_TO_WORD = float(1 << ID_BITS)
_BLOCK = 512  # vertices projected at once
_SPAN = 16  # bounding boxes wider than this are cut to the row's exact span

# Typed as Any, as scalars of numpy are neither int nor float to a type checker.
_int64: Any = np.int64
_int32: Any = np.int32
_float64: Any = np.float64

Words = NDArray[np.int64]
Ints = NDArray[np.int32]
Doubles = NDArray[np.float64]


@kernel
def project(
    coordinates: NDArray[np.float32],
    R: Doubles,
    t: Doubles,
    focal: float,
    cx: float,
    cy: float,
    ss: int,
    scale: float,
    screen: Ints,
) -> tuple[int, int, int, int, bool]:
    """Vertices into the camera frame and onto the sample grid.

    Args:
        coordinates: (3, V) x, y and z of the vertices.
        R: (3, 3) rotation to the camera frame.
        t: (3,) translation.
        focal: Pixels.
        cx: Principal point, continuous pixels.
        cy: Principal point, continuous pixels.
        ss: Samples a pixel along each axis.
        scale: From 1/z to its fixed-point value, see depth_scales.
        screen: (V, 4), written: x, y in 1/4096 samples, fixed-point 1/z, 1 if it cannot be snapped.

    Returns:
        x_min, y_min, x_max, y_max of the snapped vertices in whole samples, outwards, and whether any vertex
        could not be snapped.
    """
    f = focal * ss * _ONE
    ox = (cx * ss - 0.5) * _ONE
    oy = (cy * ss - 0.5) * _ONE
    x_lo, y_lo, x_hi, y_hi = _int32(2**30), _int32(2**30), _int32(-(2**30)), _int32(-(2**30))
    unsnapped = _int32(0)
    r00, r01, r02, r10, r11, r12 = R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2]
    r20, r21, r22, t0, t1, t2 = R[2, 0], R[2, 1], R[2, 2], t[0], t[1], t[2]
    # Blocks of separate coordinates compile to vector code; they are interleaved while in the cache.
    xs, ys = np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    ws, bads = np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    for begin in range(0, coordinates.shape[1], _BLOCK):
        count = min(_BLOCK, coordinates.shape[1] - begin)
        for j in range(count):
            i = begin + j
            vx, vy, vz = _float64(coordinates[0, i]), _float64(coordinates[1, i]), _float64(coordinates[2, i])
            z = r20 * vx + r21 * vy + r22 * vz + t2
            w = 1.0 / max(z, NEAR)
            x = f * (r00 * vx + r01 * vy + r02 * vz + t0) * w + ox
            y = f * (r10 * vx + r11 * vy + r12 * vz + t1) * w + oy
            bads[j] = _int32((z < NEAR) | (abs(x) > _GUARD) | (abs(y) > _GUARD))
            # Truncating a positive number rounds down, without a call to floor.
            xs[j] = _int32(min(max(x, -_GUARD), _GUARD) + (_GUARD + 0.5)) - _int32(_GUARD)
            ys[j] = _int32(min(max(y, -_GUARD), _GUARD) + (_GUARD + 0.5)) - _int32(_GUARD)
            ws[j] = _int32(min(w * scale, _W_SCALE))
        for j in range(count):
            x_lo, x_hi = min(x_lo, xs[j]), max(x_hi, xs[j])
            y_lo, y_hi = min(y_lo, ys[j]), max(y_hi, ys[j])
            unsnapped |= bads[j]
        for j in range(count):
            screen[begin + j, 0] = xs[j]
            screen[begin + j, 1] = ys[j]
            screen[begin + j, 2] = ws[j]
            screen[begin + j, 3] = bads[j]
    return x_lo >> _SUB, y_lo >> _SUB, (x_hi >> _SUB) + 1, (y_hi >> _SUB) + 1, unsnapped != 0


def depth_scales(z_min: float, z_max: float) -> tuple[float, int]:
    """How depth is written in a view whose vertices lie from ``z_min`` to ``z_max`` or within.

    Returns:
        From 1/z to a vertex's fixed-point value, and by how much the words of coplanar faces may differ.
    """
    z_min = max(z_min, NEAR)
    return _W_SCALE * z_min, int(_COPLANAR * _W_SCALE * z_min / max(z_max, z_min)) << ID_BITS


@kernel
def draw(
    faces: Ints,
    begin: int,
    end: int,
    screen: Ints,
    columns: int,
    rows: int,
    unsnapped: bool,
    tie: int,
    cutout: bool,
    uv_area: NDArray[np.float32],
    corner_uv: NDArray[np.float32],
    face_material: Ints,
    material_levels: Ints,
    levels: Ints,
    texels: NDArray[np.uint32],
    words: Words,
) -> None:
    """Faces ``begin`` to ``end`` into ``words`` (rows * columns,); unsnapped faces are left to draw_general.

    ``tie`` is by how much the words of coplanar faces may differ.

    With ``cutout`` a sample is drawn only where the texel of the face's mip level is at least half opaque.
    """
    level, tw, th, start = 0, 1, 1, 0
    ua, va, ub, vb, uc, vc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, xb, xc = _int64(screen[a, 0]), _int64(screen[b, 0]), _int64(screen[c, 0])
        ya, yb, yc = _int64(screen[a, 1]), _int64(screen[b, 1]), _int64(screen[c, 1])
        c0 = max((min(xa, min(xb, xc)) + (_ONE - 1)) >> _SUB, 0)
        c1 = min(max(xa, max(xb, xc)) >> _SUB, columns - 1)
        r0 = max((min(ya, min(yb, yc)) + (_ONE - 1)) >> _SUB, 0)
        r1 = min(max(ya, max(yb, yc)) >> _SUB, rows - 1)
        # Often a small face has no sample in its box. One test, as each alone would be mispredicted.
        if ((c1 - c0) | (r1 - r0)) < 0:
            continue
        if unsnapped and (screen[a, 3] | screen[b, 3] | screen[c, 3]):
            continue
        wa, wb, wc = _int64(screen[a, 2]), _int64(screen[b, 2]), _int64(screen[c, 2])
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        if area == 0:
            continue
        # Seen from behind: swap b and c, without a branch.
        behind = area >> 63
        area = (area ^ behind) - behind
        swap = (xb ^ xc) & behind
        xb ^= swap
        xc ^= swap
        swap = (yb ^ yc) & behind
        yb ^= swap
        yc ^= swap
        swap = (wb ^ wc) & behind
        wb ^= swap
        wc ^= swap
        # Edge functions at the box's first sample; >= 0 inside, a tie belongs to top and left edges only.
        px = (c0 << _SUB) - xa
        py = (r0 << _SUB) - ya
        abx, aby, cax, cay = xb - xa, yb - ya, xa - xc, ya - yc
        bcx, bcy = xc - xb, yc - yb
        e_ab = abx * py - aby * px
        e_ca = cax * py - cay * px
        t_ab = e_ab - 1 + ((aby < 0) | ((aby == 0) & (abx > 0)))
        t_bc = area - e_ab - e_ca - 1 + ((bcy < 0) | ((bcy == 0) & (bcx > 0)))
        t_ca = e_ca - 1 + ((cay < 0) | ((cay == 0) & (cax > 0)))
        low = _int64(f + 1)
        per_area = 1.0 / area
        wub = _float64(wb - wa) * per_area
        wuc = _float64(wc - wa) * per_area
        w_row = wa + e_ca * wub + e_ab * wuc
        w_x = (-cay * wub - aby * wuc) * _ONE
        w_y = (cax * wub + abx * wuc) * _ONE
        s_ab, s_bc, s_ca = -(aby << _SUB), -(bcy << _SUB), -(cay << _SUB)
        if cutout:
            k = 1 - behind  # the corner that is now b: 1, or 2 when swapped
            ua, va = wa * _float64(corner_uv[f, 0, 0]), wa * _float64(corner_uv[f, 0, 1])
            ub, vb = wb * _float64(corner_uv[f, k, 0]) - ua, wb * _float64(corner_uv[f, k, 1]) - va
            k = 2 + behind
            uc, vc = wc * _float64(corner_uv[f, k, 0]) - ua, wc * _float64(corner_uv[f, k, 1]) - va
            level = material_levels[face_material[f], 0]
            last = level + material_levels[face_material[f], 1] - 1
            ratio = uv_area[f] * levels[level, 1] * levels[level, 2] * 2.0 * _ONE * _ONE * per_area
            while ratio > 2.0 and level < last:
                ratio *= 0.25
                level += 1
            start, tw, th = levels[level, 0], levels[level, 1], levels[level, 2]
        wide = c1 - c0 >= _SPAN
        d_row = _int64(w_row * _W_TO_WORD)
        d_x = _int64(w_x * _W_TO_WORD)
        d_y = _int64(w_y * _W_TO_WORD)
        across = c1 - c0 + 1
        if not wide and not cutout:
            # One loop over the box without a branch in it: its end is the only one to mispredict.
            at = r0 * columns + c0
            back_ab = (abx << _SUB) - (across - 1) * s_ab
            back_bc = (bcx << _SUB) - (across - 1) * s_bc
            back_ca = (cax << _SUB) - (across - 1) * s_ca
            back_d = d_y - (across - 1) * d_x
            left = across
            for _ in range(across * (r1 - r0 + 1)):
                outside = (t_ab | t_bc | t_ca) >> 63
                word = ((d_row & ~ID_MAX) | low) & ~outside
                k_word = np.uintp(at)
                words[k_word] = word if word + tie > words[k_word] else words[k_word]
                left -= 1
                turn = left == 0
                t_ab += back_ab if turn else s_ab
                t_bc += back_bc if turn else s_bc
                t_ca += back_ca if turn else s_ca
                d_row += back_d if turn else d_x
                at += columns - across + 1 if turn else 1
                left = across if turn else left
            continue
        lo, hi = c0, c1
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
            if not cutout:
                i = lo - c0
                v_ab, v_bc, v_ca, d = t_ab + i * s_ab, t_bc + i * s_bc, t_ca + i * s_ca, d_row + i * d_x
                at = r * columns + lo
                # No branch in here: short rows run without mispredictions, long ones as vector code.
                for j in range(hi - lo + 1):
                    outside = ((v_ab + j * s_ab) | (v_bc + j * s_bc) | (v_ca + j * s_ca)) >> 63
                    word = (((d + j * d_x) & ~ID_MAX) | low) & ~outside
                    k_word = np.uintp(at + j)
                    words[k_word] = word if word + tie > words[k_word] else words[k_word]
            else:
                for col in range(lo, hi + 1):
                    i = col - c0
                    if ((t_ab + i * s_ab) | (t_bc + i * s_bc) | (t_ca + i * s_ca)) < 0:
                        continue
                    word = ((d_row + i * d_x) & ~ID_MAX) | low
                    if word + tie <= words[r * columns + col]:
                        continue
                    px, py = (col << _SUB) - xa, (r << _SUB) - ya
                    q_ca, q_ab = (cax * py - cay * px) * per_area, (abx * py - aby * px) * per_area
                    per_w = 1.0 / (w_row + i * w_x + (r - r0) * w_y)
                    u = (ua + q_ca * ub + q_ab * uc) * per_w
                    v = (va + q_ca * vb + q_ab * vc) * per_w
                    tx = min(int((u - np.floor(u)) * tw), tw - 1)
                    ty = min(int((1.0 - (v - np.floor(v))) * th), th - 1)
                    if texels[start + ty * tw + tx] >> 31:
                        words[r * columns + col] = word
            t_ab += abx << _SUB
            t_bc += bcx << _SUB
            t_ca += cax << _SUB
            d_row += d_y


@kernel
def draw_general(
    faces: Ints,
    begin: int,
    end: int,
    screen: Ints,
    cam: Doubles,
    focal: float,
    cx: float,
    cy: float,
    ss: int,
    scale: float,
    tie: int,
    cutout: bool,
    corner_uv: NDArray[np.float32],
    face_material: Ints,
    material_levels: Ints,
    levels: Ints,
    texels: NDArray[np.uint32],
    columns: int,
    rows: int,
    words: Words,
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
                if w <= 0.0 or w * NEAR > 1.0:
                    continue
                word = (_int64(w * scale * _W_TO_WORD) & ~ID_MAX) | low
                if word + tie <= words[r * columns + col]:
                    continue
                if cutout:
                    u = (la * corner_uv[f, 0, 0] + lb * corner_uv[f, 1, 0] + lc * corner_uv[f, 2, 0]) / w
                    v = (la * corner_uv[f, 0, 1] + lb * corner_uv[f, 1, 1] + lc * corner_uv[f, 2, 1]) / w
                    tw, th = levels[level, 1], levels[level, 2]
                    tx = min(int((u - np.floor(u)) * tw), tw - 1)
                    ty = min(int((1.0 - (v - np.floor(v))) * th), th - 1)
                    if texels[levels[level, 0] + ty * tw + tx] >> 31 == 0:
                        continue
                words[r * columns + col] = word
