"""How the box-to-mask network sees an object: a square picture of the box and what is around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.photos import crop_square

#: Side of the picture in pixels.
SIDE = 192
#: The picture's side over the box's longer side.
CONTEXT = 1.35
#: What lies beyond the photo is shown in this grey.
FILL = 127


@dataclass(frozen=True, eq=False)
class MaskCrop:
    """A square of a photo.

    Attributes:
        rgb: (SIDE, SIDE, 3) uint8.
        box: (4,) x0, y0, x1, y1 of the box in its pixels.
        square: The square in pixels of the photo; it may reach beyond.
    """

    rgb: NDArray[np.uint8]
    box: FloatArray
    square: Box

    @classmethod
    def of(cls, rgb: NDArray[np.uint8], box: Box) -> MaskCrop:
        """The picture of a box in a (H, W, 3) photo."""
        (cx, cy), half = box.centre, CONTEXT * max(box.width, box.height) / 2
        square = Box(cx - half, cy - half, cx + half, cy + half)
        scale = SIDE / square.width
        origin = np.array([square.x0, square.y0] * 2)
        return cls(
            crop_square(rgb, square, SIDE, fill=FILL), (np.array(box.to_tuple()) - origin) * scale, square
        )
