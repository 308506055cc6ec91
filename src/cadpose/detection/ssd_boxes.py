"""What an SSD's outputs mean: encodings against prior boxes, then suppression within each class."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray

#: As the published graph says: overlap from which a worse box of the same class is dropped, boxes a class
#: that take part, boxes that are kept.
NMS_IOU, MOST_OF_CLASS, MOST = 0.6, 100, 100


def decode(
    encodings: NDArray[np.float32],
    scores: NDArray[np.float32],
    priors: FloatArray,
    variance: FloatArray,
    floor: float,
) -> FloatArray:
    """Boxes of one picture, best first.

    Args:
        encodings: (P, 4) centre y, centre x, height and width against the priors.
        scores: (P, C) in [0, 1], class 0 being none.
        priors: (P, 4) centre x, centre y, width, height in shares of the picture.
        variance: (4,) what encodings of x, y, width and height are multiplied with.
        floor: Lowest score that is kept.

    Returns:
        (N, 6) class, score, x0, y0, x1, y1 in shares of the picture, which boxes may leave.
    """
    prior, kind = np.nonzero((scores >= floor) & np.isfinite(encodings).all(axis=1, keepdims=True))
    keep = kind > 0
    prior, kind = prior[keep], kind[keep]
    score: Any = scores[prior, kind]
    best = np.argsort(-score, kind="stable")
    # The best of each class: how many of its class come before it.
    rank = np.empty(len(best), np.int64)
    for c in np.unique(kind):
        own = best[kind[best] == c]
        rank[own] = np.arange(len(own))
    best = best[rank[best] < MOST_OF_CLASS]
    prior, kind, score = prior[best], kind[best], score[best]
    if not len(prior):
        return np.empty((0, 6))
    shift = encodings[prior][:, [1, 0, 3, 2]].astype(np.float64) * variance
    p = priors[prior]
    size = p[:, 2:] * np.exp(np.minimum(shift[:, 2:], 10.0))
    low = p[:, :2] + shift[:, :2] * p[:, 2:] - size / 2.0
    # Arrays will do; OpenCV's types say lists.
    rectangles: Any = np.concatenate([low, size], axis=1)
    classes: Any = kind.astype(np.int32)
    suppressed: Any = cv2.dnn.NMSBoxesBatched(rectangles, score, classes, floor, NMS_IOU)
    kept = np.asarray(suppressed, np.int64).ravel()
    kept = kept[np.argsort(-score[kept], kind="stable")][:MOST]
    return np.asarray(np.column_stack([kind, score, low, low + size])[kept], np.float64)
