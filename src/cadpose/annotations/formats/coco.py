"""COCO's object-detection JSON: boxes, masks as compressed run lengths, and the pose in keys of ours.

An entry of ``annotations`` is COCO's, with the keys of our document beside: ``pose``, ``cad``,
``candidates`` ... ``id``, ``image_id`` and ``category_id`` count from 1. Annotations of one image stand
together, so that both writing and reading hold one photo at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.extras import (
    Native,
    annotation_from,
    document_from_parts,
    extras_of,
    located,
    photo_extras,
    photo_size,
    told_error,
)
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.json_stream import JsonArrays, iter_json
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import portable_name
from cadpose.annotations.parts import MaskPart
from cadpose.detection.coco_parts import CocoAnnotation, CocoRuns
from cadpose.detection.polygons import mask_from_polygons
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.rle import encode_mask, runs_from_text, text_from_runs

_WHAT = "a COCO file of `cadpose export coco`"


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Write one JSON file."""
    categories: dict[str, int] = {}
    with JsonArrays(out, ["images", "annotations"]) as file:
        file.more["info"] = {"description": "4-DoF annotations of cadpose", "version": "1"}
        number = 0
        for image, document in enumerate(documents, start=1):
            width, height = document.photo.size
            file.add(
                "images",
                {
                    "id": image,
                    "file_name": portable_name(document.photo.name),
                    "width": width,
                    "height": height,
                    "cadpose": photo_extras(document),
                },
            )
            for part in document.annotations:
                number += 1
                category = categories.setdefault(part.detection.category, len(categories) + 1)
                file.add("annotations", _entry(part, number, image, category))
        file.more["categories"] = [{"id": i, "name": name} for name, i in categories.items()]


def _entry(part: AnnotationPart, number: int, image: int, category: int) -> dict[str, Any]:
    found, box = part.detection, Box(*part.detection.box)
    told: dict[str, Any] = {
        "id": number,
        "image_id": image,
        "category_id": category,
        "bbox": list(box.to_xywh()),
        "area": box.area if found.mask is None else sum(found.mask.counts[1::2]),
        "iscrowd": 0,
        "score": found.score,
    }
    if found.mask is not None:
        told["segmentation"] = {"size": list(found.mask.size), "counts": text_from_runs(found.mask.counts)}
    return told | extras_of(part)


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a file: boxes, masks and categories as COCO's own keys tell them.

    Raises:
        InputError: the file is not one that `write` wrote, or the annotations of an image do not stand
            together.
    """
    images: dict[int, Any] = {}
    categories: dict[int, str] = {}
    for key, value in iter_json(path, _WHAT):
        if key in ("images", "categories"):
            if not isinstance(value, dict) or not isinstance(value.get("id"), int):
                raise InputError(f"{path} is not {_WHAT}: an entry of its {key} has no id")
            if key == "images":
                images[value["id"]] = value.get("cadpose")
            else:
                categories[value["id"]] = str(value.get("name") or "")
    told: set[int] = set()
    for image, entries in groupby(_annotations(path), key=lambda entry: entry[1].image_id):
        if image not in images:
            raise InputError(f"{path}: an annotation is of image {image}, which the file does not list")
        if image in told:
            raise InputError(f"{path}: the annotations of image {image} are scattered, sort them by image_id")
        told.add(image)
        photo = images[image]
        where = located(path, "image", image)
        parts = [_part(path, number, entry, raw, categories, photo) for number, entry, raw in entries]
        yield document_from_parts(photo, parts, where)
    for image, photo in images.items():
        if image not in told:
            yield document_from_parts(photo, [], located(path, "image", image))


_ENTRY = TypeAdapter(CocoAnnotation)


def _annotations(path: Path) -> Iterator[tuple[int, CocoAnnotation, Any]]:
    number = 0
    for key, raw in iter_json(path, _WHAT):
        if key == "annotations":
            number += 1
            try:
                yield number, _ENTRY.validate_python(raw), raw
            except ValidationError as error:
                raise InputError(f"{located(path, 'annotation', number)}: {told_error(error)}") from None


def _part(
    path: Path, number: int, entry: CocoAnnotation, raw: Any, categories: dict[int, str], photo: Any
) -> AnnotationPart:
    where = located(path, "annotation", number)
    x, y, width, height = entry.bbox
    try:
        mask = _mask(entry.segmentation, photo, where)
    except (ValueError, TypeError) as error:
        raise InputError(f"{where} has an unusable segmentation ({told_error(error)})") from None
    native = Native(
        box=(x, y, x + width, y + height),
        category=categories.get(entry.category_id),
        mask=mask,
        has_mask=True,
    )
    return annotation_from(raw, native, where)


def _mask(segmentation: list[list[float]] | CocoRuns | None, photo: Any, where: str) -> MaskPart | None:
    """A segmentation as run lengths; polygons, which other tools write, are drawn first."""
    if not segmentation:
        return None
    if isinstance(segmentation, CocoRuns):
        counts = segmentation.counts
        return MaskPart(
            size=segmentation.size, counts=runs_from_text(counts) if isinstance(counts, str) else counts
        )
    width, height = photo_size(photo, where)
    mask = mask_from_polygons(height, width, segmentation)
    return MaskPart(size=(height, width), counts=encode_mask(mask))


COCO = Format("coco", "COCO's object-detection JSON, one file", False, write, read)
