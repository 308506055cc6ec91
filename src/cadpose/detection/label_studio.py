"""Detections from Label Studio's JSON export: rectangles, polygons and brush masks.

The file lists tasks; each names its photo in ``data`` and holds ``annotations`` with ``result``, the regions.
Places are percent of the photo's width and height. A polygon or brush whose parent is a rectangle of the same
answer is that object's mask and no object of its own. A rectangle is turned about its own upper left corner,
``rotation`` degrees clockwise; its upright box around the four corners is taken. Uploaded photos are called
``/data/upload/PROJECT/HASH-name.jpg``: the eight digits before the name are Label Studio's.
"""

from __future__ import annotations

import logging
import re
from codecs import BOM_UTF8
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import parse_qs, unquote, urlsplit

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from cadpose.detection.brush_rle import decode_brush
from cadpose.detection.faults import first_fault
from cadpose.detection.photo_names import PhotoIndex, path_parts
from cadpose.detection.polygons import mask_from_polygons
from cadpose.detection.reading import check_room, is_wanted, read_capped
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.library.class_map import category_from_name, category_or_word
from cadpose.photos import SUFFIXES
from cadpose.records import Detection, Mask, Photo

log = logging.getLogger(__name__)

#: Largest export that is read.
MAX_BYTES = 128 * 2**20
_HASH = re.compile(r"^[0-9a-f]{8}-(?=.)")

_Number = Annotated[float, Field(allow_inf_nan=False)]
_Percent = Annotated[float, Field(ge=-1000.0, le=1000.0, allow_inf_nan=False)]
_Side = Annotated[int, Field(ge=1, le=1_000_000)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class _Region(_Model):
    id: str = ""
    parent: Annotated[str | None, Field(alias="parentID")] = None
    type: str = ""
    value: dict[str, Any] = {}
    original_width: _Side | None = None
    original_height: _Side | None = None
    image_rotation: _Number | None = None
    score: float | None = None


class _Work(_Model):
    """One person's or model's answer to a task."""

    result: list[_Region] | None = None
    was_cancelled: bool | None = None
    ground_truth: bool | None = None
    score: float | None = None


class _Task(_Model):
    data: dict[str, Any]
    annotations: list[_Work] | None = None
    predictions: list[_Work | int] | None = None


class _Rectangle(_Model):
    x: _Percent
    y: _Percent
    width: Annotated[_Percent, Field(gt=0.0)]
    height: Annotated[_Percent, Field(gt=0.0)]
    rotation: _Number = 0.0


class _Polygon(_Model):
    points: Annotated[list[tuple[_Percent, _Percent]], Field(min_length=3, max_length=100_000)]


class _Brush(_Model):
    format: Literal["rle"]
    rle: list[Annotated[int, Field(ge=0, le=255)]]


_TASKS = TypeAdapter(list[_Task])


class LabelStudioDetector:
    """Detections read from a Label Studio JSON export; a detector like any other.

    Of several annotations of a task the one marked as ground truth is taken, else the first that was not
    skipped; where there is none, the first prediction.

    Args:
        path: The file.
        categories: Library categories to keep; None keeps all but people, animals and food.

    Raises:
        InputError: the file is missing, too large, not such an export, or a task does not tell its photo.
    """

    name = "label-studio"

    def __init__(self, path: Path | str, categories: Collection[str] | None = None) -> None:
        self.path = Path(path)
        self.categories = None if categories is None else frozenset(categories)
        mend = "export those that you annotate now alone, or rename the photos"
        # As the file names them, and without what an upload adds.
        self._exact: PhotoIndex[tuple[int, _Task]] = PhotoIndex(self.path, mend)
        self._plain: PhotoIndex[tuple[int, _Task]] = PhotoIndex(self.path, mend)
        for i, task in enumerate(_parsed(self.path)):
            name = _photo_name(task.data)
            if name is None:
                raise self._error(i, "does not tell its one photo: keep it under data.image")
            self._exact.add(name, (i, task))
            last = path_parts(name)[-1]
            if _HASH.match(last):
                self._plain.add(_HASH.sub("", last), (i, task))

    def detect(self, photo: Photo) -> list[Detection]:
        """What the file says of the photo of that name, best first; empty where it says nothing.

        Raises:
            InputError: a region does not fit the photo, or several tasks are of photos of that name.
        """
        found = self._task(photo.name)
        if found is None:
            return []
        i, task = found
        work = _answer(task)
        regions = [(r, word) for r in (work.result if work else None) or () if (word := _label(r.value))]
        boxes = {r.id for r, _ in regions if r.id and _shape(r.value) == "rectangle"}
        masks: dict[str, list[_Region]] = {}
        for region, _ in regions:
            if region.parent in boxes and _shape(region.value) in ("polygon", "brush mask"):
                masks.setdefault(str(region.parent), []).append(region)
        regions = [(r, word) for r, word in regions if r not in masks.get(str(r.parent), ())]
        wanted = [(r, word) for r, word in regions if is_wanted(word, self.categories)]
        unread = [r for r, _ in wanted if not _shape(r.value)]
        if unread:
            log.warning(
                "%s: task %d has a %s, which is left out: draw rectangles, polygons or brushes",
                self.path,
                i,
                unread[0].type or "unknown",
            )
        shaped = [(r, word) for r, word in wanted if _shape(r.value)]
        masked = sum(_shape(r.value) != "rectangle" or r.id in masks for r, _ in shaped)
        check_room(self.path, masked, photo)
        told = [self._detection(i, r, word, photo, work, masks.get(r.id, ())) for r, word in shaped]
        return sorted(told, key=lambda d: -d.score)

    def knows(self, photo_name: str) -> bool:
        """Whether a task is of a photo of that file name."""
        names = (photo_name, _upload_spelling(photo_name))
        return self._exact.has(photo_name) or any(self._plain.has(name) for name in names)

    def _task(self, photo_name: str) -> tuple[int, _Task] | None:
        return (
            self._exact.find(photo_name)
            or self._plain.find(photo_name)
            or self._plain.find(_upload_spelling(photo_name))
        )

    def _detection(
        self,
        i: int,
        region: _Region,
        word: str,
        photo: Photo,
        work: _Work | None,
        masks: Sequence[_Region] = (),
    ) -> Detection:
        box, mask = self._placed(i, region, photo)
        drawn = [m for m in (self._placed(i, r, photo)[1] for r in masks) if m is not None]
        if drawn:
            mask = np.logical_or.reduce(drawn)
        score = region.score
        if score is None and work is not None:
            score = work.score
        return Detection(
            box=box,
            category=category_or_word(word),
            score=1.0 if score is None or not 0.0 <= score <= 1.0 else score,
            mask=mask,
            source="file",
        )

    def _placed(self, i: int, region: _Region, photo: Photo) -> tuple[Box, Mask | None]:
        """Box within the photo, and mask."""
        told = (region.original_width or photo.width, region.original_height or photo.height)
        if told != (photo.width, photo.height):
            raise self._error(
                i,
                f"says that {path_parts(photo.name)[-1]} has {told[0]} x {told[1]} pixels but it has "
                f"{photo.width} x {photo.height} upright: annotate the photo as it is seen",
            )
        if (region.image_rotation or 0.0) % 360.0:
            raise self._error(i, "was annotated on a turned photo: turn the photo itself and annotate it")
        shape = _shape(region.value)
        try:
            box, mask = _place(region.value, photo)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False, include_context=False)[0]
            where = ".".join(str(piece) for piece in first["loc"])
            raise self._error(
                i, f"has an unusable {_shape(region.value)} ({where}: {first['msg']})"
            ) from None
        except ValueError as error:
            raise self._error(i, f"has an unusable {_shape(region.value)} ({error})") from None
        clipped = box.clipped(photo.width, photo.height)
        if clipped is None:
            raise self._error(i, f"has a {shape} outside its photo")
        return clipped, mask

    def _error(self, i: int, what: str) -> InputError:
        return InputError(f"{self.path}: task {i} {what}.")


def _parsed(path: Path) -> list[_Task]:
    """The file's tasks, checked; InputError in one sentence otherwise."""
    data = read_capped(path, MAX_BYTES, "a JSON export of Label Studio").removeprefix(BOM_UTF8)
    try:
        if tasks := _TASKS.validate_json(data):
            return tasks
        raise InputError(f"{path} is not a detections file: it holds no task, export the annotated ones.")
    except ValidationError as error:
        raise InputError(
            f"{path} is not a detections file that Label Studio exports as JSON (not JSON-MIN): "
            f"{first_fault(error)}."
        ) from None


def _photo_name(data: dict[str, Any]) -> str | None:
    """The photo's path as ``data`` tells it; None where it names none, or several and none as ``image``."""
    told = {key: _path_of(value) for key, value in data.items() if isinstance(value, str) and value.strip()}
    if "image" in told:
        return told["image"]
    photos = [name for name in told.values() if Path(name).suffix.lower() in SUFFIXES]
    return photos[0] if len(photos) == 1 else None


def _path_of(address: str) -> str:
    """The path in an address, or behind ``?d=`` as Label Studio writes local files; escapes undone."""
    try:
        parts = urlsplit(address)
        local = parse_qs(parts.query).get("d")
    except ValueError:  # brackets that look like an IPv6 address
        return address
    # A plain file name may hold a question mark or an octothorpe, an address may not.
    if not parts.scheme and not address.startswith("/data/"):
        return address
    return local[0] if local else unquote(parts.path)


def _upload_spelling(photo_name: str) -> str:
    """A file name as an upload leaves it: blanks are underscores, signs but ``-_.`` are dropped."""
    last = path_parts(photo_name)[-1]
    return re.sub(r"[^-\w.]", "", last.strip().replace(" ", "_")) or last


def _answer(task: _Task) -> _Work | None:
    """The annotation that counts."""
    done = [work for work in task.annotations or () if not work.was_cancelled]
    guesses = [work for work in task.predictions or () if isinstance(work, _Work)]
    marked = [work for work in done if work.ground_truth]
    return next(iter([*marked, *done, *guesses]), None)


def _label(value: dict[str, Any]) -> str:
    """The region's class: the first of its labels that the library knows, else the first; empty without."""
    for key, labels in value.items():
        if key.endswith("labels") and isinstance(labels, list):
            words = [w for w in labels if isinstance(w, str) and w.strip()]
            return next((w for w in words if category_from_name(w)), words[0] if words else "")
    return ""


def _shape(value: dict[str, Any]) -> str:
    """What the region is, by the keys of its value; empty where it is nothing that is read."""
    if "rle" in value:
        return "brush mask"
    if "points" in value:
        return "polygon"
    return "rectangle" if {"x", "y", "width", "height"} <= value.keys() else ""


def _place(value: dict[str, Any], photo: Photo) -> tuple[Box, Mask | None]:
    """Box and mask of a region; ValueError where it is none."""
    percent = np.array([photo.width, photo.height]) / 100.0
    if "rle" in value:
        mask = decode_brush(bytes(_Brush.model_validate(value).rle), photo.width, photo.height)
        if not mask.any():
            raise ValueError("it covers no pixel")
        return Box.from_mask(mask), mask
    if "points" in value:
        corners = np.array(_Polygon.model_validate(value).points) * percent
        mask = mask_from_polygons(photo.height, photo.width, [corners.ravel().tolist()])
        if not mask.any():
            raise ValueError("it covers no pixel")
        return _around(corners), mask
    told = _Rectangle.model_validate(value)
    origin, size = np.array([told.x, told.y]) * percent, np.array([told.width, told.height]) * percent
    angle = np.radians(told.rotation)
    across, down = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    steps = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * size
    return _around(origin + steps[:, :1] * across + steps[:, 1:] * down), None


def _around(corners: FloatArray) -> Box:
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return Box(float(x0), float(y0), float(x1), float(y1))
