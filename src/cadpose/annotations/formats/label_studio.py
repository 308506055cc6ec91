"""Label Studio's tasks: what was found as predictions, for people to correct.

An object is a rectangle, with our keys in its ``meta``; a brush mask whose parent it is; and a choice, its
verdict. Places are percent of the photo's width and height. The tasks that Label Studio exports hold the
corrected regions as annotations, which are then read instead of the predictions.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, get_args
from urllib.parse import quote

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cadpose import __version__
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
from cadpose.annotations.formats.json_stream import JsonEntries, iter_json
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import portable_name
from cadpose.annotations.parts import MaskPart
from cadpose.detection.brush_rle import decode_brush, encode_brush
from cadpose.errors import InputError
from cadpose.records import Verdict
from cadpose.rle import decode_mask, encode_mask

log = logging.getLogger(__name__)

_VERDICTS: tuple[str, ...] = get_args(Verdict)
_WHAT = "a JSON file of Label Studio's tasks"


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Write one JSON file of tasks."""
    with JsonEntries(out) as file:
        for document in documents:
            file.add(_task(document))


def _task(document: AnnotationDocument) -> dict[str, Any]:
    address = "/data/local-files/?d=" + quote(portable_name(document.photo.name))
    scores = [
        part.detection.score if part.confidence is None else part.confidence for part in document.annotations
    ]
    regions = [
        region for i, part in enumerate(document.annotations) for region in _regions(document, part, i)
    ]
    prediction = {
        "model_version": f"cadpose {__version__}",
        "score": float(np.mean(scores)) if scores else 0.0,
        "result": regions,
    }
    return {"data": {"image": address, "cadpose": photo_extras(document)}, "predictions": [prediction]}


def _regions(document: AnnotationDocument, part: AnnotationPart, position: int) -> Iterator[dict[str, Any]]:
    width, height = document.photo.size
    found, pose = part.detection, part.pose
    x0, y0, x1, y1 = found.box
    key = f"{document.photo.sha256[:8]}{position:03d}"
    place = {
        "x": x0 / width * 100.0,
        "y": y0 / height * 100.0,
        "width": (x1 - x0) / width * 100.0,
        "height": (y1 - y0) / height * 100.0,
        "rotation": 0,
    }
    shared = {
        "to_name": "image",
        "original_width": width,
        "original_height": height,
        "image_rotation": 0,
    }
    words = f"{part.cad.name}, azimuth {pose.azimuth:.0f}, elevation {pose.elevation:.0f}"
    yield {
        "id": key,
        "type": "rectanglelabels",
        "from_name": "box",
        **shared,
        "value": place | {"rectanglelabels": [found.category]},
        "score": found.score,
        "meta": {"text": [words], "cadpose": extras_of(part)},
    }
    if found.mask is not None:
        mask = decode_mask(found.mask.size, found.mask.counts)
        yield {
            "id": f"{key}m",
            "parentID": key,
            "type": "brushlabels",
            "from_name": "mask",
            **shared,
            "value": {
                "format": "rle",
                "rle": list(encode_brush(mask)),
                "brushlabels": [found.category],
            },
            "score": found.score,
        }
    if part.verdict is not None:
        yield {
            "id": key,
            "type": "choices",
            "from_name": "verdict",
            **shared,
            "value": place | {"choices": [part.verdict]},
        }


_Percent = Annotated[float, Field(ge=-1000.0, le=1000.0, allow_inf_nan=False)]


class _Rectangle(BaseModel):
    model_config = ConfigDict(extra="ignore")

    x: _Percent
    y: _Percent
    width: Annotated[_Percent, Field(gt=0.0)]
    height: Annotated[_Percent, Field(gt=0.0)]
    rotation: float = 0.0
    rectanglelabels: Annotated[list[str], Field(min_length=1)]


class _Brush(BaseModel):
    model_config = ConfigDict(extra="ignore")

    rle: list[Annotated[int, Field(ge=0, le=255)]]


class _Region(BaseModel):
    model_config = ConfigDict(extra="ignore")

    id: str = ""
    parent: Annotated[str | None, Field(alias="parentID")] = None
    type: str = ""
    value: dict[str, Any] = {}
    meta: dict[str, Any] | None = None


class _Work(BaseModel):
    model_config = ConfigDict(extra="ignore")

    result: list[_Region] = []
    was_cancelled: bool | None = None
    ground_truth: bool | None = None


class _Task(BaseModel):
    model_config = ConfigDict(extra="ignore")

    data: dict[str, Any]
    annotations: list[_Work] | None = None
    predictions: list[_Work | int] | None = None

    def answer(self) -> _Work | None:
        """The annotation marked as ground truth, else the first not skipped, else the first prediction."""
        done = [work for work in self.annotations or () if not work.was_cancelled]
        guesses = [work for work in self.predictions or () if isinstance(work, _Work)]
        return next(iter([*(work for work in done if work.ground_truth), *done, *guesses]), None)


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such tasks: rectangles, masks, labels and verdicts as the regions tell them.

    A region that a person added has no pose and is left out; the log says so.

    Raises:
        InputError: the file does not hold tasks that `write` wrote.
    """
    for number, (key, raw) in enumerate(iter_json(path, _WHAT), start=1):
        where = located(path, "task", number)
        if key:
            raise InputError(f"{path} is not {_WHAT}: export it as JSON")
        try:
            task = _Task.model_validate(raw)
        except ValidationError as error:
            raise InputError(f"{where}: {told_error(error)}") from None
        work = task.answer()
        yield document_from_parts(
            task.data.get("cadpose"), [] if work is None else _parts(work, task.data, where), where
        )


def _parts(work: _Work, data: dict[str, Any], where: str) -> list[AnnotationPart]:
    size = photo_size(data.get("cadpose"), where)
    boxes = [region for region in work.result if region.type == "rectanglelabels"]
    known = {region.id for region in boxes if isinstance((region.meta or {}).get("cadpose"), dict)}
    # Choices share the id of the region that they are about.
    added = [r for r in work.result if not {r.id, r.parent} & known]
    if added:
        log.warning("%s has %d regions without a pose, which are left out", where, len(added))
    return [
        _part(region, work, size, f"{where}, region {region.id}") for region in boxes if region.id in known
    ]


def _part(region: _Region, work: _Work, size: tuple[int, int], where: str) -> AnnotationPart:
    width, height = size
    brushes = [r for r in work.result if r.type == "brushlabels" and r.parent == region.id]
    choices = [r.value.get("choices") for r in work.result if r.type == "choices" and r.id == region.id]
    extras = (region.meta or {})["cadpose"]
    verdict = next((c[0] for c in choices if isinstance(c, list) and c and c[0] in _VERDICTS), None)
    if verdict is not None:
        extras = extras | {"verdict": verdict}
    try:
        told = _Rectangle.model_validate(region.value)
        masks = [
            decode_brush(bytes(_Brush.model_validate(brush.value).rle), width, height) for brush in brushes
        ]
    except ValueError as error:
        raise InputError(f"{where} is unusable ({told_error(error)})") from None
    if told.rotation % 360.0:
        raise InputError(f"{where} is a turned rectangle: draw it upright")
    x0, y0 = told.x / 100.0 * width, told.y / 100.0 * height
    box = (x0, y0, x0 + told.width / 100.0 * width, y0 + told.height / 100.0 * height)
    mask = None
    if masks:
        mask = MaskPart(size=(height, width), counts=encode_mask(np.logical_or.reduce(masks)))
    return annotation_from(extras, Native(box, told.rectanglelabels[0], mask, True), where)


LABEL_STUDIO = Format(
    "label-studio", "Label Studio's tasks with predictions, one JSON file", False, write, read
)
