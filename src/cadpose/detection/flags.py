"""What makes a detection doubtful, told by its box: cut by the photo's edge, or too small."""

from __future__ import annotations

from dataclasses import replace

from cadpose.records import Detection

#: A side of the box this near to the photo's edge touches it, in shares of the photo's longer side.
EDGE = 0.01
#: And in pixels, where that is more.
EDGE_PIXELS = 1.0
#: A box of fewer pixels is tiny: COCO's limit of a small object, below which detectors and poses fail.
FEWEST_PIXELS = 32 * 32


def flagged(detection: Detection, width: int, height: int) -> Detection:
    """The detection with ``truncated`` and ``tiny`` as its box in a photo of that size has them.

    Truncated: a side of the box lies within 1 % of the photo's longer side, or a pixel, of the photo's
    edge, or beyond it. Tiny: the box has less than 32 x 32 = 1024 pixels inside the photo.
    """
    x0, y0, x1, y1 = detection.box.to_tuple()
    near = max(EDGE * max(width, height), EDGE_PIXELS)
    inside = detection.box.clipped(width, height)
    truncated = min(x0, y0, width - x1, height - y1) <= near
    tiny = inside is None or inside.area < FEWEST_PIXELS
    if (truncated, tiny) == (detection.truncated, detection.tiny):
        return detection
    return replace(detection, truncated=truncated, tiny=tiny)
