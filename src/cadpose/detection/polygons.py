"""Polygons to masks by the even-odd rule, a pixel counting where its centre lies inside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask

#: Most corners of one object's polygons.
MAX_CORNERS = 100_000


def mask_from_polygons(height: int, width: int, polygons: Sequence[Sequence[float]]) -> Mask:
    """The union of COCO's polygons.

    Args:
        height: Of the photo.
        width: Of the photo.
        polygons: Each x0, y0, x1, y1, ... in continuous pixels, three corners or more.

    Returns:
        (height, width) bool.

    Raises:
        ValueError: a polygon has an odd number of coordinates or too few, or there are too many corners.
    """
    if sum(len(p) for p in polygons) > 2 * MAX_CORNERS:
        raise ValueError(f"more than {MAX_CORNERS} corners")
    out = np.zeros((height, width), np.bool_)
    for polygon in polygons:
        if len(polygon) % 2 or len(polygon) < 6:
            raise ValueError("a polygon needs x and y of three corners or more")
        corners = np.asarray(polygon, np.float64).reshape(-1, 2)
        _fill(out, np.clip(corners, -1e6, 1e6))
    return out


def _fill(out: Mask, corners: FloatArray) -> None:
    """Or one polygon into the mask: every edge flips all pixel centres of its rows to the right of it."""
    height, width = out.shape
    low, high = corners.min(axis=0), corners.max(axis=0)
    x0, x1 = (int(np.clip(np.floor(v), 0, width)) for v in (low[0], high[0] + 1))
    y0, y1 = (int(np.clip(np.floor(v), 0, height)) for v in (low[1], high[1] + 1))
    if x0 >= x1 or y0 >= y1:
        return
    flips = np.zeros((y1 - y0, x1 - x0 + 1), np.int32)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay == by:
            continue
        # Rows whose centre lies in [top, bottom): a corner on a centre counts for one of its edges.
        first = int(np.clip(np.ceil(min(ay, by) - 0.5), y0, y1))
        last = int(np.clip(np.ceil(max(ay, by) - 0.5), y0, y1))
        rows = np.arange(first, last)
        x = ax + (rows + 0.5 - ay) * (bx - ax) / (by - ay)
        columns = np.clip(np.ceil(x - 0.5), x0, x1).astype(int)
        np.add.at(flips, (rows - y0, columns - x0), 1)
    out[y0:y1, x0:x1] |= np.cumsum(flips, axis=1)[:, :-1] % 2 == 1
