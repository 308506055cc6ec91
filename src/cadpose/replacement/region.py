"""Which pixels of a photo go with an object: its mask, what the mask missed, and its contact shadow."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.library.mesh import Mesh
from cadpose.poses import Pose4Dof
from cadpose.records import Mask
from cadpose.replacement.shadow import ground_height

#: Below this overlap with the mask the old model's outline says nothing of the object's; below the second the
#: mask is taken to be full of gaps.
LEAST_IOU, GOOD_IOU = 0.3, 0.6
# In shares of the object's longer side: rim, gaps that are closed, and how far the contact shadow reaches.
_RIM, _GAP, _CONTACT = 0.012, 0.04, 0.035


def floor_row(mesh: Mesh, pose: Pose4Dof) -> float:
    """The row where the ground under a model begins: below it a photo shows ground, whatever is above.

    Infinite where the ground is not seen from above.
    """
    pixels = _footprint(mesh, pose)
    return float("inf") if pixels is None else float(pixels[:, 1].min())


def _footprint(mesh: Mesh, pose: Pose4Dof) -> FloatArray | None:
    """(P, 2) pixels of a model's lowest parts, put onto the ground; None where it is not seen from above."""
    y = ground_height(mesh)
    eye = -(pose.rotation.to_matrix().T @ np.array([0.0, 0.0, pose.t_z]))
    if eye[1] <= y:
        return None
    low = mesh.hull[mesh.hull[:, 1] < y + 0.12]
    pixels = pose.project(np.stack([low[:, 0], np.full(len(low), y), low[:, 2]], axis=1))
    return pixels if np.isfinite(pixels).all() else None


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
    # Painting too much costs little, as the new model hides it; what is left of the old one is seen at once.
    object_ = mask.copy()
    if both >= LEAST_IOU * either:
        object_ |= silhouette
    if both < GOOD_IOU * either:
        object_ |= _hull(mask)
    closed = _closed(object_, _GAP * side)
    whole = _without_holes(closed, most=0.05 * float(closed.sum()))
    return grown(whole, max(2.0, _RIM * side)) | contact | mask


def contact_region(mesh: Mesh, pose: Pose4Dof, mask: Mask) -> Mask:
    """(H, W) what lies under a model: the hull of its lowest parts on the ground, a little grown.

    Nothing where the ground is not seen from above, or where most of it lies away from ``mask``.
    """
    pixels = _footprint(mesh, pose)
    if pixels is None or np.abs(pixels).max() > 1e5:
        return np.zeros(mask.shape, np.bool_)
    hull = _filled(cv2.convexHull(pixels.astype(np.float32))[:, 0], mask.shape)
    ys, xs = np.nonzero(mask)
    side = 1 + max(int(np.ptp(ys)), int(np.ptp(xs)))
    near = grown(mask, 0.08 * side)
    return np.asarray(grown(hull, max(2.0, _CONTACT * side)) & near)


def _hull(mask: Mask) -> Mask:
    points = np.argwhere(mask)[:, ::-1].astype(np.int32)
    return _filled(cv2.convexHull(points)[:, 0], mask.shape)


def _filled(polygon: NDArray[np.integer | np.floating], shape: tuple[int, ...]) -> Mask:
    canvas = np.zeros(shape, np.uint8)
    cv2.fillPoly(canvas, [np.round(polygon).astype(np.int32)], 1)
    return canvas > 0


def grown(mask: Mask, radius: float) -> Mask:
    """(H, W) all within ``radius`` pixels of a mask; as quick for a large radius as for a small one."""
    if not mask.any():
        return mask.copy()
    return np.asarray(_distance(~mask) <= max(1.0, radius))


def _closed(mask: Mask, radius: float) -> Mask:
    """Grown and shrunk again: gaps of less than twice the radius are gone."""
    r = max(1.0, radius)
    # Beyond the photo is nothing: a border wider than the radius keeps closing honest.
    border = int(r) + 2
    wide = grown(np.pad(mask, border), r)
    return np.asarray((_distance(wide) > r)[border:-border, border:-border] | mask)


def _distance(mask: Mask) -> NDArray[np.float32]:
    """Of each pixel of the mask to the next one that is not of it."""
    return np.asarray(cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5), np.float32)


def _without_holes(mask: Mask, most: float) -> Mask:
    """Holes of at most so many pixels filled: larger ones show what is behind the object."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats((~mask).astype(np.uint8), connectivity=4)
    rim = set(np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])).tolist())
    filled = mask.copy()
    for i in range(1, count):
        if i not in rim and stats[i, cv2.CC_STAT_AREA] <= most:
            filled |= labels == i
    return filled
