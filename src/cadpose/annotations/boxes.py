"""A photo with the objects that a detector found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cadpose.annotations.marks import extent, label, outline, rectangle
from cadpose.annotations.overlay import overlay_size
from cadpose.annotations.style import Colour, category_text, colour_of, flags_of, resized, short
from cadpose.records import Detection, Photo

#: How much of a mask's colour lies over the photo.
_TINT = 0.38


def draw_detections(photo: Photo, detections: Sequence[Detection]) -> Image.Image:
    """Masks filled and outlined, boxes, and labels with number, category, score and flags.

    Args:
        photo: The photo.
        detections: What was found, numbered from 1 as in the output. A mask has the photo's size.

    Returns:
        RGB picture of ``overlay_size``.
    """
    width, height = overlay_size(photo.width, photo.height)
    scale = width / photo.width
    unit = max(width, height) / 1000.0
    canvas = resized(photo.rgb, width, height).copy()
    # Large objects first, so that small ones in front of them stay visible.
    order = sorted(range(len(detections)), key=lambda i: -detections[i].box.area)
    covers = {i: _cover(detections[i], width, height) for i in order}
    for i, cover in covers.items():
        if cover is not None:
            _tint(canvas, cover, colour_of(i))
    for i, cover in covers.items():
        if cover is not None:
            outline(canvas, cover, colour_of(i), 1.6 * unit)
        rectangle(canvas, np.array(detections[i].box.to_tuple()) * scale, colour_of(i), unit)
    image = Image.fromarray(canvas)
    draw = ImageDraw.Draw(image)
    taken: list[tuple[float, float, float, float]] = []
    for i in reversed(order):
        corner = detections[i].box.x0 * scale, detections[i].box.y0 * scale
        words = label_words(i, detections[i])
        taken.append(label(draw, words, corner, colour_of(i), unit, image.size, taken))
    return image


def label_words(number: int, detection: Detection) -> str:
    """What an object's label says: ``1 chair 0.83``, ``2 unsure: chair / sofa / bed 0.31 · truncated``."""
    others = (name for name, _ in detection.alternatives)
    name = short(category_text(detection.category, others, detection.unsure), 60)
    flags = [flag for flag in flags_of(detection) if flag != "unsure"]
    return " · ".join([f"{number + 1} {name} {detection.score:.2f}", *flags])


def _cover(detection: Detection, width: int, height: int) -> NDArray[np.uint8] | None:
    """(height, width) 255 on the object; None without a mask."""
    if detection.mask is None:
        return None
    return resized(np.where(detection.mask, np.uint8(255), np.uint8(0)), width, height)


def _tint(canvas: NDArray[np.uint8], cover: NDArray[np.uint8], colour: Colour) -> None:
    rows, cols = extent(cover, canvas.shape[:2], 0)
    a = cover[rows, cols, None].astype(np.float32) * (_TINT / 255.0)
    mixed = canvas[rows, cols] * (1.0 - a) + a * np.array(colour, np.float32)
    canvas[rows, cols] = np.clip(mixed + 0.5, 0, 255).astype(np.uint8)
