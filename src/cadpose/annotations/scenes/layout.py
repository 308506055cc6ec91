"""Where camera, models and backdrop of a photo's scene stand.

A scene has one camera, with focal length F and principal point C. Every object was placed for a camera of its
own, f and O: the annotation's virtual camera, or the one that took the photo. The affine map of camera space

    x' = k (x + (O_x - C_x) / f · z),    y' = k (y + (O_y - C_y) / f · z),    z' = k F / f · z

takes what the object's camera sees to the same pixels of the scene's, for any k > 0: F x'/z' + C_x =
f x/z + O_x. It leans the model along the line of sight and stretches it by F / f in depth. With F = f and
C = O it does nothing, so the scene of one object is leant only, and not even that where C may be chosen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cadpose.errors import InputError
from cadpose.geometry.frames import FloatArray, R_gl_from_cv
from cadpose.poses import PhotoCamera, Pose6Dof
from cadpose.records import Annotation, Photo

#: ``overlay``: every model on the pixels of its annotation, leant and stretched as that takes.
#: ``rigid``: every model as it is, in the camera that took the photo; pixels then agree to first order.
Placement = Literal["overlay", "rigid"]
#: 35 mm equivalent of the lens where nothing tells it and it is needed.
ASSUMED_35MM = 35.0
# Half a diagonal is the farthest that a vertex lies from the model's origin.
_REACH = 0.5


@dataclass(frozen=True, slots=True)
class SceneCamera:
    """The one camera of a scene; it stands at the origin and looks along -z, y up.

    Attributes:
        focal_px: Focal length in pixels of the photo.
        principal_px: (x, y) in continuous pixels of the photo; its middle unless asked otherwise.
        width: The photo's width in pixels; the frame is the photo.
        height: Its height.
        near: Depth of the near plane, in scene units.
        far: Depth of the far plane, behind the backdrop.
    """

    focal_px: float
    principal_px: tuple[float, float]
    width: int
    height: int
    near: float
    far: float

    def project(self, points: FloatArray) -> FloatArray:
        """(P, 3) points of the scene to (P, 2) continuous pixels of the photo."""
        x, y, z = (np.asarray(points, np.float64) * (1.0, -1.0, -1.0)).T
        return np.asarray(self.focal_px * np.stack([x, y], axis=1) / z[:, None] + self.principal_px)


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """One annotated object in the scene.

    Attributes:
        annotation: What was annotated.
        number: Its place in the document, from 0.
        T_scene_from_s: (4, 4) affine, from the model's axes (unit diagonal, y up, front -z) to the scene.
        unit: Length of the model's diagonal in scene units, in the directions across the line of sight.
    """

    annotation: Annotation
    number: int
    T_scene_from_s: FloatArray
    unit: float

    @property
    def stretch(self) -> tuple[float, float, float]:
        """The lengths into which the model's unit goes, in diagonals, smallest first; 1, 1, 1 is rigid."""
        a, b, c = sorted(np.linalg.svd(self.T_scene_from_s[:3, :3], compute_uv=False) / self.unit)
        return float(a), float(b), float(c)


@dataclass(frozen=True, eq=False)
class Layout:
    """A photo's scene, in metres where the sizes of the CAD models are known (`diagonal_metres`).

    Attributes:
        camera: The camera.
        models: One for every annotation, in the document's order.
        backdrop: (4, 3) corners of the photo behind all models: bottom left, bottom right, top right,
            top left as the camera sees them.
    """

    camera: SceneCamera
    models: tuple[PlacedModel, ...]
    backdrop: FloatArray


def diagonal_metres(annotation: Annotation) -> float | None:
    """The length of a model's bounding-box diagonal, None where its size is unknown."""
    if annotation.pose_6dof is not None and annotation.pose_6dof.diagonal_m is not None:
        return annotation.pose_6dof.diagonal_m
    if annotation.cad.size_cm is None:
        return None
    length = math.hypot(*annotation.cad.size_cm) / 100.0
    return length if math.isfinite(length) and length > 0 else None


def photo_camera(photo: Photo, annotations: Sequence[Annotation]) -> PhotoCamera:
    """The camera that took the photo: as the annotations know it, by EXIF, or of `ASSUMED_35MM`."""
    for annotation in annotations:
        if annotation.pose_6dof is not None:
            return annotation.pose_6dof.camera
    return PhotoCamera.from_35mm(photo.focal_35mm or ASSUMED_35MM, photo.width, photo.height)


def lay_out(
    annotations: Sequence[Annotation],
    photo: Photo,
    *,
    placement: Placement = "overlay",
    centred: bool = True,
) -> Layout:
    """Place camera, backdrop and every annotation's model.

    Args:
        annotations: Those of the photo.
        photo: The photo; its size and what EXIF says of the lens count.
        placement: What the models keep: their pixels, or their shape.
        centred: Keep the camera's principal point in the middle of the photo, as glTF demands; otherwise
            it is the mean of the objects' own, so that one object alone keeps its shape in any case.

    Raises:
        InputError: a focal length or a size is so large or small that there is no finite place for it.
    """
    camera = photo_camera(photo, annotations)
    seen = [_seen(annotation, camera, placement) for annotation in annotations]
    # The mean of logarithms makes the stretches F / f as small as they can be together.
    focal = float(np.exp(np.mean([np.log(one.focal_px) for one in seen]))) if seen else camera.focal_px
    x, y = photo.width / 2.0, photo.height / 2.0
    if seen and not centred:
        x, y = np.mean([one.principal_px for one in seen], axis=0)
    principal = (float(x), float(y))
    models = []
    near, far = math.inf, 0.0
    for number, (annotation, one) in enumerate(zip(annotations, seen, strict=True)):
        unit = diagonal_metres(annotation) or 1.0
        models.append(PlacedModel(annotation, number, _same_pixels(one, focal, principal, unit), unit))
        depth = unit * focal / one.focal_px
        middle = float(one.t_cv[2])
        # A model may reach behind the camera; what is nearer than a fiftieth of its distance is cut off.
        near = min(near, depth * max(middle - _REACH, middle / 50.0))
        far = max(far, depth * (middle + _REACH))
    if not models:
        near, far = 0.5, 1.0
    distance = 1.05 * far
    if not np.isfinite([near, distance, *(value for m in models for value in m.T_scene_from_s.flat)]).all():
        raise InputError(
            f"a focal length or a size in {photo.name} is out of range: the scene has no finite place for it"
        )
    placed = SceneCamera(focal, principal, photo.width, photo.height, near=0.5 * near, far=2.0 * distance)
    return Layout(placed, tuple(models), _backdrop(placed, distance))


@dataclass(frozen=True, eq=False)
class _Seen:
    """A model before the camera that it was placed for; lengths in diagonals."""

    R_cv_from_s: FloatArray
    t_cv: FloatArray
    focal_px: float
    principal_px: tuple[float, float]


def _seen(annotation: Annotation, camera: PhotoCamera, placement: Placement) -> _Seen:
    pose = annotation.pose
    if placement == "overlay":
        t_cv = np.array([0.0, 0.0, pose.t_z])
        return _Seen(pose.rotation.to_matrix(), t_cv, pose.focal_px, pose.principal_px)
    whole = annotation.pose_6dof or Pose6Dof.from_4dof(pose, camera)
    return _Seen(whole.R_cv_from_s, whole.t_cv, whole.camera.focal_px, whole.camera.principal_px)


def _same_pixels(one: _Seen, focal: float, principal: tuple[float, float], k: float) -> FloatArray:
    """(4, 4) from the model's axes to the scene: see the module's docstring."""
    f, (ox, oy) = one.focal_px, one.principal_px
    A = k * np.array([[1, 0, (ox - principal[0]) / f], [0, 1, (oy - principal[1]) / f], [0, 0, focal / f]])
    T = np.eye(4)
    with np.errstate(all="ignore"):  # what is not finite is refused by the caller
        T[:3, :3] = R_gl_from_cv @ A @ one.R_cv_from_s
        T[:3, 3] = R_gl_from_cv @ A @ one.t_cv
    return T


def _backdrop(camera: SceneCamera, distance: float) -> FloatArray:
    x0, y0 = (-value * distance / camera.focal_px for value in camera.principal_px)
    x1 = x0 + camera.width * distance / camera.focal_px
    y1 = y0 + camera.height * distance / camera.focal_px
    corners = [(x0, -y1), (x1, -y1), (x1, -y0), (x0, -y0)]
    return np.array([(x, y, -distance) for x, y in corners], np.float64)


def turns_and_scales(T: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """An affine map's linear part as turn · scale · turn, for formats whose nodes know nothing else.

    Args:
        T: (4, 4) or (3, 3), of positive determinant.

    Returns:
        (3, 3) outer rotation, (3,) scales, (3, 3) inner rotation; their product is the linear part.

    Raises:
        ValueError: the determinant is not positive.
    """
    linear = np.asarray(T, np.float64)[:3, :3]
    if not np.linalg.det(linear) > 0:
        raise ValueError("only a map that keeps left and right apart has turns and scales")
    outer, scales, inner = np.linalg.svd(linear)
    if np.ptp(scales) < 1e-9 * scales[0]:
        # A rigid map is one turn; the singular vectors of equal scales are arbitrary.
        return outer @ inner, scales, np.eye(3)
    if np.linalg.det(outer) < 0:
        outer, inner = -outer, -inner
    return outer, scales, inner
