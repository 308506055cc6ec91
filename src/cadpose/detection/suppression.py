"""Non-maximum suppression across classes: of detections of one object only the best is kept."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cadpose.geometry.boxes import box_iou
from cadpose.geometry.frames import FloatArray
from cadpose.records import Detection

#: Overlap above which two detections are one object, of different categories and of the same.
ACROSS, WITHIN = 0.6, 0.5
#: Share of a detection inside a better one of its category above which it is a part of that one.
INSIDE = 0.9


def suppress(
    found: Iterable[Detection],
    *,
    across: float = ACROSS,
    within: float = WITHIN,
    inside: float = INSIDE,
) -> list[Detection]:
    """Greedy suppression, the best score first; of equal scores the first given.

    Args:
        found: Detections of one photo.
        across: IoU in [0, 1] with a kept one of another category above which one is dropped.
        within: The same for one category.
        inside: One is dropped too where this share of its area lies within a kept one of its category.

    Returns:
        The kept detections, best first.
    """
    kept: list[Detection] = []
    for d in sorted(found, key=lambda d: -d.score):
        if not any(_one_object(d, k, across, within, inside) for k in kept):
            kept.append(d)
    return kept


def _one_object(d: Detection, k: Detection, across: float, within: float, inside: float) -> bool:
    """Whether ``d`` shows what ``k``, the better one, shows."""
    alike = d.category == k.category
    a, b = np.array(d.box.to_tuple()), np.array(k.box.to_tuple())
    overlap, share = float(box_iou(a, b)), share_inside(a, b)
    return overlap > (within if alike else across) or (alike and share > inside)


def share_inside(a: FloatArray, b: FloatArray) -> float:
    """Share of the box ``a`` that lies in the box ``b``, each (4,) x0, y0, x1, y1."""
    sides = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    return float(sides.clip(0.0).prod()) / float((a[2:] - a[:2]).prod())
