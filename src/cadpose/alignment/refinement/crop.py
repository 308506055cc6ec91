"""What refinement compares: a square of the photo about the object, and cameras that see it alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import SIDE
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.photos import crop_square
from cadpose.records import Mask

#: The square's side over the box's longer side.
CONTEXT = 1.15
#: Grey level beyond the photo and behind the model.
BACKGROUND = 128


@dataclass(frozen=True, eq=False)
class ObjectCrop:
    """A square of a photo about an object.

    Attributes:
        rgb: (224, 224, 3) uint8.
        mask: (224, 224) float32 share of each pixel that the object covers, None where it has no mask.
        inside: (224, 224) bool, True where the pixel lies in the photo: beyond nothing is known.
        square: The square in pixels of the photo; it may reach beyond.
    """

    rgb: NDArray[np.uint8]
    mask: NDArray[np.float32] | None
    inside: Mask
    square: Box

    @classmethod
    def of(cls, rgb: NDArray[np.uint8], box: Box, mask: Mask | None = None) -> ObjectCrop:
        """About a box in a (H, W, 3) photo with the object's (H, W) mask.

        Raises:
            ValueError: the box lies outside the photo, or the mask is not of its size.
        """
        if mask is not None and mask.shape != rgb.shape[:2]:
            raise ValueError(f"a mask of {mask.shape} does not fit a photo of {rgb.shape[:2]}")
        (cx, cy), half = box.centre, CONTEXT * max(box.width, box.height) / 2
        square = Box(cx - half, cy - half, cx + half, cy + half)
        covered = None
        if mask is not None:
            grey = np.repeat((mask * np.uint8(255))[..., None], 3, axis=2)
            covered = crop_square(grey, square, SIDE, fill=0)[..., 0].astype(np.float32) / np.float32(255.0)
        where = (np.arange(SIDE) + 0.5) * (square.width / SIDE)
        columns, rows = square.x0 + where, square.y0 + where
        inside = ((rows > 0) & (rows < rgb.shape[0]))[:, None] & (columns > 0) & (columns < rgb.shape[1])
        return cls(crop_square(rgb, square, SIDE, fill=BACKGROUND), covered, inside, square)

    @property
    def scale(self) -> float:
        """Pixels of the crop a pixel of the photo."""
        return SIDE / self.square.width

    def cameras(self, cameras: Cameras) -> Cameras:
        """Cameras of the photo's pixels as cameras of the crop's."""
        corner = np.array([self.square.x0, self.square.y0])
        return replace(
            cameras,
            focal_px=cameras.focal_px * self.scale,
            principal_px=(cameras.principal_px - corner) * self.scale,
            width=SIDE,
            height=SIDE,
        )
