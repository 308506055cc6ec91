"""Lines and words on pictures: outlines, boxes, and labels that keep off one another."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import ImageDraw

from cadpose.annotations.style import Colour, font
from cadpose.geometry.frames import FloatArray

#: Fractional bits of OpenCV's coordinates.
SHIFT = 4


def outline(canvas: NDArray[np.uint8], alpha: NDArray[np.uint8], colour: Colour, unit: float) -> None:
    """A line of even width along the silhouette, from a smoothed signed distance to it."""
    half = max(0.9 * unit, 0.9)
    rows, cols = extent(alpha, canvas.shape[:2], round(6 * unit) + 4)
    inside = (alpha[rows, cols] >= 128).astype(np.uint8)
    if not inside.any():
        return
    # A border keeps an object that fills the picture finite.
    inside = np.pad(inside, 1)
    distance = cv2.distanceTransform(inside, cv2.DIST_L2, 5) - cv2.distanceTransform(
        1 - inside, cv2.DIST_L2, 5
    )
    distance = np.abs(cv2.GaussianBlur(distance, (0, 0), 0.9))[1:-1, 1:-1, None]
    region = canvas[rows, cols].astype(np.float32)
    for width, tone, strength in ((half + 1.1 * unit, (0, 0, 0), 0.45), (half, colour, 1.0)):
        cover = np.clip(width + 0.5 - distance, 0.0, 1.0) * strength
        region += cover * (np.array(tone, np.float32) - region)
    canvas[rows, cols] = np.clip(region + 0.5, 0, 255).astype(np.uint8)


def extent(alpha: NDArray[np.uint8], size: tuple[int, ...], border: int) -> tuple[slice, slice]:
    """Rows and columns of what is not 0, ``border`` pixels more on each side, inside (height, width)."""
    rows, cols = np.flatnonzero(alpha.any(axis=1)), np.flatnonzero(alpha.any(axis=0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return (
        slice(max(0, int(rows[0]) - border), min(size[0], int(rows[-1]) + 1 + border)),
        slice(max(0, int(cols[0]) - border), min(size[1], int(cols[-1]) + 1 + border)),
    )


def line(canvas: NDArray[np.uint8], points: FloatArray, colour: Colour, thickness: int) -> None:
    """A line through (N, 2) points in continuous pixels."""
    # OpenCV's integer coordinates mean pixel centres; ours are continuous.
    fixed = np.round((np.clip(points, -1e4, 1e4) - 0.5) * 2**SHIFT).astype(np.int32)
    cv2.polylines(canvas, [fixed.reshape(-1, 1, 2)], False, colour, thickness, cv2.LINE_AA, SHIFT)


def rectangle(canvas: NDArray[np.uint8], box: FloatArray, colour: Colour, unit: float) -> None:
    """A thin rectangle with stronger corners, moved inside where it lies on the picture's border."""
    inset = 1.5 * unit
    limit = np.array([canvas.shape[1], canvas.shape[0]]) - inset
    low, high = np.maximum(box[:2], inset), np.minimum(box[2:], limit)
    (x0, y0), (x1, y1) = low, high
    thin = max(1, round(unit))
    line(canvas, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]), colour, thin)
    arm = min(22 * unit, 0.25 * min(x1 - x0, y1 - y0))
    for x, dx in ((x0, arm), (x1, -arm)):
        for y, dy in ((y0, arm), (y1, -arm)):
            corner = np.array([[x + dx, y], [x, y], [x, y + dy]])
            line(canvas, corner, colour, max(2, round(3 * unit)))


def label(
    draw: ImageDraw.ImageDraw,
    text: str,
    corner: tuple[float, float],
    colour: Colour,
    unit: float,
    size: tuple[int, int],
    taken: Sequence[tuple[float, float, float, float]],
) -> tuple[float, float, float, float]:
    """Write the label above ``corner``, inside the picture and off other labels; its rectangle."""
    pad, face = 4.5 * unit, font(max(14, round(13.5 * unit)))
    while draw.textlength(text, font=face) + 2 * pad > size[0] and face.size > 9:
        face = font(round(face.size) - 1)
    wide = draw.textlength(text, font=face) + 2 * pad
    ascent, descent = face.getmetrics()
    high = ascent + descent + pad
    x = min(max(corner[0], 0.0), max(0.0, size[0] - wide))
    wanted = corner[1] - high - 2 * unit
    free = sorted(
        (
            y
            for y in _rows(wanted, high, size[1])
            if not any(_meet((x, y, x + wide, y + high), t) for t in taken)
        ),
        key=lambda y: abs(y - wanted),
    )
    y = free[0] if free else min(max(wanted, 0.0), size[1] - high)
    draw.rounded_rectangle((x, y, x + wide, y + high), radius=4 * unit, fill=colour)
    dark = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 120
    ink = (0, 0, 0) if dark else (255, 255, 255)
    draw.text((x + pad, y + high / 2), text, fill=ink, font=face, anchor="lm")
    return x, y, x + wide, y + high


def _rows(wanted: float, high: float, limit: int) -> list[float]:
    last = max(0.0, limit - high)
    steps = range(int(last / high) + 1)
    return [min(max(wanted, 0.0), last), *(min(step * (high + 1), last) for step in steps)]


def _meet(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
