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
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from cadpose.jit import inlined, kernel

#: Nearest distance that is drawn, in units of the mesh.
NEAR = 0.01
#: Low bits of a sample's word, for the face.
ID_BITS = 24
#: Samples drawn at once.
LANES = 4
ID_MAX = (1 << ID_BITS) - 1

_SUB = 12  # bits of a sample that a vertex snaps to
_ONE = 1 << _SUB
_GUARD = float(1 << 26)  # beyond that many 1/4096 samples, edges are drawn in floating point
_W_SCALE = float(1 << 30)  # fixed-point 1/z of the nearest vertex
_COPLANAR = 4e-5
_W_TO_WORD = float(1 << ID_BITS)
_BLOCK = 512  # vertices projected at once
_BATCH = 128  # faces set up at once
_SPAN = 32  # bounding boxes wider than this are cut to the row's span

# Fields of a batch of faces: corner by corner x, y and w, then the box.
_A, _Y, _W = 0, _BATCH, 2 * _BATCH
_B, _C = 3 * _BATCH, 6 * _BATCH
_BAD, _C0, _R0, _ACROSS, _DOWN, _FIELDS = range(9 * _BATCH, 15 * _BATCH, _BATCH)

# Typed as Any, as scalars of numpy are neither int nor float to a type checker.
_int64: Any = np.int64
_int32: Any = np.int32
_float64: Any = np.float64

Four = tuple[int, int, int, int]
#: Three edge functions and depth at the first sample of a face's box, their steps to the right and down.
Planes = tuple[Four, Four, Four]
Words = NDArray[np.int64]
Ints = NDArray[np.int32]
Doubles = NDArray[np.float64]


def _lanes(context: Any, words: Any, at: Any, starts: Any, steps: Any, low: Any, tie: Any) -> tuple[Any, Any]:
    """Samples ``at`` to ``at + LANES - 1`` of a row as one vector: numba leaves so short a loop scalar.

    Args:
        context: Of the compiler.
        words: (N,) int64, written where the face is nearer than what is there.
        at: The first sample.
        starts: There, the three edge functions and the depth.
        steps: The same, from a sample to the next.
        low: The face's number.
        tie: By how much the words of coplanar faces may differ.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        vector = ir.VectorType(ir.IntType(64), LANES)

        nothing = ir.Constant(vector, ir.Undefined)
        index = ir.IntType(32)

        def constant(lanes: Any) -> Any:
            return ir.Constant(vector, list(lanes))

        def spread(value: Any) -> Any:
            first = builder.insert_element(nothing, value, ir.Constant(index, 0))
            return builder.shuffle_vector(
                first, nothing, ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
            )

        def along(start: Any, step: Any) -> Any:
            return builder.add(spread(start), builder.mul(spread(step), constant(range(LANES))))

        array = context.make_array(signature.args[0])(context, builder, values[0])
        low, tie = values[4:]
        ab, bc, ca, depth = (
            along(builder.extract_value(values[2], i), builder.extract_value(values[3], i)) for i in range(4)
        )
        pointer = builder.bitcast(builder.gep(array.data, [values[1]]), vector.as_pointer())
        inside = builder.or_(builder.or_(ab, bc), ca)
        inside = builder.icmp_signed(">=", inside, constant([0] * LANES))
        word = builder.or_(builder.and_(depth, constant([~ID_MAX] * LANES)), spread(low))
        before = builder.load(pointer, align=8)
        nearer = builder.icmp_signed(">", builder.add(word, spread(tie)), before)
        drawn = builder.select(builder.and_(inside, nearer), word, before)
        builder.store(drawn, pointer, align=8)
        return context.get_dummy_value()

    four = types.UniTuple(types.int64, 4)  # type: ignore[no-untyped-call]
    return types.none(words, types.int64, four, four, types.int64, types.int64), generate


_draw_lanes: Any = intrinsic(_lanes)


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
def _box(
    faces: Ints, first: int, count: int, screen: Ints, columns: int, rows: int, corners: Ints, kept: Ints
) -> int:
    """Corners and boxes of ``count`` faces from ``first``; many small ones have no sample in their box.

    Args:
        faces: (F, 3).
        first: A face.
        count: At most _BATCH.
        screen: (V, 4) of project.
        columns: Of the picture.
        rows: Of the picture.
        corners: (14 * _BATCH,), written field by field: x, y, w of the corners, whether one could not be
            snapped, then the box. Loops over separate fields compile to vector code.
        kept: (_BATCH + 1,), written: which of the faces may have samples.

    Returns:
        How many of ``kept`` are set.
    """
    for j in range(count):
        a, b, c = faces[first + j, 0], faces[first + j, 1], faces[first + j, 2]
        corners[_A + j], corners[_A + _Y + j], corners[_A + _W + j] = screen[a, 0], screen[a, 1], screen[a, 2]
        corners[_B + j], corners[_B + _Y + j], corners[_B + _W + j] = screen[b, 0], screen[b, 1], screen[b, 2]
        corners[_C + j], corners[_C + _Y + j], corners[_C + _W + j] = screen[c, 0], screen[c, 1], screen[c, 2]
        corners[_BAD + j] = screen[a, 3] | screen[b, 3] | screen[c, 3]
    for j in range(count):
        xa, xb, xc = corners[_A + j], corners[_B + j], corners[_C + j]
        ya, yb, yc = corners[_A + _Y + j], corners[_B + _Y + j], corners[_C + _Y + j]
        c0 = max((min(xa, min(xb, xc)) + (_ONE - 1)) >> _SUB, 0)
        r0 = max((min(ya, min(yb, yc)) + (_ONE - 1)) >> _SUB, 0)
        across = min(max(xa, max(xb, xc)) >> _SUB, columns - 1) - c0 + 1
        down = min(max(ya, max(yb, yc)) >> _SUB, rows - 1) - r0 + 1
        corners[_C0 + j], corners[_R0 + j] = c0, r0
        corners[_ACROSS + j], corners[_DOWN + j] = across, down
        kept[j] = (across > 0) & (down > 0) & (corners[_BAD + j] == 0)
    some = 0
    for j in range(count):
        keep = kept[j]
        kept[some] = j
        some += keep
    return some


@inlined
def _edges(corners: Ints, j: int) -> tuple[Planes, int, int]:
    """Face ``j`` of a batch: its planes, twice its area (0: not drawn), -1 if it is seen from behind."""
    xa, ya, wa = _int64(corners[_A + j]), _int64(corners[_A + _Y + j]), _int64(corners[_A + _W + j])
    xb, yb, wb = _int64(corners[_B + j]), _int64(corners[_B + _Y + j]), _int64(corners[_B + _W + j])
    xc, yc, wc = _int64(corners[_C + j]), _int64(corners[_C + _Y + j]), _int64(corners[_C + _W + j])
    area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
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
    px, py = (_int64(corners[_C0 + j]) << _SUB) - xa, (_int64(corners[_R0 + j]) << _SUB) - ya
    abx, aby, bcx, bcy, cax, cay = xb - xa, yb - ya, xc - xb, yc - yb, xa - xc, ya - yc
    e_ab, e_ca = abx * py - aby * px, cax * py - cay * px
    # Not below 0 inside; a tie belongs to top and left edges only.
    ab = e_ab - 1 + ((aby < 0) | ((aby == 0) & (abx > 0)))
    bc = area - e_ab - e_ca - 1 + ((bcy < 0) | ((bcy == 0) & (bcx > 0)))
    ca = e_ca - 1 + ((cay < 0) | ((cay == 0) & (cax > 0)))
    per_area = 1.0 / area
    wub, wuc = _float64(wb - wa) * per_area, _float64(wc - wa) * per_area
    start = (ab, bc, ca, _int64((wa + e_ca * wub + e_ab * wuc) * _W_TO_WORD))
    w_x, w_y = (-cay * wub - aby * wuc) * _ONE, (cax * wub + abx * wuc) * _ONE
    right = (-(aby << _SUB), -(bcy << _SUB), -(cay << _SUB), _int64(w_x * _W_TO_WORD))
    below = (abx << _SUB, bcx << _SUB, cax << _SUB, _int64(w_y * _W_TO_WORD))
    return (start, right, below), area, behind


@kernel
def draw(
    faces: Ints, begin: int, end: int, screen: Ints, columns: int, rows: int, tie: int, words: Words
) -> None:
    """Faces ``begin`` to ``end`` into ``words``; those that cannot be snapped are left to draw_general.

    Args:
        faces: (F, 3).
        begin: First face.
        end: Face after the last.
        screen: (V, 4) of project.
        columns: Of the picture.
        rows: Of the picture.
        tie: By how much the words of coplanar faces may differ.
        words: (rows, columns + LANES); the last LANES of a row are scratch.
    """
    stride, flat = words.shape[1], words.ravel()
    corners, kept = np.empty(_FIELDS, np.int32), np.empty(_BATCH + 1, np.int32)
    for first in range(begin, end, _BATCH):
        count = _box(faces, first, min(_BATCH, end - first), screen, columns, rows, corners, kept)
        for k in range(count):
            j = _int64(kept[k])
            planes, area, _ = _edges(corners, j)
            if area == 0:
                continue
            low = first + j + 1
            ab, bc, ca, d = planes[0]
            ab_x, bc_x, ca_x, d_x = planes[1]
            ab_y, bc_y, ca_y, d_y = planes[2]
            across, down = _int64(corners[_ACROSS + j]), _int64(corners[_DOWN + j])
            at = _int64(corners[_R0 + j]) * stride + corners[_C0 + j]
            if across <= _SPAN:
                for i in range(0, across, LANES):
                    e_ab, e_bc, e_ca, e_d = ab + i * ab_x, bc + i * bc_x, ca + i * ca_x, d + i * d_x
                    for j in range(down):
                        _draw_lanes(flat, at + i + j * stride, (e_ab, e_bc, e_ca, e_d), planes[1], low, tie)
                        e_ab, e_bc, e_ca, e_d = e_ab + ab_y, e_bc + bc_y, e_ca + ca_y, e_d + d_y
                continue
            per_ab, per_bc, per_ca = -1.0 / ab_x, -1.0 / bc_x, -1.0 / ca_x
            for _ in range(down):
                # About where the row enters and leaves the face; samples are tested exactly.
                lo, hi = 0.0, across - 1.0
                if ab_x > 0:
                    lo = max(lo, ab * per_ab)
                elif ab_x < 0:
                    hi = min(hi, ab * per_ab)
                if bc_x > 0:
                    lo = max(lo, bc * per_bc)
                elif bc_x < 0:
                    hi = min(hi, bc * per_bc)
                if ca_x > 0:
                    lo = max(lo, ca * per_ca)
                elif ca_x < 0:
                    hi = min(hi, ca * per_ca)
                i, stop = _int64(lo), _int64(max(hi, 0.0) + 1.01)
                e_ab, e_bc, e_ca, e_d = ab + i * ab_x, bc + i * bc_x, ca + i * ca_x, d + i * d_x
                for j in range(i, stop, LANES):
                    _draw_lanes(flat, at + j, (e_ab, e_bc, e_ca, e_d), planes[1], low, tie)
                    e_ab += LANES * ab_x
                    e_bc += LANES * bc_x
                    e_ca += LANES * ca_x
                    e_d += LANES * d_x
                ab, bc, ca, d, at = ab + ab_y, bc + bc_y, ca + ca_y, d + d_y, at + stride


@kernel
def draw_cutout(
    faces: Ints,
    begin: int,
    end: int,
    screen: Ints,
    columns: int,
    rows: int,
    tie: int,
    uv_area: NDArray[np.float32],
    corner_uv: NDArray[np.float32],
    face_material: Ints,
    material_levels: Ints,
    levels: Ints,
    texels: NDArray[np.uint32],
    words: Words,
) -> None:
    """As draw, only where the texel of the face's mip level is at least half opaque."""
    corners, kept = np.empty(_FIELDS, np.int32), np.empty(_BATCH + 1, np.int32)
    for first in range(begin, end, _BATCH):
        count = _box(faces, first, min(_BATCH, end - first), screen, columns, rows, corners, kept)
        for k in range(count):
            j = _int64(kept[k])
            (start, right, below), area, behind = _edges(corners, j)
            if area == 0:
                continue
            f = first + j
            c0, r0 = _int64(corners[_C0 + j]), _int64(corners[_R0 + j])
            b = 1 - behind  # the corner that is now b: 1, or 2 when swapped
            c = 3 - b
            wa, wb, wc = screen[faces[f, 0], 2], screen[faces[f, b], 2], screen[faces[f, c], 2]
            level = material_levels[face_material[f], 0]
            last = level + material_levels[face_material[f], 1] - 1
            ratio = uv_area[f] * levels[level, 1] * levels[level, 2] * 2.0 * _ONE * _ONE / area
            while ratio > 2.0 and level < last:
                ratio *= 0.25
                level += 1
            texel, tw, th = levels[level, 0], levels[level, 1], levels[level, 2]
            for y in range(corners[_DOWN + j]):
                for x in range(corners[_ACROSS + j]):
                    e_ab = start[0] + x * right[0] + y * below[0]
                    e_bc = start[1] + x * right[1] + y * below[1]
                    e_ca = start[2] + x * right[2] + y * below[2]
                    if (e_ab | e_bc | e_ca) < 0:
                        continue
                    word = ((start[3] + x * right[3] + y * below[3]) & ~ID_MAX) | (f + 1)
                    if word + tie <= words[r0 + y, c0 + x]:
                        continue
                    # Corner weights over z, at their sample but for the tie's 1 in the edge functions.
                    la, lb, lc = _float64(e_bc) * wa, _float64(e_ca) * wb, _float64(e_ab) * wc
                    per = 1.0 / max(la + lb + lc, 1e-30)
                    u = (la * corner_uv[f, 0, 0] + lb * corner_uv[f, b, 0] + lc * corner_uv[f, c, 0]) * per
                    v = (la * corner_uv[f, 0, 1] + lb * corner_uv[f, b, 1] + lc * corner_uv[f, c, 1]) * per
                    tx = min(int((u - np.floor(u)) * tw), tw - 1)
                    ty = min(int((1.0 - (v - np.floor(v))) * th), th - 1)
                    if texels[texel + ty * tw + tx] >> 31:
                        words[r0 + y, c0 + x] = word
