"""What colour a pixel has: deferred shading of the faces that visibility found, compiled by numba.

Light is camera-fixed: a key from the upper left, a weaker fill from the right and an ambient term that is
brighter from above. Intensities add in linear light; as sRGB is nearly a square root, the colour on the
display is the material's display colour times the square root of the intensity. Normals count on both
sides: they are turned to the side from which the face is seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.rendering.jit import kernel

# Mirrors of scene.py and visibility.py: a kernel may only freeze constants of its own file.
_TEXTURED, _SMOOTH, _MEAN_TEXEL = 1, 2, 4
_ID_MAX = (1 << 24) - 1

Words = NDArray[np.int64]
Ints = NDArray[np.int32]
Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Bytes = NDArray[np.uint8]

# Directions towards the lights in the camera frame (x right, y down, z forward), and their strength.
_KEY = (-0.48, -0.62, -0.62, 0.72)
_FILL = (0.80, -0.15, -0.58, 0.22)
_AMBIENT = 0.26
_SKY = 0.10  # share of the ambient term that depends on how far the normal points up


@kernel
def _intensity(x: float, y: float, z: float, lights: Doubles) -> float:
    key = x * lights[0, 0] + y * lights[0, 1] + z * lights[0, 2]
    fill = x * lights[1, 0] + y * lights[1, 1] + z * lights[1, 2]
    up = x * lights[2, 0] + y * lights[2, 1] + z * lights[2, 2]
    return np.sqrt(_AMBIENT + up + max(key, 0.0) + max(fill, 0.0))


@kernel
def _prepare(
    f: int,
    faces: Ints,
    cam: Doubles,
    focal: float,
    cx: float,
    cy: float,
    normals: Floats,
    uv: Floats,
    uv_area: Floats,
    look: Bytes,
    material: Ints,
    material_levels: Ints,
    levels: Ints,
    lights: Doubles,
    plane: Doubles,
    state: Ints,
) -> None:
    """Everything about a face that its pixels share, into ``plane`` and ``state``.

    ``plane``: [0:9] the three corner weights as a*x + b*y + c of pixel coordinates, perspective included,
    [9:12] their sum, [12] the determinant (z = determinant / sum), [13:15] bounds of the sum, [15] flat
    intensity, [16:25] corner normals, [25:31] corner uv. ``state``: look bits, material, mip level.
    """
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay, az = cam[a, 0], cam[a, 1], cam[a, 2]
    bx, by, bz = cam[b, 0], cam[b, 1], cam[b, 2]
    qx, qy, qz = cam[c, 0], cam[c, 1], cam[c, 2]
    nax, nay, naz = by * qz - bz * qy, bz * qx - bx * qz, bx * qy - by * qx
    nbx, nby, nbz = qy * az - qz * ay, qz * ax - qx * az, qx * ay - qy * ax
    ncx, ncy, ncz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    det = ax * nax + ay * nay + az * naz
    # det < 0 where the winding faces the camera; weights are made positive inside either way.
    side = 1.0 if det < 0.0 else -1.0
    s = -side
    k = s / focal
    plane[0], plane[1], plane[2] = nax * k, nay * k, naz * s - (nax * cx + nay * cy) * k
    plane[3], plane[4], plane[5] = nbx * k, nby * k, nbz * s - (nbx * cx + nby * cy) * k
    plane[6], plane[7], plane[8] = ncx * k, ncy * k, ncz * s - (ncx * cx + ncy * cy) * k
    plane[9] = plane[0] + plane[3] + plane[6]
    plane[10] = plane[1] + plane[4] + plane[7]
    plane[11] = plane[2] + plane[5] + plane[8]
    det = abs(det)
    z_lo, z_hi = min(az, min(bz, qz)), max(az, max(bz, qz))
    plane[12] = det
    plane[13] = det / z_hi
    plane[14] = det / max(z_lo, 1e-3)
    bits = look[f]
    state[0] = bits
    m = material[f]
    state[1] = m
    if bits & _SMOOTH:
        for i in range(3):
            for j in range(3):
                plane[16 + 3 * i + j] = side * normals[f, i, j]
    else:
        plane[15] = _intensity(
            side * normals[f, 0, 0], side * normals[f, 0, 1], side * normals[f, 0, 2], lights
        )
    if bits & _TEXTURED:
        level = material_levels[m, 0]
        last = level + material_levels[m, 1] - 1
        if bits & _MEAN_TEXEL:
            level = last
        else:
            for i in range(3):
                plane[25 + 2 * i] = uv[f, i, 0]
                plane[26 + 2 * i] = uv[f, i, 1]
            # Texels a pixel, from the areas: the projected triangle's is f² det / (2 z z z).
            ratio = uv_area[f] * levels[level, 1] * levels[level, 2] * 2.0 * az * bz * qz
            ratio /= focal * focal * max(det, 1e-30)
            while ratio > 2.0 and level < last:
                ratio *= 0.25
                level += 1
        state[2] = level


@kernel
def _shade(
    x: float,
    y: float,
    plane: Doubles,
    state: Ints,
    rgba: Floats,
    levels: Ints,
    texels: Bytes,
    lights: Doubles,
) -> tuple[float, float, float, float]:
    """Display colour (0 to 255, not yet clipped) and opacity of the prepared face at a point of the image."""
    bits = state[0]
    m = state[1]
    r, g, b, alpha = rgba[m, 0], rgba[m, 1], rgba[m, 2], rgba[m, 3]
    gain = plane[15]
    if bits & (_SMOOTH | _TEXTURED):
        la = max(plane[0] * x + plane[1] * y + plane[2], 0.0)
        lb = max(plane[3] * x + plane[4] * y + plane[5], 0.0)
        lc = max(plane[6] * x + plane[7] * y + plane[8], 0.0)
        if bits & _SMOOTH:
            nx = la * plane[16] + lb * plane[19] + lc * plane[22]
            ny = la * plane[17] + lb * plane[20] + lc * plane[23]
            nz = la * plane[18] + lb * plane[21] + lc * plane[24]
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            scale = 1.0 / length if length > 0.0 else 0.0
            gain = _intensity(nx * scale, ny * scale, nz * scale, lights)
        if bits & _TEXTURED:
            level = state[2]
            start, tw, th = levels[level, 0], levels[level, 1], levels[level, 2]
            u, v = 0.0, 0.0
            total = la + lb + lc
            if not bits & _MEAN_TEXEL and total > 0.0:
                per = 1.0 / total
                u = (la * plane[25] + lb * plane[27] + lc * plane[29]) * per
                v = (la * plane[26] + lb * plane[28] + lc * plane[30]) * per
            # Bilinear, repeating; the first row of texels is the top, v = 1.
            tx = (u - np.floor(u)) * tw - 0.5
            ty = (1.0 - (v - np.floor(v))) * th - 0.5
            x0, y0 = int(np.floor(tx)), int(np.floor(ty))
            fx, fy = tx - x0, ty - y0
            x1, y1 = x0 + 1, y0 + 1
            x0 = x0 + tw if x0 < 0 else x0
            y0 = y0 + th if y0 < 0 else y0
            x1 = x1 - tw if x1 >= tw else x1
            y1 = y1 - th if y1 >= th else y1
            i00, i01 = start + y0 * tw + x0, start + y0 * tw + x1
            i10, i11 = start + y1 * tw + x0, start + y1 * tw + x1
            w11 = fx * fy
            w01 = fx - w11
            w10 = fy - w11
            w00 = 1.0 - fx - w10
            per = 1.0 / 255.0
            r *= per * (
                w00 * texels[i00, 0] + w01 * texels[i01, 0] + w10 * texels[i10, 0] + w11 * texels[i11, 0]
            )
            g *= per * (
                w00 * texels[i00, 1] + w01 * texels[i01, 1] + w10 * texels[i10, 1] + w11 * texels[i11, 1]
            )
            b *= per * (
                w00 * texels[i00, 2] + w01 * texels[i01, 2] + w10 * texels[i10, 2] + w11 * texels[i11, 2]
            )
            if alpha < 1.0 or texels[i00, 3] < 255:
                alpha *= texels[i00, 3] * per
    return min(r * gain, 255.0), min(g * gain, 255.0), min(b * gain, 255.0), alpha


@kernel
def shade(
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    ss: int,
    words: Words,
    glass_words: Words,
    has_glass: bool,
    faces: Ints,
    cam: Doubles,
    R: Doubles,
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
    texels: Bytes,
    rgb_out: Bytes,
    alpha_out: Bytes,
    depth_out: Floats,
) -> None:
    """Colour, coverage and depth of the pixels [x0, x1) x [y0, y1) of one view.

    A face that holds several samples of a pixel is shaded once, at their centroid (as in multisample
    anti-aliasing). Glass is mixed over the opaque face behind it, sample by sample; where there is none
    behind, it shows its own colour: the mask counts it as covered.
    """
    lights = np.empty((3, 3))
    for j in range(3):
        # Into the object frame, where the normals are.
        lights[0, j] = _KEY[3] * (_KEY[0] * R[0, j] + _KEY[1] * R[1, j] + _KEY[2] * R[2, j])
        lights[1, j] = _FILL[3] * (_FILL[0] * R[0, j] + _FILL[1] * R[1, j] + _FILL[2] * R[2, j])
        lights[2, j] = -_SKY * R[1, j]
    plane = np.zeros(32)
    state = np.zeros(4, np.int32)
    n = ss * ss
    top = np.empty(n, np.int32)
    under = np.empty(n, np.int32)
    weight = np.empty(n)
    prepared = -1
    for row in range(y0, y1):
        for col in range(x0, x1):
            covered = 0
            any_glass = False
            same = True
            for i in range(n):
                r, c = row * ss + i // ss, col * ss + i % ss
                word = words[r, c]
                under[i] = _ID_MAX - (word & _ID_MAX) if word > 0 else -1
                top[i] = -1
                if has_glass and glass_words[r, c] > word:
                    top[i] = _ID_MAX - (glass_words[r, c] & _ID_MAX)
                    any_glass = True
                covered += under[i] >= 0 or top[i] >= 0
                same &= under[i] == under[0]
                weight[i] = 1.0
            if covered == 0:
                continue
            red, green, blue = 0.0, 0.0, 0.0
            depth_face, depth_samples = -1, 0
            for layer in range(0 if any_glass else 1, 2):
                ids = top if layer == 0 else under
                for i in range(n):
                    f = ids[i]
                    if f < 0:
                        continue
                    share, sx, sy, samples = 0.0, 0.0, 0.0, 0
                    for j in range(i, n):
                        if ids[j] == f:
                            share += weight[j]
                            sx += j % ss
                            sy += j // ss
                            samples += 1
                    if f != prepared:
                        _prepare(
                            f, faces, cam, focal, cx, cy, normals, uv, uv_area, look, material,
                            material_levels, levels, lights, plane, state,
                        )  # fmt: skip
                        prepared = f
                    x = col + (sx / samples + 0.5) / ss
                    y = row + (sy / samples + 0.5) / ss
                    pr, pg, pb, pa = _shade(x, y, plane, state, rgba, levels, texels, lights)
                    for j in range(n - 1, i - 1, -1):
                        if ids[j] == f:
                            ids[j] = -1
                            if layer == 0:
                                own = 1.0 if under[j] < 0 else pa
                                weight[j] = 1.0 - own
                                red += own * pr
                                green += own * pg
                                blue += own * pb
                    if layer == 1:
                        red += share * pr
                        green += share * pg
                        blue += share * pb
                    if samples > depth_samples and (layer == 0 or depth_face < 0 or not any_glass):
                        depth_samples = samples
                        depth_face = f
                        total = plane[9] * (col + 0.5) + plane[10] * (row + 0.5) + plane[11]
                        total = min(max(total, plane[13]), plane[14])
                        depth_out[row, col] = plane[12] / total
                    if layer == 1 and same and not any_glass:
                        break
            per = 1.0 / covered
            rgb_out[row, col, 0] = np.uint8(min(red * per + 0.5, 255.0))
            rgb_out[row, col, 1] = np.uint8(min(green * per + 0.5, 255.0))
            rgb_out[row, col, 2] = np.uint8(min(blue * per + 0.5, 255.0))
            alpha_out[row, col] = (covered * 255 + n // 2) // n
