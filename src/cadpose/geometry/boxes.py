"""Axis-aligned rectangles in continuous pixel coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle [x0, x1] x [y0, y1] in continuous pixels, x to the right, y down.

    Raises:
        ValueError: a corner is not finite or the rectangle is empty.

    Examples:
        >>> from cadpose import Box
        >>> box = Box(10, 20, 110, 70)
        >>> box.width, box.height, box.centre
        (100, 50, (60.0, 45.0))
        >>> box == Box.from_xywh(10, 20, 100, 50)
        True
        >>> box.clipped(80, 60)
        Box(x0=10, y0=20, x1=80.0, y1=60.0)
    """

    x0: float
    y0: float
    x1: float
    y1: float

    def __post_init__(self) -> None:
        corners = (self.x0, self.y0, self.x1, self.y1)
        if not np.isfinite(corners).all():
            raise ValueError(f"box {corners} has a corner that is not finite")
        if self.x1 <= self.x0 or self.y1 <= self.y0:
            raise ValueError(f"box {corners} is empty: expected x0 < x1 and y0 < y1")

    @classmethod
    def from_xywh(cls, x: float, y: float, width: float, height: float) -> Box:
        """COCO's [x, y, width, height]."""
        return cls(x, y, x + width, y + height)

    @classmethod
    def from_mask(cls, mask: NDArray[np.bool_]) -> Box:
        """Tight box of a (H, W) mask.

        Raises:
            ValueError: the mask is empty.
        """
        rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if not len(rows):
            raise ValueError("an empty mask has no box")
        return cls(float(cols[0]), float(rows[0]), float(cols[-1] + 1), float(rows[-1] + 1))

    @classmethod
    def around(cls, *boxes: Box) -> Box:
        """The smallest box that holds all of one or more boxes."""
        corners = np.array([box.to_tuple() for box in boxes])
        (x0, y0), (x1, y1) = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
        return cls(float(x0), float(y0), float(x1), float(y1))

    @property
    def width(self) -> float:
        """Width in pixels."""
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        """Height in pixels."""
        return self.y1 - self.y0

    @property
    def area(self) -> float:
        """Area in pixels²."""
        return self.width * self.height

    @property
    def centre(self) -> tuple[float, float]:
        """(x, y) of the middle."""
        return (self.x0 + self.x1) / 2.0, (self.y0 + self.y1) / 2.0

    def to_xywh(self) -> tuple[float, float, float, float]:
        """COCO's [x, y, width, height]."""
        return self.x0, self.y0, self.width, self.height

    def to_tuple(self) -> tuple[float, float, float, float]:
        """(x0, y0, x1, y1)."""
        return self.x0, self.y0, self.x1, self.y1

    def clipped(self, width: int, height: int) -> Box | None:
        """The part inside an image of that size, or None if nothing is left."""
        x0, y0 = max(self.x0, 0.0), max(self.y0, 0.0)
        x1, y1 = min(self.x1, float(width)), min(self.y1, float(height))
        return Box(x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None

    def scaled(self, factor: float) -> Box:
        """The same middle, width and height times ``factor``."""
        (cx, cy), w, h = self.centre, self.width * factor / 2.0, self.height * factor / 2.0
        return Box(cx - w, cy - h, cx + w, cy + h)


def box_iou(a: FloatArray, b: FloatArray) -> FloatArray:
    """Intersection over union of boxes.

    Args:
        a: (..., 4) x0, y0, x1, y1.
        b: (..., 4); broadcasts against ``a``.

    Returns:
        (...) IoU in [0, 1].
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    sides = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    overlap = _area(np.maximum(sides, 0.0))
    union = _area(a[..., 2:] - a[..., :2]) + _area(b[..., 2:] - b[..., :2]) - overlap
    return np.asarray(overlap / np.maximum(union, 1e-300))


def _area(sides: FloatArray) -> FloatArray:
    # For two numbers a product over the axis takes several times as long.
    return np.asarray(sides[..., 0] * sides[..., 1])


def mask_iou(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Intersection over union of two (H, W) masks; 0 when both are empty."""
    union = np.logical_or(a, b).sum()
    return float(np.logical_and(a, b).sum() / union) if union else 0.0
