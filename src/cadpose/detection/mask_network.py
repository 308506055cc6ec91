"""From the box to the object's mask by the trained network: thin legs, holes, things before the object.

Trained on synthetic photos with a decoder on Lite0's maps: docs/model-card.md.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.detection.mask_crop import SIDE, MaskCrop
from cadpose.detection.masks import part_in_photo, tidied
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.onnx_session import open_session
from cadpose.records import Mask, Photo
from cadpose.weights import ensure

#: Parts below this share of the largest and holes below that of the mask are noise.
SPECK, PINHOLE = 0.02, 0.004
#: The mask may reach this share of the box's longer side beyond the box, which is seldom exact.
BEYOND = 0.08


class NetworkMasks:
    """Masks by the network.

    Args:
        device: ``"cpu"`` or ``"cuda"``.
        network: ONNX file in the place of the shipped one.
        threads: ONNX Runtime threads; 0 lets it choose.
    """

    name = "network"

    def __init__(self, device: str = "cpu", network: Path | None = None, threads: int = 0) -> None:
        self.device, self.network, self.threads = device, network, threads

    @cached_property
    def _session(self) -> Any:
        return open_session(self.network or ensure("masks"), self.device, self.threads)

    def mask(self, photo: Photo, box: Box) -> Mask:
        """(H, W) bool; the box itself where the network sees nothing in it.

        Raises:
            ValueError: the box lies outside the photo.
        """
        inner = part_in_photo(photo, box)
        crop = MaskCrop.of(photo.rgb, inner)
        chances = self.chances(crop)
        reach = BEYOND * max(inner.width, inner.height)
        bounds = Box(inner.x0 - reach, inner.y0 - reach, inner.x1 + reach, inner.y1 + reach)
        found = _placed(tidy(chances, crop.box), crop.square, bounds, photo.width, photo.height)
        if not found.any():
            found[_pixels(inner, photo.width, photo.height)] = True
        return found

    def chances(self, crop: MaskCrop) -> NDArray[np.float32]:
        """(SIDE, SIDE) logits, above 0 on the object."""
        logits, _ = self._session.run(
            ["logits", "quality"], {"images": crop.rgb[None], "boxes": crop.box[None].astype(np.float32)}
        )
        return np.asarray(logits[0], np.float32)


def tidy(logits: NDArray[np.float32], box: FloatArray) -> NDArray[np.float32]:
    """(SIDE, SIDE) logits without specks, parts wholly beside the box, and pinholes, each turned about."""
    seen = logits > 0.0
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    inside = (x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])
    count, parts = cv2.connectedComponents(seen.astype(np.uint8), connectivity=8)
    within = np.zeros(count, np.bool_)
    within[np.unique(parts[seen & inside])] = True
    kept = tidied(seen & within[parts], SPECK, PINHOLE)
    return np.where(kept == seen, logits, -logits).astype(np.float32)


def _placed(logits: NDArray[np.float32], square: Box, bounds: Box, width: int, height: int) -> Mask:
    """The mask in the photo's pixels, nothing of it beyond ``bounds``."""
    out = np.zeros((height, width), np.bool_)
    rows, columns = _pixels(bounds, width, height)
    scale = SIDE / square.width
    # Bilinear between the logits of the crop's pixel centres, at the photo's.
    x = ((np.arange(columns.start, columns.stop) + 0.5 - square.x0) * scale - 0.5).astype(np.float32)
    y = ((np.arange(rows.start, rows.stop) + 0.5 - square.y0) * scale - 0.5).astype(np.float32)
    grid_x, grid_y = np.meshgrid(x, y)
    values = cv2.remap(logits, grid_x, grid_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    out[rows, columns] = values > 0.0
    return out


def _pixels(box: Box, width: int, height: int) -> tuple[slice, slice]:
    """Rows and columns of the pixels that a box touches."""
    return (
        slice(max(int(np.floor(box.y0)), 0), min(int(np.ceil(box.y1)), height)),
        slice(max(int(np.floor(box.x0)), 0), min(int(np.ceil(box.x1)), width)),
    )
