"""How well a drawn pose agrees with the photo: features inside, silhouette, outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.alignment.refinement.crop import BACKGROUND, ObjectCrop
from cadpose.encoder import SIDE, Lite0
from cadpose.records import Views

_CELLS = SIDE // 16
#: Outlines further apart than this, in pixels of 224, count as this far.
_REACH_PX = 12.0


@dataclass(frozen=True)
class Weights:
    """What counts how much.

    Attributes:
        features: Mean cosine of the encoder's maps over the cells that the model covers.
        silhouette: IoU of silhouette and mask.
        outline: Mean distance of the outlines of silhouette and mask, both ways, as a share of 12 px.
    """

    features: float = 1.0
    silhouette: float = 1.0
    outline: float = 0.5


@dataclass(frozen=True, eq=False)
class Look:
    """One drawn pose.

    Attributes:
        map16: (112, 14, 14) float32 of the encoder.
        cover: (14, 14) float32 share of each cell that the model covers.
        alpha: (224, 224) float32 coverage in [0, 1].
        score: Higher is better.
    """

    map16: NDArray[np.float32]
    cover: NDArray[np.float32]
    alpha: NDArray[np.float32]
    score: float


class Likeness:
    """Compares drawn poses with one crop.

    Args:
        crop: The object in the photo.
        encoder: Lite0.
        weights: What counts how much; without a mask only the features do.
    """

    def __init__(self, crop: ObjectCrop, encoder: Lite0, weights: Weights | None = None) -> None:
        self.crop, self.encoder, self.weights = crop, encoder, weights or Weights()
        self.map16 = encoder.stride16(crop.rgb[None])[0]
        self._unit = _unit(self.map16)
        self._inside = cv2.resize(
            crop.inside.astype(np.float32), (_CELLS, _CELLS), interpolation=cv2.INTER_AREA
        )
        self._outline = None if crop.mask is None else _distances(crop.mask, crop.inside)

    def of(self, views: Views) -> Look:
        """The first view, drawn for the crop.

        Raises:
            ValueError: the view is not of the crop's size.
        """
        if views.alpha.shape[1:] != (SIDE, SIDE):
            raise ValueError(f"expected a view of {SIDE} x {SIDE} pixels, got {views.alpha.shape[1:]}")
        map16 = self.encoder.stride16(views.over(BACKGROUND)[:1])[0]
        alpha = views.alpha[0].astype(np.float32) / np.float32(255.0)
        cover = cv2.resize(alpha, (_CELLS, _CELLS), interpolation=cv2.INTER_AREA)
        cosine = (self._unit * _unit(map16)).sum(axis=0)
        # Beyond the photo nothing is known.
        counted = cover * self._inside
        covered = float(counted.sum(dtype=np.float64))
        score = self.weights.features * (
            float((cosine * counted).sum(dtype=np.float64)) / covered if covered else -1.0
        )
        score += self.of_silhouette(alpha)
        return Look(map16, np.asarray(cover, np.float32), alpha, score)

    def of_silhouette(self, alpha: NDArray[np.float32]) -> float:
        """The part of the score that silhouette and outline give; 0 without a mask."""
        mask = self.crop.mask
        if mask is None:
            return 0.0
        # Beyond the photo nothing is known: what the model covers there does not count.
        alpha = alpha * self.crop.inside
        union = float(np.maximum(alpha, mask).sum(dtype=np.float64))
        iou = float(np.minimum(alpha, mask).sum(dtype=np.float64)) / union if union else 0.0
        return self.weights.silhouette * iou - self.weights.outline * self._apart(alpha)

    def _apart(self, alpha: NDArray[np.float32]) -> float:
        """Mean distance of the outlines in [0, 1]; 1 where one has none."""
        mine, theirs = self._outline, _distances(alpha, self.crop.inside)
        if mine is None or theirs is None:
            return 1.0
        there = float(mine[0][theirs[1]].mean())
        back = float(theirs[0][mine[1]].mean())
        return (there + back) / (2.0 * _REACH_PX)


def _unit(map16: NDArray[np.float32]) -> NDArray[np.float32]:
    length = np.maximum(np.linalg.norm(map16, axis=0, keepdims=True), np.float32(1e-9))
    return np.asarray(map16 / length, np.float32)


def _distances(
    alpha: NDArray[np.float32], inside: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]] | None:
    """(224, 224) distance to the outline, at most 12 px, and the outline; None where there is none."""
    solid = (alpha >= 0.5).astype(np.uint8)
    edge = (solid != cv2.erode(solid, np.ones((3, 3), np.uint8))) & inside
    if not edge.any():
        return None
    far = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.minimum(far, np.float32(_REACH_PX)), edge
