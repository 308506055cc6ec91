"""COCO's object-detection JSON with a folder of photos: COCO itself, and what labelling tools export."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from cadpose.datasets.files import inside, read_json
from cadpose.datasets.scenes import Scene, SceneSet, TrueObject, library_word
from cadpose.detection.coco_parts import (
    CocoAnnotation,
    CocoCategory,
    CocoImage,
    CocoModel,
    CocoRuns,
    segmentation_mask,
)
from cadpose.detection.faults import first_fault
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Mask, Photo

#: Most photos and annotations of one file.
MAX_PHOTOS, MAX_ANNOTATIONS = 200_000, 2_000_000


class _Annotation(CocoAnnotation):
    area: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None


class _File(CocoModel):
    images: Annotated[list[CocoImage], Field(max_length=MAX_PHOTOS)]
    categories: Annotated[list[CocoCategory], Field(min_length=1)]
    annotations: Annotated[list[_Annotation], Field(max_length=MAX_ANNOTATIONS)]


def coco_scenes(path: Path, images: Path | None = None, content: Any = None) -> SceneSet:
    """A file in COCO's JSON; boxes without a pixel are left out.

    Args:
        path: The file.
        images: Folder that its ``file_name`` are relative to; that of the file unless told.
        content: What the file holds, where it was read before.

    Raises:
        InputError: the file cannot be used, names a photo outside the folder, or one that is not there.
    """
    try:
        file = _File.model_validate(read_json(path) if content is None else content)
    except ValidationError as error:
        raise InputError(f"{path}: is no label file in COCO's JSON ({first_fault(error)})") from None
    folder = path.parent if images is None else images
    names = {category.id: library_word(category.name) for category in file.categories}
    by_image: dict[int, list[tuple[int, _Annotation]]] = {image.id: [] for image in file.images}
    if len(by_image) < len(file.images):
        raise InputError(f"{path}: two images have the same id")
    for i, annotation in enumerate(file.annotations):
        if annotation.category_id not in names or annotation.image_id not in by_image:
            raise InputError(
                f"{path}: annotation {i} names a category or an image that the file does not have"
            )
        by_image[annotation.image_id].append((i, annotation))
    scenes = [
        Scene(
            inside(folder, image.file_name, path), partial(_objects, path, image, by_image[image.id], names)
        )
        for image in file.images
    ]
    if scenes and not any(scene.photo.is_file() for scene in scenes[:100]):
        raise InputError(
            f"{path}: its photos, such as {scenes[0].photo.name}, are not in {folder}: "
            "name their folder with --images"
        )
    return SceneSet("coco", f"{path.resolve().parent.name}/{path.name}", scenes, frozenset(names.values()))


def _objects(
    path: Path, image: CocoImage, own: Sequence[tuple[int, _Annotation]], names: dict[int, str], photo: Photo
) -> list[TrueObject]:
    told = (image.width or photo.width, image.height or photo.height)
    if told != (photo.width, photo.height):
        raise InputError(
            f"{photo.name} has {photo.width} x {photo.height} pixels upright, but {path.name} says "
            f"{told[0]} x {told[1]}: label the photo as it is seen"
        )
    found = []
    for i, annotation in own:
        x, y, width, height = annotation.bbox
        # COCO's own files hold a few boxes without width or height.
        box = Box.from_xywh(x, y, width, height).clipped(*told) if width > 0 and height > 0 else None
        if box is None:
            continue
        outline = annotation.segmentation
        found.append(
            TrueObject(
                box=box,
                category=names[annotation.category_id],
                area=annotation.area or box.area,
                crowd=annotation.iscrowd != 0,
                mask=partial(_mask, f"{path}: annotation {i}", outline) if outline else None,
            )
        )
    return found


def _mask(where: str, outline: list[list[float]] | CocoRuns, photo: Photo) -> Mask:
    try:
        return segmentation_mask(outline, photo)
    except ValueError as error:
        raise InputError(f"{where} has a segmentation that cannot be decoded ({error})") from None
