"""The fourth degree of freedom: the focal length at t_z = 2.0 that fits the detection box (Eq. 8-9).

With rotation and distance fixed, the rectangle of the projected model is ``f · u`` about the principal
point O, where ``u`` is the rectangle at f = 1 (:func:`cadpose.geometry.camera.projected_rectangle`). The
paper scans f with 60,000 projected surface samples; the best f has a closed form, found here. Write the
box about O as B, A = area(u), and w_x, w_y for the overlap's sides. Both are concave and piecewise linear
in f with breakpoints where an edge of f·u meets the same edge of B, so

    J(f) = w_x w_y / (A f² + |B|),     IoU = J / (1 - J),

has one maximum: at a breakpoint, or on a piece where w_x w_y = n2 f² + n1 f + n0 at a root of

    -A n1 f² + 2 (n2 |B| - A n0) f + n1 |B| = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import T_Z, projected_rectangle
from cadpose.geometry.frames import FloatArray
from cadpose.records import Pose4Dof, Rotation


@dataclass(frozen=True, slots=True)
class FocalFit:
    """A focal length and how well it fits.

    Attributes:
        focal_px: Focal length in pixels of the photo, at t_z = 2.0.
        box_iou: IoU of the projected rectangle with the box, in [0, 1].
        principal_px: Principal point (x, y) in pixels of the photo that it holds for.
        mask_iou: IoU of the silhouettes, where masks were compared.
    """

    focal_px: float
    box_iou: float
    principal_px: tuple[float, float]
    mask_iou: float | None = None


def focal_from_box(u: FloatArray, box: Box, principal_px: tuple[float, float] | None = None) -> FocalFit:
    """The focal length whose projected rectangle has the largest IoU with the box, in closed form.

    Args:
        u: (4,) rectangle x_min, y_min, x_max, y_max at focal length 1 about the principal point.
        box: Detection box in pixels of the photo.
        principal_px: Principal point in pixels of the photo; the box's middle if None (Fig. 4).

    Raises:
        ValueError: see :func:`focals_from_box`.
    """
    focal, iou = focals_from_box(np.asarray(u, np.float64).reshape(1, 4), box, principal_px)
    principal = box.centre if principal_px is None else principal_px
    return FocalFit(float(focal[0]), float(iou[0]), principal)


def focals_from_box(
    u: FloatArray, box: Box, principal_px: tuple[float, float] | None = None
) -> tuple[FloatArray, FloatArray]:
    """:func:`focal_from_box` for N rectangles at once.

    Where no focal length gives an overlap (the model edge-on and flat, or the principal point outside
    the box on the wrong side) the IoU is 0 and f makes the two diagonals equally long.

    Args:
        u: (N, 4) rectangles at focal length 1.
        box: Detection box in pixels of the photo.
        principal_px: Principal point in pixels of the photo; the box's middle if None.

    Returns:
        (N,) focal lengths in pixels and (N,) IoUs.

    Raises:
        ValueError: a rectangle is not finite, is turned inside out or is a single point.
    """
    u = np.asarray(u, np.float64)
    if u.ndim != 2 or u.shape[1] != 4:
        raise ValueError(f"rectangles must be (N, 4), got {u.shape}")
    size = u[:, 2:] - u[:, :2]
    if not np.isfinite(u).all() or (size < 0).any() or (size.max(axis=1, initial=0.0) <= 0).any():
        raise ValueError(
            "a projected rectangle must be finite with x_min <= x_max, y_min <= y_max, not a point"
        )
    ox, oy = box.centre if principal_px is None else principal_px
    # In units of the box's size and with u scaled alike, f is of order 1 and the quadratic well behaved.
    box_unit = float(np.hypot(box.width, box.height))
    u_unit = np.hypot(size[:, 0], size[:, 1])
    b = np.array([box.x0 - ox, box.y0 - oy, box.x1 - ox, box.y1 - oy]) / box_unit
    u = u / u_unit[:, None]
    f = _candidates(u, b)
    iou = _iou(f, u, b)
    rows = np.arange(len(u))
    best = np.argmax(iou, axis=1)
    focal, best_iou = f[rows, best], iou[rows, best]
    focal = np.where(best_iou > 0, focal, 1.0)
    return focal * box_unit / u_unit, best_iou


def align(
    points_s: FloatArray,
    rotation: Rotation,
    box: Box,
    *,
    principal_px: tuple[float, float] | None = None,
    centred: bool = False,
) -> tuple[Pose4Dof, float]:
    """The 4-DoF pose of a model whose rotation is known.

    Args:
        points_s: (P, 3) convex-hull vertices of the mesh (``Mesh.hull``), ShapeNet axes.
        rotation: The three angles.
        box: Detection box in pixels of the photo.
        principal_px: Principal point; the box's middle if None, as in the paper.
        centred: Instead of the paper's choice, put the principal point where the projected rectangle and
            the box have the same middle, as ``Cameras.framing`` does. See docs/alignment.md.

    Returns:
        The pose, and the IoU of its projected rectangle with the box.

    Raises:
        ValueError: a point lies behind the camera, the model projects to a point, or both
            ``principal_px`` and ``centred`` are given.
    """
    if centred and principal_px is not None:
        raise ValueError("give either principal_px or centred, not both")
    u = projected_rectangle(rotation.to_matrix(), points_s)[0]
    if centred:
        middle = (u[:2] + u[2:]) / 2.0
        fit = focal_from_box(u - np.tile(middle, 2), box)
        principal_px = (
            float(box.centre[0] - fit.focal_px * middle[0]),
            float(box.centre[1] - fit.focal_px * middle[1]),
        )
    else:
        fit = focal_from_box(u, box, principal_px)
        principal_px = fit.principal_px
    return Pose4Dof(rotation, fit.focal_px, principal_px, T_Z), fit.box_iou


def _candidates(u: FloatArray, b: FloatArray) -> FloatArray:
    """(N, 14) focal lengths > 0 among which the optimum is: four breakpoints, ten roots; 1 where unused."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        breaks = b / u
    breaks = np.where(np.isfinite(breaks) & (breaks > 0), breaks, np.inf)
    ordered = np.sort(breaks, axis=1)
    n = len(u)
    start = np.concatenate([np.zeros((n, 1)), ordered], axis=1)
    end = np.concatenate([ordered, np.full((n, 1), np.inf)], axis=1)
    inside = np.where(np.isfinite(end), (start + np.where(np.isfinite(end), end, 0.0)) / 2.0, start + 1.0)
    inside = np.where(np.isfinite(start), inside, 1.0)
    slope_x, offset_x = _overlap_line(inside, u[:, [0]], u[:, [2]], b[0], b[2])
    slope_y, offset_y = _overlap_line(inside, u[:, [1]], u[:, [3]], b[1], b[3])
    n2 = slope_x * slope_y
    n1 = slope_x * offset_y + slope_y * offset_x
    n0 = offset_x * offset_y
    area_u = ((u[:, 2] - u[:, 0]) * (u[:, 3] - u[:, 1]))[:, None]
    area_b = (b[2] - b[0]) * (b[3] - b[1])
    roots = _quadratic_roots(-area_u * n1, 2.0 * (n2 * area_b - area_u * n0), n1 * area_b)
    # A root outside its piece is harmless: every candidate is judged by its true IoU.
    f = np.concatenate([breaks, roots], axis=1)
    # Beyond 1e9 times the box's size only rounding noise would be compared.
    return np.where((f > 0) & (f < 1e9), f, 1.0)


def _overlap_line(
    f: FloatArray, u_low: FloatArray, u_high: FloatArray, b_low: float, b_high: float
) -> tuple[FloatArray, FloatArray]:
    """Slope and offset in f of min(f·u_high, b_high) - max(f·u_low, b_low), on the piece that holds f."""
    top, bottom = f * u_high < b_high, f * u_low > b_low
    slope = np.where(top, u_high, 0.0) - np.where(bottom, u_low, 0.0)
    offset = np.where(top, 0.0, b_high) - np.where(bottom, 0.0, b_low)
    return slope, offset


def _quadratic_roots(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(N, K) coefficients to (N, 2K) real roots of a x² + b x + c; not finite where there is none."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # The sum of two terms of one sign loses no digits, and a = 0 leaves the linear root in c / q.
        q = -0.5 * (b + np.where(b >= 0, 1.0, -1.0) * np.sqrt(b * b - 4.0 * a * c))
        return np.concatenate([q / a, c / q], axis=1)


def _iou(f: FloatArray, u: FloatArray, b: FloatArray) -> FloatArray:
    """(N, K) IoU of f·u with b."""
    scaled = f[..., None] * u[:, None, :]
    low, high = np.maximum(scaled[..., :2], b[:2]), np.minimum(scaled[..., 2:], b[2:])
    overlap = np.clip(high - low, 0.0, None).prod(axis=-1)
    union = (scaled[..., 2:] - scaled[..., :2]).prod(axis=-1) + (b[2:] - b[:2]).prod() - overlap
    return np.asarray(overlap / union)
