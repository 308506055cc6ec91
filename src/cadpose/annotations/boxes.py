"""A photo with the boxes that a detector found."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw

from cadpose.annotations.overlay import overlay_size
from cadpose.annotations.style import colour_of, font, resized, short
from cadpose.records import Detection, Photo


def draw_detections(photo: Photo, detections: Sequence[Detection]) -> Image.Image:
    """Boxes with category and score, numbered as in the output; RGB picture of ``overlay_size``."""
    width, height = overlay_size(photo.width, photo.height)
    scale = width / photo.width
    image = Image.fromarray(resized(photo.rgb, width, height))
    draw = ImageDraw.Draw(image)
    line, text = max(2, max(width, height) // 400), font(max(13, max(width, height) // 55))
    for number, detection in enumerate(detections):
        x0, y0, x1, y1 = (value * scale for value in detection.box.to_tuple())
        colour = colour_of(number)
        draw.rectangle((x0, y0, x1 - 1, y1 - 1), outline=colour, width=line)
        label = f" {number + 1} {short(detection.category, 36)} {detection.score:.2f} "
        left, top, right, bottom = draw.textbbox((0, 0), label, font=text)
        tall = bottom - top + 6
        x = max(0.0, min(x0, width - (right - left)))
        y = y0 - tall if y0 >= tall else max(0.0, y0)
        draw.rectangle((x, y, x + right - left, y + tall), fill=colour)
        draw.text((x, y + 3 - top), label, fill=(255, 255, 255), font=text)
    return image
