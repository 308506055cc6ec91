"""The JSON of the page's API, part by part: what is answered is checked against it, and so is what comes.

Unknown keys and numbers that are not finite are refused both ways.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from cadpose.annotations.store import Region
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import CadModel, Mask
from cadpose.rle import decode_mask, encode_mask, runs_from_text, text_from_runs

#: Digests by which annotations, photos and meshes are named; nothing else reaches the store or the disk.
DIGEST = r"^[0-9a-f]{64}$"
#: Furthest that a pose may put its model, and its largest focal length, in sides of the photo.
FARTHEST = 100.0
#: Smallest focal length, in pixels.
NEAREST_PX = 0.1

Digest = Annotated[str, Field(pattern=DIGEST)]
Short = Annotated[str, Field(max_length=200)]
Long = Annotated[str, Field(max_length=10_000)]
BoxShape = tuple[float, float, float, float]


class Shape(BaseModel):
    """Base of every message."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RotationShape(Shape):
    """Three angles in degrees."""

    azimuth: float
    elevation: Annotated[float, Field(ge=-90.0, le=90.0)]
    inplane: float

    @classmethod
    def of(cls, rotation: Rotation) -> Self:
        """From the record."""
        return cls(azimuth=rotation.azimuth, elevation=rotation.elevation, inplane=rotation.inplane)


class PoseShape(Shape):
    """The four degrees of freedom and where they apply: degrees, pixels of the photo."""

    azimuth: float
    elevation: Annotated[float, Field(ge=-90.0, le=90.0)]
    inplane: float
    focal_px: Annotated[float, Field(gt=0.0)]
    principal_px: tuple[float, float]
    t_z: Annotated[float, Field(gt=0.0)]

    @classmethod
    def of(cls, pose: Pose4Dof) -> Self:
        """From the record."""
        r, (x, y) = pose.rotation, pose.principal_px
        return cls(
            azimuth=r.azimuth,
            elevation=r.elevation,
            inplane=r.inplane,
            focal_px=float(pose.focal_px),
            principal_px=(float(x), float(y)),
            t_z=float(pose.t_z),
        )

    def pose(self, photo_size: tuple[int, int]) -> Pose4Dof:
        """The record, for a photo of (width, height).

        Raises:
            InputError: the record refuses a number, or the model would be nowhere near the photo.
        """
        side = float(max(photo_size))
        if self.focal_px < NEAREST_PX:
            raise InputError(f"a focal length of {self.focal_px:g} px makes the model vanish")
        if self.focal_px > FARTHEST * side or max(map(abs, self.principal_px)) > FARTHEST * side:
            raise InputError("the pose puts the model far outside the photo: bring it back")
        if not 0.51 < self.t_z < 1e3:
            raise InputError(f"the distance t_z {self.t_z:g} is not between 0.51 and 1000 diagonals")
        try:
            rotation = Rotation(self.azimuth, self.elevation, self.inplane)
            return Pose4Dof(rotation, self.focal_px, self.principal_px, self.t_z)
        except ValueError as error:
            raise InputError(f"this is no pose: {error}") from None


class RleShape(Shape):
    """COCO's compressed run-length mask: [height, width] and text."""

    size: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]
    counts: str

    @classmethod
    def of(cls, mask: Mask) -> Self:
        """From a (H, W) bool mask."""
        return cls(size=(mask.shape[0], mask.shape[1]), counts=text_from_runs(encode_mask(mask)))

    def mask(self, photo_size: tuple[int, int]) -> Mask:
        """(H, W) bool, of a photo of (width, height).

        Raises:
            InputError: the text is damaged, or the mask has another size.
        """
        if self.size != (photo_size[1], photo_size[0]):
            raise InputError(
                f"the mask of {self.size[1]} x {self.size[0]} pixels does not fit the photo of "
                f"{photo_size[0]} x {photo_size[1]}"
            )
        try:
            return decode_mask(self.size, runs_from_text(self.counts))
        except ValueError as error:
            raise InputError(f"the mask cannot be read: {error}") from None


class RegionShape(Shape):
    """Where the object is: its box in pixels of the photo, and its mask if it has one."""

    box: BoxShape
    mask: RleShape | None

    def region(self, photo_size: tuple[int, int]) -> Region:
        """The record, clipped to a photo of (width, height).

        Raises:
            InputError: the box is empty or outside the photo, or the mask does not fit.
        """
        try:
            box = Box(*self.box).clipped(*photo_size)
        except ValueError as error:
            raise InputError(f"this is no box: {error}") from None
        if box is None:
            raise InputError("the box lies outside the photo")
        mask = None if self.mask is None else self.mask.mask(photo_size)
        try:
            return Region(box, mask)
        except ValueError as error:
            raise InputError(f"this is no region: {error}") from None


class CadShape(Shape):
    """A CAD model; ``key`` names its mesh in URLs, ``available`` says whether the opened library has it."""

    id: str
    key: str
    name: str
    category: str
    licence: str
    creator: str
    source: str
    size_cm: tuple[float, float, float] | None
    available: bool

    @classmethod
    def of(cls, cad: CadModel, available: bool) -> Self:
        """From the record."""
        return cls(
            id=cad.id,
            key=cad.sha256,
            name=cad.name,
            category=cad.category,
            licence=cad.licence,
            creator=cad.creator,
            source=cad.source,
            size_cm=cad.size_cm,
            available=available,
        )


Kind = Literal["conflict", "not_found", "bad_input", "too_large", "busy", "forbidden", "failed"]


class CurrentShape(Shape):
    """What holds of an annotation that changed meanwhile; not ``in_force``: another answer took its place."""

    version: int
    in_force: bool
    verdict: str | None
    by: str


class ErrorShape(Shape):
    """What went wrong, in one sentence."""

    error: str
    kind: Kind
    current: CurrentShape | None = None
