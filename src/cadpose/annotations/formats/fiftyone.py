"""FiftyOne's own dataset layout: photos with detections, and beside it the 3D scenes of their objects.

The folder is a ``FiftyOneDataset`` of images: metadata.json, samples.json, data. ``scenes`` in it is a second
one, of .fo3d files, one an object: the model before the annotation's camera, which stands at the origin and
looks along -z. A detection's box is relative to the photo, its mask to its box. Our keys are one text of JSON
in the detection, so that they outlive an export from FiftyOne.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import zlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.extras import (
    SAME,
    Native,
    annotation_from,
    document_from_parts,
    extras_of,
    located,
    photo_extras,
    photo_size,
    told_error,
)
from cadpose.annotations.formats.fiftyone_schema import dataset_document
from cadpose.annotations.formats.fo3d import SceneFolder
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.json_stream import JsonArrays, dumped, iter_json
from cadpose.annotations.formats.pictures import copy_photo
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.parts import MaskPart
from cadpose.errors import InputError
from cadpose.records import Mask
from cadpose.rle import MAX_PIXELS, decode_mask, encode_mask

#: The field of the detections.
FIELD = "annotations"
_WHAT = "the samples.json of a FiftyOneDataset"
#: Of a mask within its box, as unpacked.
_MAX_ARRAY = MAX_PIXELS + 4096


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Fill a folder.

    Raises:
        InputError: a photo is missing or is another one, or a model of the library is another one.
        LibraryError: the library lacks a model.
    """
    (out / "data").mkdir()
    (out / "metadata.json").write_text(dumped(dataset_document("image", FIELD)) + "\n", encoding="utf-8")
    with ExitStack() as stack:
        samples = stack.enter_context(JsonArrays(out / "samples.json", ["samples"]))
        scenes = stack.enter_context(SceneFolder(out / "scenes", sources))
        for document in documents:
            samples.add("samples", _sample(document, out, sources, scenes))


def _sample(document: AnnotationDocument, out: Path, sources: Sources, scenes: SceneFolder) -> dict[str, Any]:
    width, height = document.photo.size
    photo = copy_photo(sources, document, out / "data")
    detections = []
    for number, part in enumerate(document.annotations):
        scene = scenes.add(document, part, number)
        detections.append(_detection(part, object_id(document.photo.sha256, number), scene, (width, height)))
    return {
        "_id": {"$oid": document.photo.sha256[:24]},
        "filepath": f"data/{photo.name}",
        "tags": [],
        "metadata": {
            "_cls": "ImageMetadata",
            "size_bytes": photo.stat().st_size,
            "mime_type": "image/jpeg" if photo.suffix == ".jpg" else f"image/{photo.suffix[1:]}",
            "width": width,
            "height": height,
            "num_channels": 3,
        },
        "_media_type": "image",
        "_rand": int(document.photo.sha256[:8], 16) / 2**32,
        FIELD: {"_cls": "Detections", "detections": detections},
        "photo_name": document.photo.name,
        "cadpose": dumped(photo_extras(document)),
    }


def _detection(part: AnnotationPart, key: str, scene: str, size: tuple[int, int]) -> dict[str, Any]:
    (width, height), (x0, y0, x1, y1) = size, part.detection.box
    told: dict[str, Any] = {
        "_id": {"$oid": key},
        "_cls": "Detection",
        "attributes": {},
        "tags": [] if part.verdict is None else [part.verdict],
        "label": part.detection.category,
        "bounding_box": [x0 / width, y0 / height, (x1 - x0) / width, (y1 - y0) / height],
        "confidence": part.detection.score,
        "cad": part.cad.id,
        "cad_name": part.cad.name,
        "azimuth": part.pose.azimuth,
        "elevation": part.pose.elevation,
        "inplane": part.pose.inplane,
        "focal_px": part.pose.focal_px,
        "scene": scene,
        "cadpose": dumped(extras_of(part, mask=True)),
    }
    if part.detection.mask is not None:
        mask = decode_mask(part.detection.mask.size, part.detection.mask.counts)
        own = _within(mask, part.detection.box)
        told["mask"] = {"$binary": {"base64": base64.b64encode(_packed(own)).decode(), "subType": "00"}}
    return told


def object_id(sha256: str, number: int) -> str:
    """A MongoDB id of an object of a photo, the same each time."""
    return hashlib.sha256(f"{sha256}:{number}".encode()).hexdigest()[:24]


def _within(mask: Mask, box: tuple[float, float, float, float]) -> Mask:
    """The mask's part in the whole pixels of its box, as FiftyOne lays it back: from the rounded corner."""
    rows, columns = _pixels(mask.shape[:2], box)
    return mask[rows, columns]


def _pixels(size: tuple[int, ...], box: tuple[float, float, float, float]) -> tuple[slice, slice]:
    x0, y0, x1, y1 = box
    across = _span(x0, x1, size[1])
    return _span(y0, y1, size[0]), across


def _span(low: float, high: float, length: int) -> slice:
    # Halves go down, also where a share of the photo's size has lost its last digits.
    first, last = (int(np.floor(side + 0.5 - SAME)) for side in (low, high))
    start = min(max(first, 0), length - 1)
    return slice(start, min(max(last, start + 1), length))


def _packed(mask: Mask) -> bytes:
    """zlib over NumPy's file format, as FiftyOne stores arrays."""
    out = io.BytesIO()
    np.save(out, mask.astype(np.bool_), allow_pickle=False)
    return zlib.compress(out.getvalue())


def _unpacked(told: Any, size: tuple[int, int]) -> Mask:
    """(height, width) mask of a box; a mask of other size is scaled to it, as FiftyOne draws it."""
    data = base64.b64decode(told["$binary"]["base64"], validate=True)
    unzip = zlib.decompressobj()
    raw = unzip.decompress(data, _MAX_ARRAY)
    if unzip.unconsumed_tail:
        raise ValueError(f"the mask has more than {MAX_PIXELS} pixels")
    mask = np.load(io.BytesIO(raw), allow_pickle=False)
    if mask.ndim != 2 or mask.dtype.kind not in "bu" or not mask.size:
        raise ValueError("the mask is no picture")
    if mask.shape != size:
        picture = Image.fromarray((mask > 0).astype(np.uint8) * np.uint8(255))
        mask = np.asarray(picture.resize((size[1], size[0]), Image.Resampling.NEAREST))
    return np.asarray(mask > 0)


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a folder: boxes, labels and masks as FiftyOne's fields tell them.

    Raises:
        InputError: the folder is not one that `write` or, after it, FiftyOne wrote.
    """
    file = path / "samples.json" if path.is_dir() else path
    number = 0
    for key, sample in iter_json(file, _WHAT):
        if key != "samples":
            continue
        number += 1
        where = located(file, "sample", number)
        if not isinstance(sample, dict):
            raise InputError(f"{where} is no object")
        photo = _json(sample.get("cadpose"), where)
        size = photo_size(photo, where)
        field = sample.get(FIELD)
        found = field.get("detections") if isinstance(field, dict) else None
        if not isinstance(found, list):
            raise InputError(f"{where} has no detections in its field {FIELD}")
        parts = [_part(told, size, f"{where}, detection {i}") for i, told in enumerate(found, start=1)]
        yield document_from_parts(photo, parts, where)


def _part(told: Any, size: tuple[int, int], where: str) -> AnnotationPart:
    if not isinstance(told, dict):
        raise InputError(f"{where} is no object")
    extras = _json(told.get("cadpose"), where)
    plain = annotation_from(extras, Native(), where)
    width, height = size
    kept = plain.detection.mask
    try:
        x, y, w, h = (float(value) for value in told["bounding_box"])
        box = (x * width, y * height, (x + w) * width, (y + h) * height)
        mask = None
        if told.get("mask") is not None:
            rows, columns = _pixels((height, width), box)
            own = _unpacked(told["mask"], (rows.stop - rows.start, columns.stop - columns.start))
            whole = (
                np.zeros((height, width), np.bool_) if kept is None else decode_mask(kept.size, kept.counts)
            )
            # What lies outside the box has no place in FiftyOne; it comes back where the rest is as it was.
            if not np.array_equal(own, whole[rows, columns]):
                whole = np.zeros((height, width), np.bool_)
                whole[rows, columns] = own
            mask = MaskPart(size=(height, width), counts=encode_mask(whole))
    except (KeyError, TypeError, ValueError, OverflowError, zlib.error) as error:
        raise InputError(f"{where} is unusable ({told_error(error)})") from None
    label = told.get("label")
    return annotation_from(extras, Native(box, label if isinstance(label, str) else None, mask, True), where)


def _json(text: Any, where: str) -> dict[str, Any]:
    try:
        told = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        told = None
    if not isinstance(told, dict):
        raise InputError(f"{where} lacks the field cadpose of `cadpose export`, so it has no pose: delete it")
    return told


FIFTYONE = Format("fiftyone", "FiftyOne's dataset folder with .fo3d scenes", True, write, read)
