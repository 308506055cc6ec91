"""Crop and render side by side with lines between inliers, as the paper's Fig. 9."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import SIDE
from cadpose.similarity.local_affine import ViewMatches
from cadpose.similarity.local_features import resize_squares

_BLUE = (30, 80, 255)
_SHIFT = 4  # cv2's fixed-point fraction bits


def draw_matches(
    crop: NDArray[np.uint8], view: NDArray[np.uint8], matches: ViewMatches, *, side: int = 2 * SIDE
) -> NDArray[np.uint8]:
    """Blue lines join the inliers.

    Args:
        crop: (S, S, 3) uint8 crop of the photo.
        view: (T, T, 3) uint8 render over a background, for example ``views.over()[k]``.
        matches: What :meth:`LocalAffine.compare` found for that render.
        side: Side of each of the two pictures in the result.

    Returns:
        (side, 2 side, 3) uint8.
    """
    both = [resize_squares(image[None], side)[0] for image in (crop, view)]
    canvas = np.ascontiguousarray(np.concatenate(both, axis=1))
    scale = side / SIDE
    inliers = matches.fit.inliers
    for a, b in zip(matches.crop_xy[inliers] * scale, matches.view_xy[inliers] * scale, strict=True):
        start, end = _fixed(a[0], a[1]), _fixed(b[0] + side, b[1])
        cv2.line(canvas, start, end, _BLUE, 1, cv2.LINE_AA, _SHIFT)
        for point in (start, end):
            cv2.circle(canvas, point, 2 << _SHIFT, _BLUE, 1, cv2.LINE_AA, _SHIFT)
    return canvas


def _fixed(x: float, y: float) -> tuple[int, int]:
    # Our pixel centres lie at halves, OpenCV's at whole numbers.
    return round((x - 0.5) * (1 << _SHIFT)), round((y - 0.5) * (1 << _SHIFT))
