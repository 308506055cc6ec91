"""How alike two masks are: by area, and along their outlines."""

from __future__ import annotations

import math

import cv2
import numpy as np

from cadpose.records import Mask

#: How far two outlines may lie apart and agree, as a share of the photo's diagonal: DAVIS's 0.008.
TOLERANCE = 0.008


def boundary_f(found: Mask, true: Mask, tolerance: float = TOLERANCE) -> float:
    """DAVIS's contour accuracy F (Perazzi et al., CVPR 2016): agreement of two outlines in [0, 1].

    Precision is the share of the found outline's pixels that have one of the true outline near, recall the
    same the other way round, and F = 2 P R / (P + R). The photo's edge is no outline.

    Args:
        found: (H, W) bool.
        true: (H, W) bool.
        tolerance: How near, as a share of the diagonal; rounded up to whole pixels, as DAVIS does.

    Raises:
        ValueError: the sizes differ.
    """
    if found.shape != true.shape:
        raise ValueError(f"masks of {found.shape} and {true.shape} pixels cannot be compared")
    reach = math.ceil(tolerance * math.hypot(*found.shape))
    # Nothing outside this window takes part; a rim keeps its edge apart from the photo's.
    rows, columns = (np.flatnonzero((found | true).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return 1.0
    window = tuple(slice(max(0, int(at[0]) - 2), int(at[-1]) + 3) for at in (rows, columns))
    a, b = outline(found[window]), outline(true[window])
    if not a.any() or not b.any():
        return float(a.any() == b.any())
    precision, recall = _near(a, b, reach), _near(b, a, reach)
    return 2.0 * precision * recall / (precision + recall) if precision + recall else 0.0


def outline(mask: Mask) -> Mask:
    """(H, W) pixels of the mask that have one outside it beside them; the picture's edge does not count."""
    inner = cv2.erode(
        mask.astype(np.uint8),
        np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8),
        borderType=cv2.BORDER_CONSTANT,
        borderValue=1,
    )
    return np.asarray(mask & (inner == 0))


def _near(a: Mask, b: Mask, reach: int) -> float:
    """Share of a's pixels that have one of b within reach."""
    far = cv2.distanceTransform((~b).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return float((far[a] <= reach + 1e-4).mean())
