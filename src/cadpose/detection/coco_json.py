"""Detections from a file in COCO's JSON instead of a detector.

The file holds ``images``, ``categories`` and ``annotations`` as COCO defines them; ``bbox`` is
[x, y, width, height]; ``segmentation`` may be polygons, or runs as numbers or text. Beside COCO's own keys
an annotation may tell ``score``, and ``azimuth``, ``elevation`` and ``inplane`` in degrees. Images are
found by file name; crowds (``iscrowd`` 1) are left out.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path, PurePosixPath
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cadpose.detection.polygons import mask_from_polygons
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_name
from cadpose.records import Detection, Mask, Photo, Rotation
from cadpose.rle import decode_mask, runs_from_text

#: Largest detections file that is read.
MAX_BYTES = 128 * 2**20

_Number = Annotated[float, Field(allow_inf_nan=False)]
_Side = Annotated[int, Field(ge=1, le=1_000_000)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class _Image(_Model):
    id: int
    file_name: Annotated[str, Field(min_length=1, max_length=4096)]
    width: _Side | None = None
    height: _Side | None = None


class _Category(_Model):
    id: int
    name: Annotated[str, Field(min_length=1, max_length=200)]


class _Runs(_Model):
    size: tuple[_Side, _Side]
    counts: list[int] | str


class _Annotation(_Model):
    image_id: int
    category_id: int
    bbox: tuple[_Number, _Number, _Number, _Number]
    score: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    segmentation: list[list[_Number]] | _Runs | None = None
    iscrowd: int = 0
    azimuth: _Number | None = None
    elevation: Annotated[float, Field(ge=-90.0, le=90.0)] | None = None
    inplane: _Number | None = None


class _File(_Model):
    images: list[_Image]
    categories: list[_Category]
    annotations: list[_Annotation]


class FileDetector:
    """Detections read from a COCO JSON file; a detector like any other.

    Args:
        path: The file.
        categories: Library categories to keep; None keeps all.

    Raises:
        InputError: the file is missing, too large, not JSON, or does not hold what COCO's files hold.
    """

    name = "file"

    def __init__(self, path: Path | str, categories: Collection[str] | None = None) -> None:
        self.path = Path(path)
        self.categories = None if categories is None else frozenset(categories)
        content = _parsed(self.path)
        self._names = {c.id: category_from_name(c.name) or c.name.strip().lower() for c in content.categories}
        self._images: dict[str, list[_Image]] = {}
        for image in content.images:
            self._images.setdefault(_parts(image.file_name)[-1], []).append(image)
        self._annotations: dict[int, list[tuple[int, _Annotation]]] = {}
        for i, annotation in enumerate(content.annotations):
            if annotation.category_id not in self._names:
                raise self._error(i, f"has the category_id {annotation.category_id}, which no category has")
            if not self._names[annotation.category_id]:
                raise self._error(i, "has a category without a name")
            self._annotations.setdefault(annotation.image_id, []).append((i, annotation))

    def detect(self, photo: Photo) -> list[Detection]:
        """What the file says of the photo of that file name, best first; empty where it says nothing.

        Raises:
            InputError: an annotation does not fit the photo.
        """
        image = self._image(photo)
        if image is None:
            return []
        told = (image.width or photo.width, image.height or photo.height)
        if told != (photo.width, photo.height):
            raise InputError(
                f"{self.path} says that {image.file_name} has {told[0]} x {told[1]} pixels but it has "
                f"{photo.width} x {photo.height} upright: make the boxes on the photo as it is seen."
            )
        found = [
            self._detection(i, annotation, photo)
            for i, annotation in self._annotations.get(image.id, ())
            if not annotation.iscrowd
            and (self.categories is None or self._names[annotation.category_id] in self.categories)
        ]
        return sorted(found, key=lambda d: -d.score)

    def _image(self, photo: Photo) -> _Image | None:
        """The entry whose path agrees with the photo's the furthest, from the file name upwards."""
        parts = _parts(photo.name)
        entries = self._images.get(parts[-1], []) if parts else []
        agreement = [_common_tail(parts, _parts(e.file_name)) for e in entries]
        best = [e for e, a in zip(entries, agreement, strict=True) if a == max(agreement)]
        if len(best) > 1:
            raise InputError(f"{self.path} has several images {parts[-1]}: give their folders in file_name.")
        return best[0] if best else None

    def _detection(self, i: int, annotation: _Annotation, photo: Photo) -> Detection:
        try:
            box = Box.from_xywh(*annotation.bbox).clipped(photo.width, photo.height)
        except ValueError:
            raise self._error(i, f"has an empty bbox {list(annotation.bbox)}") from None
        if box is None:
            raise self._error(i, f"has a bbox {list(annotation.bbox)} outside its photo")
        rotation = None
        if annotation.azimuth is not None or annotation.elevation is not None:
            if annotation.azimuth is None or annotation.elevation is None:
                raise self._error(i, "tells one of azimuth and elevation without the other")
            rotation = Rotation(annotation.azimuth, annotation.elevation, annotation.inplane or 0.0)
        try:
            mask = _mask(annotation.segmentation, photo)
        except ValueError as error:
            raise self._error(i, f"has an unusable segmentation ({error})") from None
        return Detection(
            box=box,
            category=self._names[annotation.category_id],
            score=annotation.score,
            mask=mask,
            source="file",
            rotation=rotation,
        )

    def _error(self, i: int, what: str) -> InputError:
        return InputError(f"{self.path}: annotation {i} {what}.")


def _parsed(path: Path) -> _File:
    """The file's content, checked; InputError in one sentence otherwise."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path} is larger than the limit of {MAX_BYTES // 2**20} MB: split it.")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(
            f"{path} cannot be read ({reason}): name a detections file in COCO's JSON."
        ) from None
    try:
        return _File.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        where = ".".join(str(piece) for piece in first["loc"])
        raise InputError(
            f"{path} is not a detections file in COCO's JSON: {where + ': ' if where else ''}{first['msg']}."
        ) from None


def _mask(segmentation: list[list[float]] | _Runs | None, photo: Photo) -> Mask | None:
    """(H, W) mask of the photo's size, None where nothing is told."""
    if not segmentation:
        return None
    if isinstance(segmentation, _Runs):
        if segmentation.size != (photo.height, photo.width):
            raise ValueError(f"its size is {segmentation.size}, its photo's {(photo.height, photo.width)}")
        counts = segmentation.counts
        runs = runs_from_text(counts) if isinstance(counts, str) else counts
        mask = decode_mask((photo.height, photo.width), runs)
    else:
        mask = mask_from_polygons(photo.height, photo.width, segmentation)
    if not mask.any():
        raise ValueError("it covers no pixel")
    return mask


def _parts(name: str) -> tuple[str, ...]:
    """Path pieces without dots and roots; separators of either kind."""
    pieces = PurePosixPath(name.replace("\\", "/")).parts
    return tuple(p for p in pieces if p not in ("/", ".", "..")) or (name,)


def _common_tail(a: tuple[str, ...], b: tuple[str, ...]) -> int:
    """Number of equal pieces from the end."""
    count = 0
    for x, y in zip(reversed(a), reversed(b), strict=False):
        if x != y:
            break
        count += 1
    return count
