"""Local features of a square crop or render: dense Lite0 cells (DELF-like) and SIFT.

DELF itself is in :mod:`cadpose.similarity.delf`, XFeat in :mod:`cadpose.similarity.xfeat`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import CHANNELS16, SIDE, Lite0, lite0
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask

#: Renders are drawn over this grey, and crops should be letterboxed with it.
BACKGROUND = 128


@dataclass(frozen=True, eq=False)
class Features:
    """P features of one image.

    Attributes:
        xy: (P, 2) continuous pixels (x, y), in an image brought to 224 x 224.
        descriptors: (P, D) float32 of unit length.
    """

    xy: FloatArray
    descriptors: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.xy)


class LocalFeatures(Protocol):
    """Finds and describes local features of square images."""

    name: str

    def describe(self, images: NDArray[np.uint8], masks: Mask | None = None) -> list[Features]:
        """(N, S, S, 3) uint8 images, of one kind (photos or renders), to their features.

        Only features within ``masks`` (N, S, S) are kept, where given.
        """
        ...


class DenseLite0:
    """Every cell of the stride-16 map at several input sizes is a feature.

    Descriptors: the map minus its mean over all the images of one call (photos and renders differ most
    in that mean), scaled to unit length.

    Args:
        sides: Input sides in pixels, multiples of 32.
        encoder: The process's shared Lite0 if None.
    """

    name = "dense-lite0"

    def __init__(self, sides: tuple[int, ...] = (SIDE, 2 * SIDE), encoder: Lite0 | None = None) -> None:
        self.sides = sides
        self.encoder = lite0() if encoder is None else encoder

    def encode(self, images: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
        """(N, S, S, 3) uint8 images to their (N, 112, side/16, side/16) maps at each side."""
        return [self.encoder.stride16(resize_squares(images, side)) for side in self.sides]

    def describe(
        self,
        images: NDArray[np.uint8],
        masks: Mask | None = None,
        *,
        maps: Sequence[NDArray[np.float32]] | None = None,
    ) -> list[Features]:
        """See :class:`LocalFeatures`; a cell counts as within the mask if half of it is.

        ``maps`` are what :meth:`encode` made of the images, where it was asked already.
        """
        xy: list[list[FloatArray]] = [[] for _ in images]
        descriptors: list[list[NDArray[np.float32]]] = [[] for _ in images]
        for known in self.encode(images) if maps is None else maps:
            seen = known.transpose(0, 2, 3, 1)
            cells = seen.shape[1]
            centres = (np.arange(cells) + 0.5) * (SIDE / cells)
            grid = np.stack(np.meshgrid(centres, centres), axis=-1)
            keep = np.ones(seen.shape[:3], np.bool_)
            if masks is not None:
                keep = resize_squares((masks * np.uint8(255)).astype(np.uint8), cells) >= 128
            if not keep.any():
                continue
            mean = seen[keep].mean(axis=0)
            for i, (one, inside) in enumerate(zip(seen, keep, strict=True)):
                xy[i].append(grid[inside])
                descriptors[i].append(unit(one[inside] - mean))
        return [
            Features(np.concatenate(p), np.concatenate(d)) if p else _none(CHANNELS16)
            for p, d in zip(xy, descriptors, strict=True)
        ]


class Sift:
    """OpenCV's SIFT on the grey image at 224 x 224, enlarged twice so that small parts give features.

    Args:
        count: At most so many features an image, strongest first.
    """

    name = "sift"

    def __init__(self, count: int = 1000) -> None:
        self.count = count

    def describe(self, images: NDArray[np.uint8], masks: Mask | None = None) -> list[Features]:
        """See :class:`LocalFeatures`."""
        detector = cv2.SIFT.create(nfeatures=self.count, contrastThreshold=0.02)
        enlarged = resize_squares(images, 2 * SIDE)
        inside = None
        if masks is not None:
            inside = resize_squares((masks * np.uint8(255)).astype(np.uint8), 2 * SIDE)
        result = []
        for i, image in enumerate(enlarged):
            grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
            area = None if inside is None else (inside[i] >= 128).astype(np.uint8)
            keypoints, descriptors = detector.detectAndCompute(grey, area)
            if descriptors is None or not len(keypoints):
                result.append(_none(128))
                continue
            # OpenCV's pixel centres are whole numbers, ours lie at halves.
            xy = (np.array([k.pt for k in keypoints], np.float64) + 0.5) / 2.0
            result.append(Features(xy, unit(np.asarray(descriptors, np.float32))))
        return result


def resize_squares(images: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    """(N, S, S[, 3]) uint8 to (N, side, side[, 3]): area averaging to shrink, linear to enlarge."""
    if images.shape[1:3] == (side, side):
        return images
    how = cv2.INTER_AREA if images.shape[1] > side else cv2.INTER_LINEAR
    return np.stack([cv2.resize(image, (side, side), interpolation=how) for image in images]).astype(np.uint8)


def unit(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """(..., D) to unit length; zero vectors stay zero."""
    norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(norm, 1e-9), np.float32)


def _none(d: int) -> Features:
    return Features(np.empty((0, 2)), np.empty((0, d), np.float32))
