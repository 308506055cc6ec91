"""The focal length at t_z = 2.0, from a box in closed form or from a mask."""

from __future__ import annotations

from cadpose.alignment.focal import FocalFit, align, focal_from_box, focals_from_box
from cadpose.alignment.silhouette import focal_from_mask

__all__ = ["FocalFit", "align", "focal_from_box", "focal_from_mask", "focals_from_box"]
