"""Rotations and poses: the 4-DoF annotation, and the 6-DoF pose that it becomes where the camera is known.

Both stand for ``p ~ K (R_cv_from_s X + t)``, X in units of the model's bounding-box diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from cadpose.geometry.angles import (
    angles_from_rotation,
    geodesic_degrees,
    rotation_from_angles,
    wrap180,
    wrap360,
)
from cadpose.geometry.camera import T_Z, Cameras, require_rotation
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.sight import allocentric_rotation, egocentric_rotation

#: Diagonal of a 35 mm film frame in millimetres, which EXIF's 35 mm equivalent refers to (CIPA DCG-001).
FILM_DIAGONAL_MM = float(np.hypot(36.0, 24.0))


@dataclass(frozen=True, slots=True)
class Rotation:
    """Azimuth in [0, 360), elevation in [-90, 90], in-plane rotation in (-180, 180], in degrees.

    Azimuth and in-plane rotation are wrapped into their range on construction.

    Raises:
        ValueError: an angle is not finite or the elevation is out of range.

    Examples:
        >>> from cadpose import Rotation
        >>> turned = Rotation(azimuth=370, elevation=20)
        >>> turned
        Rotation(azimuth=10.0, elevation=20.0, inplane=0.0)
        >>> turned.to_matrix().shape
        (3, 3)
        >>> round(turned.error_to(Rotation(40, 20)), 1)
        30.0
    """

    azimuth: float
    elevation: float
    inplane: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite((self.azimuth, self.elevation, self.inplane)).all():
            raise ValueError("a rotation's angles must be finite")
        if not -90.0 <= self.elevation <= 90.0:
            raise ValueError(f"elevation {self.elevation} is outside [-90, 90] degrees")
        object.__setattr__(self, "azimuth", float(wrap360(self.azimuth)))
        object.__setattr__(self, "elevation", float(self.elevation))
        object.__setattr__(self, "inplane", float(wrap180(self.inplane)))

    @classmethod
    def from_matrix(cls, R_cv_from_s: FloatArray) -> Rotation:
        """From a (3, 3) rotation, ShapeNet axes to OpenCV camera."""
        azimuth, elevation, inplane = angles_from_rotation(R_cv_from_s)
        return cls(float(azimuth), float(np.clip(elevation, -90.0, 90.0)), float(inplane))

    def to_matrix(self) -> FloatArray:
        """(3, 3) rotation, ShapeNet axes to OpenCV camera."""
        return rotation_from_angles(self.azimuth, self.elevation, self.inplane)

    def error_to(self, other: Rotation) -> float:
        """Geodesic angle to another rotation, degrees."""
        return float(geodesic_degrees(self.to_matrix(), other.to_matrix()))


@dataclass(frozen=True, slots=True)
class Pose4Dof:
    """Three angles and one focal length at t_z = 2.0, and where in the photo they apply.

    The photo is seen through a virtual camera that looks at the object (the paper's Fig. 4). The paper puts
    its principal point at the middle of the detection box; ``Annotator(align_to="box")``, the default, where
    the middles of the projected rectangle and of the box agree. See docs/alignment.md.

    Only f / t_z shows in a photo: ``focal_px`` is a size, not the lens's focal length.

    Attributes:
        rotation: Azimuth, elevation, in-plane rotation.
        focal_px: Focal length in pixels of the photo.
        principal_px: (x, y) in continuous pixels of the photo.
        t_z: Distance of the object's origin, 2.0 in units of the model's bounding-box diagonal.

    Raises:
        ValueError: focal length or distance is not positive and finite.

    Examples:
        >>> from cadpose import Pose4Dof, Rotation
        >>> pose = Pose4Dof(Rotation(0, 0), focal_px=300.0, principal_px=(200.0, 100.0))
        >>> pose.project([[0.0, 0.0, 0.0], [0.1, 0.2, -0.4]])  # the model's origin, and a point at its front
        array([[200.  , 100.  ],
               [181.25,  62.5 ]])
    """

    rotation: Rotation
    focal_px: float
    principal_px: tuple[float, float]
    t_z: float = T_Z

    def __post_init__(self) -> None:
        if not (np.isfinite(self.focal_px) and self.focal_px > 0):
            raise ValueError(f"focal length {self.focal_px} must be positive")
        if not (np.isfinite(self.t_z) and self.t_z > 0):
            raise ValueError(f"t_z {self.t_z} must be positive")
        if not np.isfinite(self.principal_px).all():
            raise ValueError("the principal point must be finite")

    def to_cameras(self, width: int, height: int) -> Cameras:
        """One camera for a photo of that size."""
        return Cameras.from_rotations(
            self.rotation.to_matrix(),
            focal_px=self.focal_px,
            principal_px=self.principal_px,
            width=width,
            height=height,
            t_z=self.t_z,
        )

    def project(self, points_s: FloatArray) -> FloatArray:
        """(P, 3) object points to (P, 2) continuous pixels of the photo (Eq. 8)."""
        return np.asarray(self.to_cameras(1, 1).project(points_s)[0])


@dataclass(frozen=True, slots=True)
class PhotoCamera:
    """The camera that took a photo: square pixels, no distortion.

    Attributes:
        focal_px: Focal length in pixels of the photo.
        principal_px: (x, y) principal point in continuous pixels of the photo.
        source: ``"given"`` by the user or a data set, or ``"exif"``: the file's 35 mm equivalent, which
            holds for a photo that was not cropped since.

    Raises:
        ValueError: the focal length is not positive, a number is not finite or the source is another word.
    """

    focal_px: float
    principal_px: tuple[float, float]
    source: Literal["given", "exif"] = "given"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.focal_px) and self.focal_px > 0):
            raise ValueError(f"focal length {self.focal_px} must be positive")
        if len(self.principal_px) != 2 or not np.isfinite(self.principal_px).all():
            raise ValueError("the principal point must be two finite numbers")
        if self.source not in ("given", "exif"):
            raise ValueError(f"a camera's source is given or exif, not {self.source!r}")

    @classmethod
    def from_35mm(cls, focal_35mm: float, width: int, height: int) -> Self:
        """From EXIF's 35 mm equivalent: the same angle of view along the diagonal; centred."""
        focal = focal_35mm / FILM_DIAGONAL_MM * float(np.hypot(width, height))
        return cls(focal, (width / 2.0, height / 2.0), "exif")

    def to_matrix(self) -> FloatArray:
        """(3, 3) intrinsics K (Eq. 2)."""
        (x, y), f = self.principal_px, self.focal_px
        return np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Pose6Dof:
    """Where an object stands in the frame of the camera that took the photo.

    Attributes:
        R_cv_from_s: (3, 3) rotation, ShapeNet axes to OpenCV camera.
        t_cv: (3,) the model's origin in the camera's frame, in units of the model's bounding-box diagonal.
        camera: That camera.
        diagonal_m: The diagonal in metres where the model's size is known; without it the pose is known up
            to scale.

    Raises:
        ValueError: no rotation, the origin is not before the camera, or the diagonal is not positive.
    """

    R_cv_from_s: FloatArray
    t_cv: FloatArray
    camera: PhotoCamera
    diagonal_m: float | None = None

    def __post_init__(self) -> None:
        for name, shape in (("R_cv_from_s", (3, 3)), ("t_cv", (3,))):
            array = np.array(getattr(self, name), np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise ValueError(f"Pose6Dof.{name} must be {shape} and finite, got {array.shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        require_rotation(self.R_cv_from_s, "Pose6Dof.R_cv_from_s")
        if self.t_cv[2] <= 0:
            raise ValueError(f"the object's origin must lie before the camera, z is {self.t_cv[2]}")
        if self.diagonal_m is not None and not (np.isfinite(self.diagonal_m) and self.diagonal_m > 0):
            raise ValueError(f"diagonal_m {self.diagonal_m} must be positive")

    @classmethod
    def from_4dof(cls, pose: Pose4Dof, camera: PhotoCamera, diagonal_m: float | None = None) -> Self:
        """The same view in the photo's own camera, in closed form; ``to_4dof`` takes it back exactly.

        The virtual camera of ``pose`` looks along the line of sight through its principal point; it is turned
        back, and the distance is the one at which an object so far off the axis is as large (the geometric
        mean of a flat sensor's radial and tangential stretch, 1 / cos^1.5). Perspective is that of the real
        distance, so pixels agree to first order only.
        """
        own = (camera.focal_px, camera.principal_px)
        sight = np.append(np.subtract(pose.principal_px, camera.principal_px) / camera.focal_px, 1.0)
        cosine = 1.0 / np.linalg.norm(sight)
        distance = pose.t_z * camera.focal_px / (pose.focal_px * cosine**1.5)
        R_cv_from_s = egocentric_rotation(pose.rotation.to_matrix(), pose.principal_px, *own)
        return cls(R_cv_from_s, distance * cosine * sight, camera, diagonal_m)

    def to_4dof(self, t_z: float = T_Z) -> Pose4Dof:
        """Angles relative to the line of sight and the focal length at ``t_z`` diagonals."""
        own = (self.camera.focal_px, self.camera.principal_px)
        distance = float(np.linalg.norm(self.t_cv))
        cosine = float(self.t_cv[2]) / distance
        x, y = own[1] + own[0] * self.t_cv[:2] / self.t_cv[2]
        principal = (float(x), float(y))
        focal = t_z * own[0] / (distance * cosine**1.5)
        rotation = Rotation.from_matrix(allocentric_rotation(self.R_cv_from_s, principal, *own))
        return Pose4Dof(rotation, focal, principal, t_z)

    def to_T_cam_obj(self, *, metric: bool = False) -> FloatArray:
        """(4, 4) transform, object to camera, in model diagonals or in metres.

        With ``metric`` object points are in metres too: multiply the normalised model by ``diagonal_m``.

        Raises:
            ValueError: metres are asked for and the model's size is unknown.
        """
        if metric and self.diagonal_m is None:
            raise ValueError("the CAD model's size is unknown, so its distance in metres is too")
        T_cam_obj = np.eye(4)
        T_cam_obj[:3, :3] = self.R_cv_from_s
        T_cam_obj[:3, 3] = self.t_cv * (self.diagonal_m if metric and self.diagonal_m is not None else 1.0)
        return T_cam_obj

    def to_cameras(self, width: int, height: int) -> Cameras:
        """One camera for a photo of that size."""
        return Cameras(
            R_cv_from_s=self.R_cv_from_s[None],
            t_cv=self.t_cv[None],
            focal_px=np.array([self.camera.focal_px]),
            principal_px=np.array([self.camera.principal_px]),
            width=width,
            height=height,
        )

    def project(self, points_s: FloatArray) -> FloatArray:
        """(P, 3) object points in diagonals to (P, 2) continuous pixels of the photo."""
        return np.asarray(self.to_cameras(1, 1).project(points_s)[0])
