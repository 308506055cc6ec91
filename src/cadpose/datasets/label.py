"""One label: what is true of one object in one photo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cadpose import rle
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import require_rotation
from cadpose.geometry.frames import FloatArray
from cadpose.photos import read_photo
from cadpose.records import Mask, Photo, Rotation

#: By how much a rotation matrix may miss R·Rᵀ = 1: published ones have few digits.
ROTATION_TOLERANCE = 1e-3

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


@dataclass(frozen=True, slots=True)
class RunLengths:
    """A mask as COCO writes it, not yet decoded.

    Attributes:
        size: (height, width) in pixels.
        counts: Runs column by column, background first, as numbers or in COCO's compressed text.
    """

    size: tuple[int, int]
    counts: tuple[int, ...] | str

    def decode(self) -> Mask:
        """(height, width) bool.

        Raises:
            ValueError: the runs do not make a mask of that size, or it is too large.
        """
        runs = rle.runs_from_text(self.counts) if isinstance(self.counts, str) else self.counts
        return rle.decode_mask(self.size, runs)


@dataclass(frozen=True, slots=True)
class Label:
    """What is true of one object in one photo.

    Attributes:
        photo: Path of the photograph.
        category: Library category.
        box: The object's rectangle in pixels, None for the whole photo.
        cad: Library id of the true CAD model, if known.
        azimuth: Degrees, if known. The three angles are those of a camera that looks straight at the
            object, as a detection's rotation is (docs/conventions.md), not those of ``R_cv_from_s``.
        elevation: Degrees, if known.
        inplane: Degrees, if known.
        mask: Path of a picture that is white on the object, or run lengths; see `mask_in_photo`.
        focal_px: Focal length in pixels of the camera that took the photo, if known.
        principal_px: (x, y) its principal point in pixels; known if and only if ``focal_px`` is.
        R_cv_from_s: Rotation of the object in that camera's frame, row by row, if known.
        t_cv: (x, y, z) position of the model file's origin in that camera's frame, in units of the data
            set's model file, if known.
        split: ``"train"``, ``"val"``, ``"test"`` or a word of the data set's own, if it has splits.
        truncated: The photo's border cuts the object off.
        occluded: Something stands before the object.
        difficult: The data set's authors advise not to use it.
        source: The data set, for example ``"pascal3d"``.
        synthetic: The photo was drawn, not taken.
        cad_path: The data set's own file of that model, if it has one.
        cad_axes: Where front and top of that file point, ``("+y", "+z")``; None for ShapeNet's, front -z and
            top +y. ``R_cv_from_s`` is of the model turned to ShapeNet's axes.
        cad_diagonal: Length of its bounding box's diagonal in the file's unit, if told: ``t_cv`` over it is
            in diagonals, the library's unit.

    Raises:
        ValueError: an angle, focal length, matrix or vector is not one.
    """

    photo: Path
    category: str
    box: Box | None = None
    cad: str | None = None
    azimuth: float | None = None
    elevation: float | None = None
    inplane: float | None = None
    mask: Path | RunLengths | None = None
    focal_px: float | None = None
    principal_px: tuple[float, float] | None = None
    R_cv_from_s: Matrix | None = None
    t_cv: Vector | None = None
    split: str | None = None
    truncated: bool = False
    occluded: bool = False
    difficult: bool = False
    source: str | None = None
    synthetic: bool = False
    cad_path: Path | None = None
    cad_axes: tuple[str, str] | None = None
    cad_diagonal: float | None = None

    def __post_init__(self) -> None:
        _ = self.rotation
        if (self.focal_px is None) != (self.principal_px is None):
            raise ValueError("a focal length needs a principal point, and the other way round")
        if self.focal_px is not None and self.principal_px is not None:
            if not np.isfinite((self.focal_px, *self.principal_px)).all():
                raise ValueError("focal length and principal point must be finite")
            if self.focal_px <= 0:
                raise ValueError(f"focal length {self.focal_px} must be above 0")
        if self.R_cv_from_s is not None:
            # Clipped, for huge numbers would overflow into one that compares with nothing.
            require_rotation(np.clip(self.R_cv_from_s, -10.0, 10.0), "R", ROTATION_TOLERANCE)
        if self.cad_diagonal is not None and not 0.0 < self.cad_diagonal < np.inf:
            raise ValueError(f"the model's diagonal {self.cad_diagonal} must be above 0")
        if self.t_cv is not None and not (len(self.t_cv) == 3 and np.isfinite(self.t_cv).all()):
            raise ValueError("t must hold 3 finite numbers")

    @property
    def rotation(self) -> Rotation | None:
        """The whole rotation, None unless azimuth and elevation are both known."""
        if self.azimuth is None or self.elevation is None:
            return None
        return Rotation(self.azimuth, self.elevation, self.inplane or 0.0)

    @property
    def K(self) -> FloatArray | None:
        """(3, 3) calibration matrix of the camera that took the photo, if known."""
        if self.focal_px is None or self.principal_px is None:
            return None
        (x, y), f = self.principal_px, self.focal_px
        return np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])


def object_in_photo(label: Label) -> tuple[Photo, Box]:
    """The decoded photo and the object's box within it.

    Raises:
        InputError: the photo cannot be used, or the box lies outside it.
    """
    photo = read_photo(label.photo)
    whole = Box(0.0, 0.0, float(photo.width), float(photo.height))
    box = (label.box or whole).clipped(photo.width, photo.height)
    if box is None:
        raise InputError(f"{label.photo}: the labelled box lies outside the photo, give pixels of this photo")
    return photo, box


def mask_in_photo(label: Label, photo: Photo) -> Mask | None:
    """(H, W) bool mask of the photo's size, None where the label has none.

    A mask picture counts as the object where its grey level is at least 128.

    Raises:
        InputError: the mask cannot be decoded, is empty, or has another size than the photo.
    """
    if label.mask is None:
        return None
    if isinstance(label.mask, RunLengths):
        try:
            mask = label.mask.decode()
        except ValueError as error:
            raise InputError(f"{label.photo}: its labelled mask cannot be decoded ({error})") from error
        name = f"{label.photo}: its labelled mask"
    else:
        mask = read_photo(label.mask).rgb.mean(axis=2) >= 127.5
        name = str(label.mask)
    if mask.shape != (photo.height, photo.width):
        size = f"{mask.shape[1]} x {mask.shape[0]}"
        raise InputError(f"{name} has {size} pixels, its photo {photo.width} x {photo.height}")
    if not mask.any():
        raise InputError(f"{name} covers no pixel, paint the object white")
    return mask
