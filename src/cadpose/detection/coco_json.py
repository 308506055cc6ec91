"""Detections from a file in COCO's JSON instead of a detector.

The file holds ``images``, ``categories`` and ``annotations`` as COCO defines them; ``bbox`` is
[x, y, width, height]; ``segmentation`` may be polygons, or runs as numbers or text. Beside COCO's own keys
an annotation may tell ``score``, and ``azimuth``, ``elevation`` and ``inplane`` in degrees. Images are
found by file name. Crowds (``iscrowd`` 1) are left out, objects that cover no pixel, and people,
animals and food unless asked for.
:mod:`cadpose.detection.coco_writing` writes what this reads, with ``unsure`` and ``alternatives`` as well.
"""

from __future__ import annotations

import logging
from codecs import BOM_UTF8
from collections.abc import Collection
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from cadpose.detection.coco_parts import (
    CocoAnnotation,
    CocoCategory,
    CocoImage,
    CocoModel,
    CocoRuns,
    Number,
    segmentation_mask,
)
from cadpose.detection.faults import first_fault
from cadpose.detection.photo_names import PhotoIndex
from cadpose.detection.reading import check_room, is_wanted, read_capped
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_or_word
from cadpose.records import Detection, Mask, Photo, Rotation

log = logging.getLogger(__name__)

#: Largest detections file that is read.
MAX_BYTES = 128 * 2**20


class _Alternative(CocoModel):
    category: Annotated[str, Field(min_length=1, max_length=200)]
    score: Number


class _Annotation(CocoAnnotation):
    score: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    azimuth: Number | None = None
    elevation: Annotated[float, Field(ge=-90.0, le=90.0)] | None = None
    inplane: Number | None = None
    unsure: bool = False
    alternatives: tuple[_Alternative, ...] = ()


class _File(CocoModel):
    images: list[CocoImage]
    categories: list[CocoCategory]
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
        self._names = {c.id: category_or_word(c.name) for c in content.categories}
        self._images: PhotoIndex[CocoImage] = PhotoIndex(self.path, "give their folders in file_name")
        for image in content.images:
            self._images.add(image.file_name, image)
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
        image = self._images.find(photo.name)
        if image is None:
            return []
        size = (image.width or photo.width, image.height or photo.height)
        if size != (photo.width, photo.height):
            raise InputError(
                f"{self.path} says that {image.file_name} has {size[0]} x {size[1]} pixels but it has "
                f"{photo.width} x {photo.height} upright: make the boxes on the photo as it is seen."
            )
        wanted = [
            (i, annotation)
            for i, annotation in self._annotations.get(image.id, ())
            if not annotation.iscrowd and is_wanted(self._names[annotation.category_id], self.categories)
        ]
        check_room(self.path, sum(annotation.segmentation is not None for _, annotation in wanted), photo)
        told = [self._detection(i, annotation, photo) for i, annotation in wanted]
        return sorted((d for d in told if d is not None), key=lambda d: -d.score)

    def knows(self, photo_name: str) -> bool:
        """Whether the file has an image of that file name."""
        return self._images.has(photo_name)

    def _detection(self, i: int, annotation: _Annotation, photo: Photo) -> Detection | None:
        """None where it covers no pixel; COCO's own files have such."""
        try:
            box = Box.from_xywh(*annotation.bbox).clipped(photo.width, photo.height)
        except ValueError:
            self._leave_out(i, f"an empty bbox {list(annotation.bbox)}")
            return None
        if box is None:
            self._leave_out(i, f"a bbox {list(annotation.bbox)} outside its photo")
            return None
        rotation = None
        if annotation.azimuth is not None or annotation.elevation is not None:
            if annotation.azimuth is None or annotation.elevation is None:
                raise self._error(i, "tells one of azimuth and elevation without the other")
            rotation = Rotation(annotation.azimuth, annotation.elevation, annotation.inplane or 0.0)
        try:
            mask = _mask(annotation.segmentation, photo)
        except ValueError as error:
            raise self._error(i, f"has an unusable segmentation ({error})") from None
        if mask is not None and not mask.any():
            self._leave_out(i, "a segmentation that covers no pixel")
            return None
        return Detection(
            box=box,
            category=self._names[annotation.category_id],
            score=annotation.score,
            mask=mask,
            source="file",
            rotation=rotation,
            alternatives=tuple((other.category, other.score) for other in annotation.alternatives),
            unsure=annotation.unsure,
        )

    def _leave_out(self, i: int, what: str) -> None:
        log.warning("%s: annotation %d has %s and is left out", self.path, i, what)

    def _error(self, i: int, what: str) -> InputError:
        return InputError(f"{self.path}: annotation {i} {what}.")


def _parsed(path: Path) -> _File:
    """The file's content, checked; InputError in one sentence otherwise."""
    data = read_capped(path, MAX_BYTES, "a detections file in COCO's JSON")
    try:
        return _File.model_validate_json(data.removeprefix(BOM_UTF8))
    except ValidationError as error:
        raise InputError(f"{path} is not a detections file in COCO's JSON: {first_fault(error)}.") from None


def _mask(segmentation: list[list[float]] | CocoRuns | None, photo: Photo) -> Mask | None:
    """(H, W) mask of the photo's size, None where nothing is told."""
    if not segmentation:
        return None
    return segmentation_mask(segmentation, photo)
