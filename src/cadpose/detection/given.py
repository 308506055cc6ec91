"""Detections that a user tells on the command line: boxes, classes and rotations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from cadpose.detection.imagenet import classify
from cadpose.encoder import lite0
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_name
from cadpose.records import Detection, Photo, Rotation

_T = TypeVar("_T")


def given_detections(
    photo: Photo,
    boxes: Sequence[Box],
    categories: Sequence[str] = (),
    rotations: Sequence[Rotation] = (),
) -> list[Detection]:
    """Detections from the boxes, classes and rotations that a user names.

    Args:
        photo: The photo.
        boxes: Rectangles in pixels of the photo; none means the whole photo.
        categories: One a box, one for all, or none: then Lite0 names each box.
        rotations: One a box, one for all, or none.

    Raises:
        InputError: the numbers do not fit, a box lies outside the photo, or a category is empty.
    """
    places = list(boxes) or [Box(0.0, 0.0, photo.width, photo.height)]
    names = _one_each(categories, len(places), "--category")
    turns = _one_each(rotations, len(places), "--rotation")
    found = []
    for place, name, turn in zip(places, names, turns, strict=True):
        box = place.clipped(photo.width, photo.height)
        if box is None:
            raise InputError(
                f"the box {_plain(place)} lies outside {photo.name}, which has "
                f"{photo.width} x {photo.height} pixels: give x0,y0,x1,y1 within it."
            )
        others: list[tuple[str, float]] = []
        if name is None:
            (name, _), *others = classify(photo.rgb, box, lite0())
        elif not name.strip():
            raise InputError("--category is empty: name one such as car or chair.")
        found.append(
            Detection(
                box=box,
                category=category_from_name(name) or name.strip().lower(),
                rotation=turn,
                source="user",
                alternatives=tuple(others[:3]),
            )
        )
    return found


def parse_box(text: str) -> Box:
    """``x0,y0,x1,y1`` in pixels.

    Raises:
        InputError: not four numbers with x0 < x1 and y0 < y1.
    """
    numbers = _numbers(text)
    if len(numbers) != 4:
        raise InputError(f"the box {text!r} is not of the form x0,y0,x1,y1: give four numbers of pixels.")
    try:
        return Box(*numbers)
    except ValueError:
        raise InputError(f"the box {text!r} is empty: x0 must be below x1, and y0 below y1.") from None


def parse_rotation(text: str) -> Rotation:
    """``azimuth,elevation`` or ``azimuth,elevation,inplane`` in degrees.

    Raises:
        InputError: not two or three numbers, or an elevation beyond 90 degrees.
    """
    numbers = _numbers(text)
    if len(numbers) not in (2, 3):
        raise InputError(
            f"the rotation {text!r} is not of the form azimuth,elevation,inplane: give angles in degrees."
        )
    try:
        return Rotation(*numbers)
    except ValueError:
        raise InputError(f"the rotation {text!r} has an elevation outside -90 to 90 degrees.") from None


def _numbers(text: str) -> list[float]:
    """Numbers between commas; empty where one is none or not finite."""
    try:
        numbers = [float(piece) for piece in text.split(",")]
    except ValueError:
        return []
    return numbers if np.isfinite(numbers).all() else []


def _one_each(given: Sequence[_T], count: int, option: str) -> Sequence[_T | None]:
    if not given:
        return [None] * count
    if len(given) not in (1, count):
        raise InputError(
            f"{option} was given {len(given)} times for {count} boxes: give it once, or once a box."
        )
    return list(given) * (count if len(given) == 1 else 1)


def _plain(box: Box) -> str:
    return ",".join(f"{v:g}" for v in box.to_tuple())
