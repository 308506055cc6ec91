"""One label to and from the JSON object that a label file holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeGuard

from cadpose.datasets.label import Label, Matrix, RunLengths, Vector
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_name

#: By how much the two focal lengths of K may differ, as a share.
_SQUARE_TOLERANCE = 0.01
_FLAGS = ("truncated", "occluded", "difficult", "synthetic")
#: Source of the labels that `cadpose synth` writes; such a photo is never taken for a real one.
_SYNTH = "synth"


def library_category(word: str) -> str:
    """The library category that a word means; a word of no known category stands for itself."""
    return category_from_name(word) or word


def label_from_entry(entry: Any, where: str, folder: Path) -> Label:
    """Read one JSON object.

    Args:
        entry: The decoded JSON value.
        where: What to call it in messages: file and line or number.
        folder: What the paths in it are relative to.

    Raises:
        InputError: the entry is not an object, lacks a photo or a category, or a value is wrong.
    """
    if not isinstance(entry, dict) or not _is_name(entry.get("photo")):
        raise InputError(f"{where} has no photo")
    if not _is_name(entry.get("category")):
        raise InputError(f"{where} has no category")
    for key, what in (("cad", "a library id"), ("split", "a word"), ("source", "a word")):
        if entry.get(key) is not None and not _is_name(entry[key]):
            raise InputError(f"{where}: {key} must be {what}")
    for key in _FLAGS:
        if not isinstance(entry.get(key), bool | None):
            raise InputError(f"{where}: {key} must be true or false")
    try:
        focal_px, principal_px = _camera(entry.get("K"))
        R = entry.get("R")
        flags = {key: bool(entry.get(key)) for key in _FLAGS}
        flags["synthetic"] |= entry.get("source") == _SYNTH
        return Label(
            photo=folder / entry["photo"],
            category=library_category(entry["category"]),
            box=_box(entry.get("box")),
            cad=entry.get("cad"),
            cad_path=_path(entry, "model", folder),
            cad_axes=_axes(entry.get("model_axes")),
            cad_diagonal=_length(entry, "model_diagonal"),
            azimuth=_degrees(entry, "azimuth"),
            elevation=_degrees(entry, "elevation"),
            inplane=_degrees(entry, "inplane"),
            mask=_mask(entry.get("mask"), folder),
            focal_px=focal_px,
            principal_px=principal_px,
            R_cv_from_s=None if R is None else _matrix(R, "R"),
            t_cv=None if entry.get("t") is None else _vector(entry["t"], "t must be [x, y, z]"),
            split=entry.get("split"),
            source=entry.get("source"),
            **flags,
        )
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def entry_from_label(label: Label, relative: Callable[[Path], str]) -> dict[str, Any]:
    """The JSON object of a label; what is not known, and a flag that is false, is left out.

    Args:
        label: What to write.
        relative: Writes a path relative to the label file's folder.
    """
    mask: Any = None
    if isinstance(label.mask, RunLengths):
        counts = label.mask.counts
        mask = {"size": list(label.mask.size), "counts": counts if isinstance(counts, str) else list(counts)}
    elif label.mask is not None:
        mask = relative(label.mask)
    entry = {
        "photo": relative(label.photo),
        "category": label.category,
        "box": None if label.box is None else list(label.box.to_tuple()),
        "cad": label.cad,
        "model": None if label.cad_path is None else relative(label.cad_path),
        "model_axes": label.cad_axes,
        "model_diagonal": label.cad_diagonal,
        "azimuth": label.azimuth,
        "elevation": label.elevation,
        "inplane": label.inplane,
        "mask": mask,
        "K": None if label.K is None else label.K.tolist(),
        "R": label.R_cv_from_s,
        "t": label.t_cv,
        "split": label.split,
        "source": label.source,
        **{key: getattr(label, key) or None for key in _FLAGS},
    }
    return {key: value for key, value in entry.items() if value is not None}


def _degrees(entry: dict[str, Any], key: str) -> float | None:
    value = entry.get(key)
    if value is None:
        return None
    if not _is_number(value):
        raise ValueError(f"{key} must be a number of degrees")
    return float(value)


def _path(entry: dict[str, Any], key: str, folder: Path) -> Path | None:
    value = entry.get(key)
    if value is not None and not _is_name(value):
        raise ValueError(f"{key} must be a path")
    return folder / value if value else None


def _axes(value: Any) -> tuple[str, str] | None:
    if value is None:
        return None
    if not (isinstance(value, list) and len(value) == 2 and all(_is_name(v) for v in value)):
        raise ValueError('model_axes must be front and top, ["+y", "+z"]')
    return value[0], value[1]


def _length(entry: dict[str, Any], key: str) -> float | None:
    value = entry.get(key)
    if value is not None and not _is_number(value):
        raise ValueError(f"{key} must be a number")
    return None if value is None else float(value)


def _box(corners: Any) -> Box | None:
    if corners is None:
        return None
    if not (isinstance(corners, list) and len(corners) == 4 and all(_is_number(v) for v in corners)):
        raise ValueError("box must be [x0, y0, x1, y1] in pixels")
    return Box(*(float(v) for v in corners))


def _mask(value: Any, folder: Path) -> Path | RunLengths | None:
    if value is None:
        return None
    if _is_name(value):
        return folder / value
    if isinstance(value, dict):
        size, counts = value.get("size"), value.get("counts")
        if isinstance(size, list) and len(size) == 2 and all(_is_count(v) for v in size):
            if isinstance(counts, str):
                return RunLengths((size[0], size[1]), counts)
            if isinstance(counts, list) and all(_is_count(v) for v in counts):
                return RunLengths((size[0], size[1]), tuple(counts))
    raise ValueError('mask must be a path or {"size": [height, width], "counts": ...}')


def _camera(K: Any) -> tuple[float | None, tuple[float, float] | None]:
    if K is None:
        return None, None
    (fx, skew, x), (zero, fy, y), last = _matrix(K, "K")
    if skew or zero or last != (0.0, 0.0, 1.0):
        raise ValueError("K must be [[f, 0, x], [0, f, y], [0, 0, 1]]")
    if abs(fx - fy) > _SQUARE_TOLERANCE * abs(fx):
        raise ValueError(f"K has the focal lengths {fx} and {fy}, only square pixels are supported")
    return (fx + fy) / 2.0, (x, y)


def _matrix(value: Any, name: str) -> Matrix:
    wrong = f"{name} must be three rows of three numbers"
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError(wrong)
    a, b, c = (_vector(row, wrong) for row in value)
    return a, b, c


def _vector(value: Any, wrong: str) -> Vector:
    if not (isinstance(value, list) and len(value) == 3 and all(_is_number(v) for v in value)):
        raise ValueError(wrong)
    x, y, z = (float(v) for v in value)
    return x, y, z


def _is_name(value: Any) -> TypeGuard[str]:
    return isinstance(value, str) and bool(value)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 2**40


def _is_number(value: Any) -> bool:
    """Whether JSON's value is a finite number that a float holds; bool is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    # False for NaN and infinity too.
    return abs(value) < 1e300
