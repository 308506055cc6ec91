"""Which pixels of a photo go with an object: its mask, what the mask missed, and its contact shadow."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.library.mesh import Mesh
from cadpose.poses import Pose4Dof
from cadpose.records import Mask
from cadpose.replacement.shadow import ground_height

#: Below this overlap with the mask the old model's outline says nothing of the object's.
LEAST_IOU = 0.6
# In shares of the object's longer side: rim, gaps that are closed, and how far the contact shadow reaches.
_RIM, _GAP, _CONTACT = 0.012, 0.04, 0.035


def floor_row(mesh: Mesh, pose: Pose4Dof) -> float:
    """The row where the ground under a model begins: below it a photo shows ground, whatever is above.

    Infinite where the ground is not seen from above.
    """
    y = ground_height(mesh)
    if -(pose.rotation.to_matrix().T @ np.array([0.0, 0.0, pose.t_z]))[1] <= y:
        return float("inf")
    low = mesh.hull[mesh.hull[:, 1] < y + 0.12]
    rows = pose.project(np.stack([low[:, 0], np.full(len(low), y), low[:, 2]], axis=1))[:, 1]
    return float(rows.min()) if np.isfinite(rows).all() else float("inf")


def removed_region(mask: Mask, silhouette: Mask, contact: Mask) -> Mask:
    """The pixels to be painted over.

    Args:
        mask: (H, W) the object's pixels; at least one.
        silhouette: (H, W) what its CAD model covers.
        contact: (H, W) where its contact shadow is expected.

    Returns:
        (H, W) bool that holds all of ``mask``.
    """
    ys, xs = np.nonzero(mask)
    side = 1 + max(int(np.ptp(ys)), int(np.ptp(xs)))
    both, either = (mask & silhouette).sum(), (mask | silhouette).sum()
    # A mask that the model does not explain is full of gaps: its hull leaves no ghosts of spokes and seats.
    object_ = mask | (silhouette if both >= LEAST_IOU * either else _hull(mask))
    grown = _shaped(object_, cv2.MORPH_CLOSE, _GAP * side)
    grown = _without_holes(grown, most=0.05 * float(grown.sum()))
    return _shaped(grown, cv2.MORPH_DILATE, max(2.0, _RIM * side)) | contact | mask


def contact_region(mesh: Mesh, pose: Pose4Dof, mask: Mask) -> Mask:
    """(H, W) what lies under a model: the hull of its lowest parts on the ground, a little grown.

    Nothing where the ground is not seen from above, or where most of it lies away from ``mask``.
    """
    y = ground_height(mesh)
    R = pose.rotation.to_matrix()
    empty = np.zeros(mask.shape, np.bool_)
    if -(R.T @ np.array([0.0, 0.0, pose.t_z]))[1] <= y:
        return empty
    low = mesh.hull[mesh.hull[:, 1] < y + 0.12]
    ground = np.stack([low[:, 0], np.full(len(low), y), low[:, 2]], axis=1)
    pixels = pose.project(ground)
    if not np.isfinite(pixels).all() or np.abs(pixels).max() > 1e5:
        return empty
    hull = _filled(cv2.convexHull(pixels.astype(np.float32))[:, 0], mask.shape)
    ys, xs = np.nonzero(mask)
    side = 1 + max(int(np.ptp(ys)), int(np.ptp(xs)))
    near = _shaped(mask, cv2.MORPH_DILATE, 0.08 * side)
    return np.asarray(_shaped(hull, cv2.MORPH_DILATE, max(2.0, _CONTACT * side)) & near)


def _hull(mask: Mask) -> Mask:
    points = np.argwhere(mask)[:, ::-1].astype(np.int32)
    return _filled(cv2.convexHull(points)[:, 0], mask.shape)


def _filled(polygon: NDArray[np.integer | np.floating], shape: tuple[int, ...]) -> Mask:
    canvas = np.zeros(shape, np.uint8)
    cv2.fillPoly(canvas, [np.round(polygon).astype(np.int32)], 1)
    return canvas > 0


def _shaped(mask: Mask, how: int, radius: float) -> Mask:
    r = max(1, round(radius))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * r + 1, 2 * r + 1))
    # Beyond the photo is nothing: a border as wide as the kernel keeps closing honest.
    padded = np.pad(mask.astype(np.uint8), r)
    return np.asarray(cv2.morphologyEx(padded, how, kernel)[r:-r, r:-r] > 0)


def _without_holes(mask: Mask, most: float) -> Mask:
    """Holes of at most so many pixels filled: larger ones show what is behind the object."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats((~mask).astype(np.uint8), connectivity=4)
    rim = set(np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])).tolist())
    filled = mask.copy()
    for i in range(1, count):
        if i not in rim and stats[i, cv2.CC_STAT_AREA] <= most:
            filled |= labels == i
    return filled
