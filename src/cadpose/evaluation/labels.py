"""Label files: one JSON array of photographs with what is true of them.

Each entry names a ``photo`` (relative to the label file), a ``category`` (or a word for it), and as far
as known ``box`` [x0, y0, x1, y1] in pixels (default: the whole photo), ``cad`` (a library id),
``azimuth``, ``elevation`` and ``inplane`` in degrees. Other keys are ignored.
"""

from __future__ import annotations

import json
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_name
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
    """Read a label file, optionally only one category, which may be a word for it: "motorcycle".

    Raises:
        InputError: the file cannot be read, is not such an array, an entry is wrong, or nothing is left.
    """
    entries = _read_json(path)
    if not isinstance(entries, list):
        raise InputError(f"{path}: expected a JSON array of labels, found {type(entries).__name__}")
    if not entries:
        raise InputError(f"{path}: holds no label, add one object a photo")
    labels = [_label(entry, i, path) for i, entry in enumerate(entries)]
    wanted = None if category is None else _category(category)
    chosen = [label for label in labels if wanted in (None, label.category)]
    if not chosen:
        found = ", ".join(sorted({label.category for label in labels}))
        raise InputError(f"{path}: no label of category {category!r}; it has {found}")
    return chosen


def read_gallery(path: Path) -> list[str]:
    """Read a JSON array of library ids; one that is named twice counts once.

    Raises:
        InputError: the file cannot be read or is not an array of strings.
    """
    ids = _read_json(path)
    if not isinstance(ids, list) or not ids or not all(isinstance(i, str) for i in ids):
        raise InputError(
            f"{path}: expected a JSON array of CAD ids as `cadpose library list --json` prints them"
        )
    return list(dict.fromkeys(ids))


def _read_json(path: Path) -> Any:
    try:
        # Looked at before it is opened: opening a pipe would wait for a writer.
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{path}: cannot be read (not a regular file), check the path")
        with path.open("rb") as file:
            # A file's size may be told wrong, as in /proc, or grow.
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise InputError(f"{path}: larger than {MAX_BYTES >> 20} MiB, split it into several files")
        return json.loads(data.decode("utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}), check the path") from error
    except (ValueError, RecursionError) as error:  # bad UTF-8, bad JSON, endless digits or brackets
        raise InputError(f"{path}: is not valid JSON ({error})") from error


def _label(entry: Any, index: int, path: Path) -> Label:
    where = f"{path}: entry {index}"
    if not isinstance(entry, dict) or not _is_name(entry.get("photo")):
        raise InputError(f"{where} has no photo")
    if not _is_name(entry.get("category")):
        raise InputError(f"{where} has no category")
    if entry.get("cad") is not None and not _is_name(entry["cad"]):
        raise InputError(f"{where}: cad must be a library id")
    numbers: dict[str, float | None] = {}
    for key in ("azimuth", "elevation", "inplane"):
        value = entry.get(key)
        if value is not None and not _is_number(value):
            raise InputError(f"{where}: {key} must be a number of degrees")
        numbers[key] = None if value is None else float(value)
    corners = entry.get("box")
    if corners is not None and not (
        isinstance(corners, list) and len(corners) == 4 and all(_is_number(v) for v in corners)
    ):
        raise InputError(f"{where}: box must be [x0, y0, x1, y1] in pixels")
    try:
        label = Label(
            photo=path.parent / entry["photo"],
            category=_category(entry["category"]),
            box=None if corners is None else Box(*(float(v) for v in corners)),
            cad=entry.get("cad"),
            **numbers,
        )
        # A rotation is validated on construction; do it while the entry can still be named.
        _ = label.rotation
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    return label


def _category(word: str) -> str:
    """The library category that a word means; a word of no known category stands for itself."""
    return category_from_name(word) or word


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and bool(value)


def _is_number(value: Any) -> bool:
    """Whether JSON's value is a finite number that a float holds; bool is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    # False for NaN and infinity too.
    return abs(value) < 1e300


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
