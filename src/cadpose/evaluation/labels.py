"""Label files: one JSON array of photographs with what is true of them.

Each entry names a ``photo`` (relative to the label file), a ``category``, and as far as known ``box``
[x0, y0, x1, y1] in pixels (default: the whole photo), ``cad`` (a library id), ``azimuth``,
``elevation`` and ``inplane`` in degrees. Other keys are ignored.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import read_photo
from cadpose.records import Photo, Rotation

MAX_BYTES = 256 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class Label:
    """What is true of one photo.

    Attributes:
        photo: Path of the photograph.
        category: Library category.
        box: The object's rectangle in pixels, None for the whole photo.
        cad: Library id of the true CAD model, if known.
        azimuth: Degrees, if known.
        elevation: Degrees, if known.
        inplane: Degrees, if known.
    """

    photo: Path
    category: str
    box: Box | None = None
    cad: str | None = None
    azimuth: float | None = None
    elevation: float | None = None
    inplane: float | None = None

    @property
    def rotation(self) -> Rotation | None:
        """The whole rotation, None unless azimuth and elevation are both known."""
        if self.azimuth is None or self.elevation is None:
            return None
        return Rotation(self.azimuth, self.elevation, self.inplane or 0.0)


def read_labels(path: Path, category: str | None = None) -> list[Label]:
    """Read a label file, optionally only one category.

    Raises:
        InputError: the file cannot be read, is not such an array, or nothing is left.
    """
    entries = _read_json(path)
    if not isinstance(entries, list):
        raise InputError(f"{path}: expected a JSON array of labels, found {type(entries).__name__}")
    labels = [_label(entry, i, path) for i, entry in enumerate(entries)]
    chosen = [label for label in labels if category is None or label.category == category]
    if not chosen:
        found = ", ".join(sorted({label.category for label in labels})) or "none at all"
        raise InputError(f"{path}: no label of category {category!r}; it has {found}")
    return chosen


def read_gallery(path: Path) -> list[str]:
    """Read a JSON array of library ids.

    Raises:
        InputError: the file cannot be read or is not an array of strings.
    """
    ids = _read_json(path)
    if not isinstance(ids, list) or not ids or not all(isinstance(i, str) for i in ids):
        raise InputError(
            f"{path}: expected a JSON array of CAD ids as `cadpose library list --json` prints them"
        )
    return list(ids)


def _read_json(path: Path) -> Any:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: larger than {MAX_BYTES >> 20} MiB, split it into several files")
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}), check the path") from error
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: is not valid JSON ({error})") from error


def _label(entry: Any, index: int, path: Path) -> Label:
    where = f"{path}: entry {index}"
    if not isinstance(entry, dict) or not isinstance(entry.get("photo"), str):
        raise InputError(f"{where} has no photo")
    if not isinstance(entry.get("category"), str):
        raise InputError(f"{where} has no category")
    numbers: dict[str, float | None] = {}
    for key in ("azimuth", "elevation", "inplane"):
        value = entry.get(key)
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise InputError(f"{where}: {key} must be a number of degrees, got {value!r}")
        numbers[key] = None if value is None else float(value)
    try:
        box = None if entry.get("box") is None else Box(*(float(v) for v in entry["box"]))
        label = Label(
            photo=path.parent / entry["photo"],
            category=entry["category"],
            box=box,
            cad=entry.get("cad"),
            **numbers,
        )
        # A rotation is validated on construction; do it while the entry can still be named.
        _ = label.rotation
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {error}") from error
    return label


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
