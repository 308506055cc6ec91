"""The part of a photo in which a model is drawn: a whole photo would be drawn for a few of its pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.poses import Pose4Dof


@dataclass(frozen=True, slots=True)
class Window:
    """Columns [x0, x1) and rows [y0, y1) of a photo; never empty."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def width(self) -> int:
        """Columns."""
        return self.x1 - self.x0

    @property
    def height(self) -> int:
        """Rows."""
        return self.y1 - self.y0

    @property
    def slices(self) -> tuple[slice, slice]:
        """What cuts it out of an (H, W, ...) array."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    def cameras(self, pose: Pose4Dof) -> Cameras:
        """One camera that sees what a photo's camera of that pose sees within the window."""
        x, y = pose.principal_px
        moved = replace(pose, principal_px=(x - self.x0, y - self.y0))
        return moved.to_cameras(self.width, self.height)


def window_about(points_px: FloatArray, margin: float, width: int, height: int) -> Window | None:
    """The window of a (width, height) photo about (P, 2) pixels, ``margin`` pixels larger on each side.

    None where none of it lies in the photo; points that are not finite do not count.
    """
    points = np.asarray(points_px, np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return None
    low = np.floor(points.min(axis=0) - margin)
    high = np.ceil(points.max(axis=0) + margin)
    x0, y0 = (int(v) for v in np.clip(low, 0, (width, height)))
    x1, y1 = (int(v) for v in np.clip(high, 0, (width, height)))
    return Window(x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None
