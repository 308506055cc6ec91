"""The pinhole camera of Eq. 2-9: projection, and cameras that frame an object.

Pixel coordinates are continuous: pixel (column c, row r) covers [c, c+1) x [r, r+1), its centre is
(c + 0.5, r + 0.5). Boxes, principal points and projections all live in these coordinates.

The paper prints O_x for O_y in the second row of Eq. 7 and divides by P'_Wy in Eq. 8 and 9; both are
slips. What is meant, and done here: p = (f·x/(z + t_z) + O_x, f·y/(z + t_z) + O_y).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.geometry.frames import FloatArray

#: The fixed distance of the 4-DoF annotation (the paper's Eq. 9).
T_Z = 2.0


@dataclass(frozen=True, eq=False)
class Cameras:
    """A batch of N pinhole cameras with square pixels and one image size.

    Attributes:
        R_cv_from_s: (N, 3, 3) rotations, object (ShapeNet axes) to camera (OpenCV).
        t_cv: (N, 3) translations, the object's origin in the camera frame.
        focal_px: (N,) focal lengths in pixels.
        principal_px: (N, 2) principal points (x, y) in continuous pixels.
        width: Image width in pixels.
        height: Image height in pixels.

    Raises:
        ValueError: shapes disagree, a value is not finite, a rotation is not one, a focal length is
            not positive, or a size is < 1.
    """

    R_cv_from_s: FloatArray
    t_cv: FloatArray
    focal_px: FloatArray
    principal_px: FloatArray
    width: int
    height: int

    def __post_init__(self) -> None:
        n = len(self.focal_px)
        shapes = {"R_cv_from_s": (n, 3, 3), "t_cv": (n, 3), "focal_px": (n,), "principal_px": (n, 2)}
        for name, shape in shapes.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64).view()
            if array.shape != shape:
                raise ValueError(f"Cameras.{name} has shape {array.shape}, expected {shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"Cameras.{name} holds a value that is not finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if (self.focal_px <= 0).any():
            raise ValueError("Cameras.focal_px must be positive")
        if self.width < 1 or self.height < 1:
            raise ValueError(f"Cameras need a positive image size, got {self.width} x {self.height}")
        require_rotation(self.R_cv_from_s, "Cameras.R_cv_from_s")

    def __len__(self) -> int:
        return len(self.focal_px)

    @classmethod
    def from_rotations(
        cls,
        R_cv_from_s: FloatArray,
        *,
        focal_px: ArrayLike,
        width: int,
        height: int,
        principal_px: ArrayLike | None = None,
        t_z: float = T_Z,
    ) -> Cameras:
        """Cameras on the optical axis at distance ``t_z``; the principal point defaults to the centre.

        ``focal_px`` may be one number or (N,), ``principal_px`` (2,) or (N, 2).
        """
        R = np.asarray(R_cv_from_s, np.float64).reshape(-1, 3, 3)
        n = len(R)
        principal = (width / 2.0, height / 2.0) if principal_px is None else principal_px
        return cls(
            R_cv_from_s=R,
            t_cv=np.tile([0.0, 0.0, t_z], (n, 1)),
            focal_px=np.broadcast_to(np.asarray(focal_px, np.float64), (n,)).copy(),
            principal_px=np.broadcast_to(np.asarray(principal, np.float64), (n, 2)).copy(),
            width=width,
            height=height,
        )

    @classmethod
    def framing(
        cls,
        R_cv_from_s: FloatArray,
        points_s: FloatArray,
        *,
        size: int,
        margin: float = 0.0,
        t_z: float = T_Z,
    ) -> Cameras:
        """Cameras whose square image the projected points fill: longer side of the rectangle = image.

        This is how a tight box crop, letterboxed into a square, sees the object: the middle of the
        projected rectangle lies at the middle of the image.

        Args:
            R_cv_from_s: (N, 3, 3) rotations.
            points_s: (P, 3) points, convex-hull vertices suffice.
            size: Image side in pixels.
            margin: Free border as a fraction of the side, on each side.
            t_z: Distance of the object's origin.
        """
        R = np.asarray(R_cv_from_s, np.float64).reshape(-1, 3, 3)
        rect = projected_rectangle(R, points_s, t_z=t_z)
        extent = np.maximum(rect[:, 2] - rect[:, 0], rect[:, 3] - rect[:, 1])
        focal = size * (1.0 - 2.0 * margin) / extent
        centre = (rect[:, :2] + rect[:, 2:]) / 2.0
        principal = size / 2.0 - focal[:, None] * centre
        return cls.from_rotations(R, focal_px=focal, width=size, height=size, principal_px=principal, t_z=t_z)

    def __getitem__(self, index: int | np.integer | slice | NDArray[np.integer | np.bool_]) -> Cameras:
        keep = np.array([int(index)]) if isinstance(index, int | np.integer) else index
        return replace(
            self,
            R_cv_from_s=self.R_cv_from_s[keep],
            t_cv=self.t_cv[keep],
            focal_px=self.focal_px[keep],
            principal_px=self.principal_px[keep],
        )

    @property
    def K(self) -> FloatArray:
        """(N, 3, 3) intrinsics of Eq. 2."""
        K = np.zeros((len(self), 3, 3))
        K[:, 0, 0] = K[:, 1, 1] = self.focal_px
        K[:, :2, 2] = self.principal_px
        K[:, 2, 2] = 1.0
        return K

    def project(self, points_s: FloatArray) -> FloatArray:
        """(P, 3) object points to (N, P, 2) continuous pixels (Eq. 8).

        Points at or behind the camera give NaN.
        """
        x_cv = np.einsum("nij,pj->npi", self.R_cv_from_s, np.asarray(points_s, np.float64))
        x_cv = x_cv + self.t_cv[:, None, :]
        depth = np.where(x_cv[..., 2] > 0, x_cv[..., 2], np.nan)
        pixels = self.focal_px[:, None, None] * x_cv[..., :2] / depth[..., None]
        return np.asarray(pixels + self.principal_px[:, None, :])


def require_rotation(R: FloatArray, name: str, tolerance: float = 1e-5) -> None:
    """Raise ValueError unless every (..., 3, 3) matrix is a proper rotation."""
    identity = np.eye(3)
    error = np.abs(R @ np.swapaxes(R, -1, -2) - identity).max(initial=0.0)
    if error > tolerance or (np.linalg.det(R) < 0).any():
        raise ValueError(f"{name} is not a rotation matrix (orthogonal with determinant +1)")


def projected_rectangle(R_cv_from_s: FloatArray, points_s: FloatArray, *, t_z: float = T_Z) -> FloatArray:
    """Rectangle of the projected points about the principal point at focal length 1.

    Args:
        R_cv_from_s: (N, 3, 3) or (3, 3) rotations.
        points_s: (P, 3) points; the vertices of the convex hull give the exact rectangle of a mesh.
        t_z: Distance of the object's origin.

    Returns:
        (N, 4) x_min, y_min, x_max, y_max; multiply by f for pixels about the principal point.

    Raises:
        ValueError: a point lies at or behind the camera.
    """
    R = np.asarray(R_cv_from_s, np.float64).reshape(-1, 3, 3)
    x_cv = np.einsum("nij,pj->npi", R, np.asarray(points_s, np.float64))
    depth = x_cv[..., 2] + t_z
    if depth.min(initial=np.inf) <= 0:
        raise ValueError(
            f"the object reaches behind the camera: it must fit within t_z = {t_z} of its origin"
        )
    xy = x_cv[..., :2] / depth[..., None]
    return np.concatenate([xy.min(axis=1), xy.max(axis=1)], axis=-1)
