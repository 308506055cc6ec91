"""The whole box as the object's mask: what a box says of the pixels in it, which is nothing."""

from __future__ import annotations

import numpy as np

from cadpose.detection.masks import part_in_photo
from cadpose.geometry.boxes import Box
from cadpose.records import Mask, Photo


class BoxMasks:
    """Takes every pixel of the box for the object; the row to compare other masks with."""

    name = "none"

    def mask(self, photo: Photo, box: Box) -> Mask:
        """(H, W) bool, True where a pixel's centre lies in the box, and at one pixel at least.

        Raises:
            ValueError: the box lies outside the photo.
        """
        inner = part_in_photo(photo, box)
        out = np.zeros((photo.height, photo.width), np.bool_)
        x0, y0, x1, y1 = (int(v) for v in np.ceil(np.array(inner.to_tuple()) - 0.5))
        out[y0:y1, x0:x1] = True
        if not out.any():  # thinner than a pixel
            cx, cy = inner.centre
            out[int(cy), int(cx)] = True
        return out
