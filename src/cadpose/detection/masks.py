"""From a box to the object's mask, without training: GrabCut on a small crop around the box.

GrabCut (Rother et al., SIGGRAPH 2004) separates colours, so it does well on plain backgrounds and poorly
where object and background look alike; what comes out is checked, and replaced by the box's ellipse where
it cannot be the object of that box.
"""

from __future__ import annotations

import logging
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.boxes import Box, box_iou
from cadpose.records import Mask, Photo

log = logging.getLogger(__name__)

#: Longer side of the crop that is segmented, in pixels.
SIDE = 224
#: The crop is the box enlarged by this factor: its rim shows the background.
CONTEXT = 1.4
#: A mask below this share of the box is not believed; one above the other is the whole box.
FEWEST, MOST = 0.1, 0.98
#: Of GrabCut's masks: parts below this share of the largest and holes below that of the mask are noise.
SPECK, PINHOLE = 0.1, 0.01
#: A mask whose own box overlaps the given one less than this is not the object of that box.
LEAST_BOX_IOU = 0.5


class MaskEstimator(Protocol):
    """Finds the pixels of the object that fills a box.

    Examples:
        >>> import numpy as np
        >>> from cadpose import Box, Photo
        >>> class WholeBox:
        ...     name = "whole-box"
        ...
        ...     def mask(self, photo, box):
        ...         x0, y0, x1, y1 = (round(c) for c in box.clipped(photo.width, photo.height).to_tuple())
        ...         mask = np.zeros((photo.height, photo.width), bool)
        ...         mask[y0:y1, x0:x1] = True
        ...         return mask
        >>> WholeBox().mask(Photo(np.zeros((100, 200, 3), np.uint8)), Box(50, 25, 150, 75)).sum()
        np.int64(5000)

        ``Annotator(masks=WholeBox())`` uses it.
    """

    name: str

    def mask(self, photo: Photo, box: Box) -> Mask:
        """(H, W) bool of the photo's size, never empty, False outside the box."""
        ...


def part_in_photo(photo: Photo, box: Box) -> Box:
    """The part of a box that lies in the photo.

    Raises:
        ValueError: there is none.
    """
    inner = box.clipped(photo.width, photo.height)
    if inner is None:
        raise ValueError(f"{box} lies outside the photo of {photo.width} x {photo.height} pixels")
    return inner


class GrabCutMasks:
    """Masks by GrabCut from the box alone.

    Args:
        seed: Seeds the colour models.
        iterations: Rounds of colour model and graph cut.
    """

    name = "grabcut"

    def __init__(self, seed: int = 0, iterations: int = 4) -> None:
        self.seed = seed
        self.iterations = iterations

    def mask(self, photo: Photo, box: Box) -> Mask:
        """(H, W) bool; the box's ellipse where no mask can be believed, which is logged.

        Raises:
            ValueError: the box lies outside the photo.
        """
        inner = part_in_photo(photo, box)
        # Whole pixels around the enlarged box.
        around = inner.scaled(CONTEXT).clipped(photo.width, photo.height) or inner
        x0, y0 = int(around.x0), int(around.y0)
        x1, y1 = int(np.ceil(around.x1)), int(np.ceil(around.y1))
        crop = photo.rgb[y0:y1, x0:x1]
        scale = min(SIDE / max(crop.shape[:2]), 1.0)
        size = (max(round(crop.shape[1] * scale), 1), max(round(crop.shape[0] * scale), 1))
        small = cv2.resize(crop, size, interpolation=cv2.INTER_AREA)
        sx, sy = size[0] / crop.shape[1], size[1] / crop.shape[0]
        local = Box((inner.x0 - x0) * sx, (inner.y0 - y0) * sy, (inner.x1 - x0) * sx, (inner.y1 - y0) * sy)

        shares = self._segmented(np.asarray(small, np.uint8), local)
        if shares is None:
            log.info("%s: no mask to be believed in %s, taking its ellipse", photo.name, inner.to_tuple())
            shares = _ellipse(local, size)
        back = cv2.resize(shares, (crop.shape[1], crop.shape[0]), interpolation=cv2.INTER_LINEAR)
        out = np.zeros((photo.height, photo.width), np.bool_)
        out[y0:y1, x0:x1] = back >= 0.5
        keep = np.zeros_like(out)
        rows = slice(int(inner.y0), int(np.ceil(inner.y1)))
        columns = slice(int(inner.x0), int(np.ceil(inner.x1)))
        keep[rows, columns] = out[rows, columns]
        if not keep.any():  # a box of a pixel or two
            keep[rows, columns] = True
        return keep

    def _segmented(self, rgb: NDArray[np.uint8], box: Box) -> NDArray[np.float32] | None:
        """(h, w) float32, 1 on the object; None where the result cannot be the object of the box."""
        height, width = rgb.shape[:2]
        if min(box.width, box.height) < 8:
            return None
        y, x = np.mgrid[0:height, 0:width] + 0.5
        (cx, cy) = box.centre
        u, v = (x - cx) / (box.width / 2), (y - cy) / (box.height / 2)
        inside = (abs(u) <= 1) & (abs(v) <= 1)
        labels = np.full((height, width), cv2.GC_BGD, np.uint8)
        labels[inside] = cv2.GC_PR_BGD
        # An object seldom reaches the corners of its box.
        labels[inside & (abs(u) ** 3 + abs(v) ** 3 <= 1)] = cv2.GC_PR_FGD
        if inside.mean() > 0.95:  # no rim to learn the background from: the corners have to do
            labels[inside & (abs(u) > 0.9) & (abs(v) > 0.9)] = cv2.GC_BGD
        models = np.zeros((1, 65)), np.zeros((1, 65))  # OpenCV's own layout of two colour mixtures
        cv2.setRNGSeed(self.seed)
        try:
            cv2.grabCut(rgb, labels, (0, 0, 0, 0), *models, self.iterations, cv2.GC_INIT_WITH_MASK)
        except cv2.error:  # one colour only
            return None
        found = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)) & inside
        found = tidied(found, SPECK, PINHOLE)
        share = found.sum() / max(inside.sum(), 1)
        if share < FEWEST:
            return None
        if share > MOST:
            return np.asarray(inside, np.float32)
        fit = box_iou(np.array(Box.from_mask(found).to_tuple()), np.array(box.to_tuple()))
        return np.asarray(found, np.float32) if fit >= LEAST_BOX_IOU else None


def tidied(mask: Mask, speck: float, pinhole: float) -> Mask:
    """Without specks, parts below that share of the largest, and without pinholes below that of the mask."""
    parts, count = _parts(mask)
    if count > 1:
        sizes = np.bincount(parts.ravel())
        sizes[0] = 0
        mask = (sizes >= speck * sizes.max())[parts]
    holes, count = _parts(~mask)
    if count > 1:
        sizes = np.bincount(holes.ravel())
        sizes[holes[mask]] = 0
        edge = np.concatenate([holes[0], holes[-1], holes[:, 0], holes[:, -1]])
        fill = sizes < pinhole * max(mask.sum(), 1)
        fill[edge] = False
        mask = mask | (fill[holes] & ~mask)
    return np.asarray(mask, np.bool_)


def _ellipse(box: Box, size: tuple[int, int]) -> NDArray[np.float32]:
    """(h, w) float32, 1 inside the ellipse that the box holds."""
    y, x = np.mgrid[0 : size[1], 0 : size[0]] + 0.5
    (cx, cy) = box.centre
    inside = ((x - cx) / (box.width / 2)) ** 2 + ((y - cy) / (box.height / 2)) ** 2 <= 1.0
    return np.asarray(inside, np.float32)


def _parts(mask: Mask) -> tuple[NDArray[np.int32], int]:
    """(H, W) number of each pixel's part, 0 outside the mask, and how many there are; edges connect."""
    count, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    return np.asarray(parts, np.int32), count - 1
