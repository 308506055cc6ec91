"""What colour a pixel has: deferred shading of the faces that visibility found, compiled by numba.

Light is camera-fixed: a key, a weaker fill and an ambient term that is brighter from above (lights.py).
Intensities add in linear light; as sRGB is nearly a square root, the colour on the
display is the material's display colour times the square root of the intensity. Normals count on both
sides: they are turned to the side from which the face is seen.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.jit import kernel

# Mirrors of scene.py and visibility.py: a kernel may only freeze constants of its own file.
_TEXTURED, _SMOOTH, _MEAN_TEXEL = 1, 2, 4
_ID_MAX = (1 << 24) - 1

_int64: Any = np.int64  # a scalar of numpy is not an int to a type checker

Words = NDArray[np.int64]
Ints = NDArray[np.int32]
Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Bytes = NDArray[np.uint8]

_PAIR = 0x00FF00FF
_PER_TEXEL = 1.0 / (256 * 255)


@kernel
def _intensity(x: float, y: float, z: float, lights: Doubles, ambient: float) -> float:
    key = x * lights[0, 0] + y * lights[0, 1] + z * lights[0, 2]
    fill = x * lights[1, 0] + y * lights[1, 1] + z * lights[1, 2]
    up = x * lights[2, 0] + y * lights[2, 1] + z * lights[2, 2]
    return math.sqrt(ambient + up + max(key, 0.0) + max(fill, 0.0))


@kernel
def _to_camera(vertices: Floats, i: int, R: Doubles, t: Doubles) -> tuple[float, float, float]:
    x, y, z = np.float64(vertices[i, 0]), np.float64(vertices[i, 1]), np.float64(vertices[i, 2])
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0],
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1],
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2],
    )


@kernel
def find_visible(
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    words: Words,
    glass_words: Words,
    has_glass: bool,
    slot_of: Ints,
    visible: Ints,
) -> int:
    """Number the faces that are seen in the samples [x0, x1) x [y0, y1).

    Args:
        x0: First column.
        y0: First row.
        x1: Column after the last.
        y1: Row after the last.
        words: (rows, columns) of the opaque faces; each word is replaced by its face's number, -1 if empty.
        glass_words: The same of see-through faces, -1 where an opaque face is nearer.
        has_glass: Whether ``glass_words`` is to be read.
        slot_of: (F,) all -1, and so again on return.
        visible: (F,), written: the faces seen.

    Returns:
        How many faces are seen.
    """
    count = 0
    stride, opaque = words.shape[1], words.ravel()
    for layer in range(2 if has_glass else 1):
        see_through = layer == 0 and has_glass
        target = glass_words.ravel() if see_through else opaque
        last_face, last_slot = -1, -1
        for row in range(y0, y1):
            for col in range(x0, x1):
                at = np.uintp(row * stride + col)
                word = target[at]
                if word == 0 or (see_through and word <= opaque[at]):
                    target[at] = -1
                    continue
                f = (word & _ID_MAX) - 1
                if f != last_face:
                    last_face = f
                    last_slot = slot_of[np.uintp(f)]
                    if last_slot < 0:
                        last_slot = count
                        slot_of[f] = count
                        visible[count] = f
                        count += 1
                target[at] = last_slot
    for i in range(count):
        slot_of[visible[i]] = -1
    return count


@kernel
def prepare(
    visible: Ints,
    count: int,
    faces: Ints,
    vertices: Floats,
    R: Doubles,
    t: Doubles,
    focal: float,
    cx: float,
    cy: float,
    normals: Floats,
    uv: Floats,
    uv_area: Floats,
    look: Bytes,
    material: Ints,
    rgba: Floats,
    material_levels: Ints,
    levels: Ints,
    light: Doubles,
    planes: Doubles,
) -> None:
    """What the pixels of each visible face share.

    ``planes`` (count, 24), functions a*x + b*y + c of continuous pixels, all divided by z and so linear in
    the image: [0:3] sum of the corner weights, [3:6] light, [6] determinant (z = determinant / sum), [7:9]
    bounds of the sum, [9:11] bounds of the light, [11:15] colour and opacity, [15] mip level of
    the texture, -1 without, [16:19] u, [19:22] v. What every face needs lies in one cache line.
    ``light`` (10,) is Lights.packed.
    """
    lights = np.empty((3, 3))
    for j in range(3):
        # Into the object frame, where the normals are.
        lights[0, j] = light[3] * (light[0] * R[0, j] + light[1] * R[1, j] + light[2] * R[2, j])
        lights[1, j] = light[7] * (light[4] * R[0, j] + light[5] * R[1, j] + light[6] * R[2, j])
        lights[2, j] = -light[9] * R[1, j]
    for i in range(count):
        f = visible[i]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = _to_camera(vertices, a, R, t)
        bx, by, bz = _to_camera(vertices, b, R, t)
        qx, qy, qz = _to_camera(vertices, c, R, t)
        # Corner weights of the ray d through a pixel: d . (P_j x P_k).
        nax, nay, naz = by * qz - bz * qy, bz * qx - bx * qz, bx * qy - by * qx
        nbx, nby, nbz = qy * az - qz * ay, qz * ax - qx * az, qx * ay - qy * ax
        ncx, ncy, ncz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * nax + ay * nay + az * naz
        # det < 0 where the winding faces the camera; weights are made positive inside either way.
        side = 1.0 if det < 0.0 else -1.0
        det = abs(det)
        k = -side / focal
        wax, way, wac = nax * k, nay * k, -side * naz - (nax * cx + nay * cy) * k
        wbx, wby, wbc = nbx * k, nby * k, -side * nbz - (nbx * cx + nby * cy) * k
        wcx, wcy, wcc = ncx * k, ncy * k, -side * ncz - (ncx * cx + ncy * cy) * k
        planes[i, 0], planes[i, 1], planes[i, 2] = wax + wbx + wcx, way + wby + wcy, wac + wbc + wcc
        planes[i, 6] = det
        planes[i, 7] = det / max(az, max(bz, qz))
        planes[i, 8] = det / max(min(az, min(bz, qz)), 1e-3)
        bits = look[f]
        x, y, z = side * normals[f, 0, 0], side * normals[f, 0, 1], side * normals[f, 0, 2]
        ga = _intensity(x, y, z, lights, light[8])
        gb, gc = ga, ga
        if bits & _SMOOTH:
            x, y, z = side * normals[f, 1, 0], side * normals[f, 1, 1], side * normals[f, 1, 2]
            gb = _intensity(x, y, z, lights, light[8])
            x, y, z = side * normals[f, 2, 0], side * normals[f, 2, 1], side * normals[f, 2, 2]
            gc = _intensity(x, y, z, lights, light[8])
        planes[i, 3] = ga * wax + gb * wbx + gc * wcx
        planes[i, 4] = ga * way + gb * wby + gc * wcy
        planes[i, 5] = ga * wac + gb * wbc + gc * wcc
        planes[i, 9] = min(ga, min(gb, gc))
        planes[i, 10] = max(ga, max(gb, gc))
        m = material[f]
        for j in range(4):
            planes[i, 11 + j] = rgba[m, j]
        planes[i, 15] = -1.0
        if bits & _TEXTURED:
            level = material_levels[m, 0]
            last = level + material_levels[m, 1] - 1
            if bits & _MEAN_TEXEL:
                level = last
            else:
                # Texels a pixel, from the areas: the projected triangle's is f² det / (2 z z z).
                ratio = uv_area[f] * levels[level, 1] * levels[level, 2] * 2.0 * az * bz * qz
                ratio /= focal * focal * max(det, 1e-30)
                while ratio > 2.0 and level < last:
                    ratio *= 0.25
                    level += 1
            planes[i, 15] = level
            for j in range(2):
                u, v, w = uv[f, 0, j], uv[f, 1, j], uv[f, 2, j]
                planes[i, 16 + 3 * j] = u * wax + v * wbx + w * wcx
                planes[i, 17 + 3 * j] = u * way + v * wby + w * wcy
                planes[i, 18 + 3 * j] = u * wac + v * wbc + w * wcc


@kernel
def shade(
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    ss: int,
    slots: Words,
    glass_slots: Words,
    has_glass: bool,
    planes: Doubles,
    levels: Ints,
    texels: NDArray[np.uint32],
    rgb_out: Bytes,
    alpha_out: Bytes,
    depth_out: Floats,
) -> None:
    """Colour, coverage and depth of the pixels [x0, x1) x [y0, y1) of one view.

    A pixel whose samples all see one face is shaded once, at its centre; any other at each sample. Glass is
    mixed over the opaque face behind it; where there is none, it shows its own colour, as the mask counts
    it as covered.
    """
    n = ss * ss
    per_ss = 1.0 / ss
    per_pixel = 1.0 / n
    stride = slots.shape[1]
    flat, glass_flat = slots.ravel(), glass_slots.ravel()
    offset = np.empty(n, np.int64)
    for i in range(n):
        offset[i] = i // ss * stride + i % ss
    for row in range(y0, y1):
        for col in range(x0, x1):
            corner = row * ss * stride + col * ss
            first = flat[corner]
            evaluations = 1
            for i in range(1, n):
                if flat[corner + offset[i]] != first:
                    evaluations = n
            glass = False
            if has_glass:
                for i in range(n):
                    glass |= glass_flat[corner + offset[i]] >= 0
                if glass:
                    evaluations = n
            if first < 0 and evaluations == 1 and not glass:
                continue
            red, green, blue, depth = 0.0, 0.0, 0.0, 0.0
            covered, depth_slot, depth_count = 0, np.int64(-1), 0
            x, y = col + 0.5, row + 0.5
            if evaluations > 1:
                x, y = col - 0.5 * per_ss, row + 0.5 * per_ss
            in_row = 0
            for i in range(evaluations):
                if evaluations > 1:
                    x += per_ss
                    in_row += 1
                    if in_row > ss:
                        in_row = 1
                        x = col + 0.5 * per_ss
                        y += per_ss
                at = corner + offset[i]
                under = flat[at]
                top = glass_flat[at] if glass else np.int64(-1)
                front = top if top >= 0 else under
                if front < 0:
                    continue
                covered += 1
                if evaluations > 1 and front != depth_slot:
                    same = 1
                    for j in range(i + 1, evaluations):
                        other = flat[corner + offset[j]]
                        if glass and glass_flat[corner + offset[j]] >= 0:
                            other = glass_flat[corner + offset[j]]
                        same += other == front
                    if same > depth_count:
                        depth_slot, depth_count = front, same
                left = 1.0
                for layer in range(0 if top >= 0 else 1, 2):
                    slot = top if layer == 0 else under
                    if slot < 0:
                        continue
                    s = np.uintp(slot)  # unsigned: saves numba's test for indices from the end
                    per = planes[s, 0] * x + planes[s, 1] * y + planes[s, 2]
                    per = 1.0 / min(max(per, planes[s, 7]), planes[s, 8])
                    if slot == front:
                        depth = planes[s, 6] * per
                    gain = (planes[s, 3] * x + planes[s, 4] * y + planes[s, 5]) * per
                    gain = min(max(gain, planes[s, 9]), planes[s, 10])
                    pr, pg, pb, pa = planes[s, 11], planes[s, 12], planes[s, 13], planes[s, 14]
                    level = int(planes[s, 15])
                    if level >= 0:
                        start, tw, th = levels[level, 0], levels[level, 1], levels[level, 2]
                        u = (planes[s, 16] * x + planes[s, 17] * y + planes[s, 18]) * per
                        v = (planes[s, 19] * x + planes[s, 20] * y + planes[s, 21]) * per
                        # Bilinear, repeating; the first row of texels is the top, v = 1.
                        tx = (u - np.floor(u)) * tw - 0.5
                        ty = (1.0 - (v - np.floor(v))) * th - 0.5
                        xi, yi = int(np.floor(tx)), int(np.floor(ty))
                        fx, fy = tx - xi, ty - yi
                        xj, yj = xi + 1, yi + 1
                        xi = xi + tw if xi < 0 else xi
                        yi = yi + th if yi < 0 else yi
                        xj = xj - tw if xj >= tw else xj
                        yj = yj - th if yj >= th else yj
                        t00 = _int64(texels[np.uintp(start + yi * tw + xi)])
                        t01 = _int64(texels[np.uintp(start + yi * tw + xj)])
                        t10 = _int64(texels[np.uintp(start + yj * tw + xi)])
                        t11 = _int64(texels[np.uintp(start + yj * tw + xj)])
                        # Weights in 1/256, two channels of a texel at once: red and blue, green and alpha.
                        ix, iy = int(fx * 16.0), int(fy * 16.0)
                        w11 = ix * iy
                        w01, w10 = ix * 16 - w11, iy * 16 - w11
                        w00 = 256 - w01 - w10 - w11
                        rb = w00 * (t00 & _PAIR) + w01 * (t01 & _PAIR)
                        rb += w10 * (t10 & _PAIR) + w11 * (t11 & _PAIR)
                        t00, t01, t10, t11 = t00 >> 8, t01 >> 8, t10 >> 8, t11 >> 8
                        ga = w00 * (t00 & _PAIR) + w01 * (t01 & _PAIR)
                        ga += w10 * (t10 & _PAIR) + w11 * (t11 & _PAIR)
                        pr *= (rb & 0xFFFF) * _PER_TEXEL
                        pg *= (ga & 0xFFFF) * _PER_TEXEL
                        pb *= (rb >> 16) * _PER_TEXEL
                        pa *= (ga >> 16) * _PER_TEXEL
                    own = pa if layer == 0 and under >= 0 else left
                    left = 1.0 - own
                    red += own * min(pr * gain, 255.0)
                    green += own * min(pg * gain, 255.0)
                    blue += own * min(pb * gain, 255.0)
            if covered == 0:
                continue
            if evaluations > 1:
                s = np.uintp(depth_slot)
                total = planes[s, 0] * (col + 0.5) + planes[s, 1] * (row + 0.5) + planes[s, 2]
                depth_out[row, col] = planes[s, 6] / min(max(total, planes[s, 7]), planes[s, 8])
                per = 1.0 / covered
                red, green, blue = red * per, green * per, blue * per
                alpha_out[row, col] = np.uint8(255.0 * covered * per_pixel + 0.5)
            else:
                depth_out[row, col] = depth
                alpha_out[row, col] = 255
            rgb_out[row, col, 0] = np.uint8(red + 0.5)
            rgb_out[row, col, 1] = np.uint8(green + 0.5)
            rgb_out[row, col, 2] = np.uint8(blue + 0.5)
