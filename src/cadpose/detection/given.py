"""Detections that a user tells on the command line: boxes, polygons, masks, classes and rotations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from cadpose.detection.imagenet import classify
from cadpose.detection.polygons import MAX_CORNERS, mask_from_polygons
from cadpose.detection.reading import check_room
from cadpose.encoder import lite0
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_or_word
from cadpose.records import Detection, Mask, Photo, Rotation

_T = TypeVar("_T")
#: x0, y0, x1, y1 ... in continuous pixels.
Polygon = Sequence[float]


def given_detections(
    photo: Photo,
    boxes: Sequence[Box],
    categories: Sequence[str] = (),
    rotations: Sequence[Rotation] = (),
    *,
    polygons: Sequence[Polygon] = (),
    masks: Sequence[Mask] = (),
) -> list[Detection]:
    """Detections from the boxes, polygons, masks, classes and rotations that a user names.

    Args:
        photo: The photo.
        boxes: Rectangles in pixels of the photo; no object at all means the whole photo.
        categories: One an object, boxes first, then polygons, then masks; one for all, or none: then Lite0
            names each object.
        rotations: One an object, one for all, or none.
        polygons: Outlines in pixels of the photo.
        masks: (H, W) bool of the photo's size.

    Raises:
        InputError: the numbers do not fit, a box or polygon lies outside the photo, a category is empty,
            or there are too many polygons and masks.
    """
    check_room("the command line", len(polygons) + len(masks), photo)
    places: list[tuple[Box, Mask | None]] = [(_inside(box, photo), None) for box in boxes]
    for polygon in polygons:
        mask = mask_from_polygons(photo.height, photo.width, [polygon])
        if not mask.any():
            raise InputError(
                f"a polygon covers no pixel of {photo.name}, which has {photo.width} x {photo.height}: "
                f"give corners within it."
            )
        places.append((Box.from_mask(mask), mask))
    places += [(Box.from_mask(mask), mask) for mask in masks]
    if not places:
        places = [(Box(0.0, 0.0, photo.width, photo.height), None)]
    names = _one_each(categories, len(places), "--category")
    turns = _one_each(rotations, len(places), "--rotation")
    return [
        named_detection(photo, box, name, mask=mask, rotation=turn)
        for (box, mask), name, turn in zip(places, names, turns, strict=True)
    ]


def named_detection(
    photo: Photo,
    box: Box,
    name: str | None,
    *,
    mask: Mask | None = None,
    rotation: Rotation | None = None,
    source: str = "user",
) -> Detection:
    """The object of a place that is known; without a name Lite0 tells its category.

    Raises:
        InputError: the name is empty.
    """
    others: list[tuple[str, float]] = []
    if name is None:
        (name, _), *others = classify(photo.rgb, box, lite0())
    elif not name.strip():
        raise InputError("--category is empty: name one such as car or chair.")
    return Detection(
        box=box,
        category=category_or_word(name),
        mask=mask,
        rotation=rotation,
        source=source,
        alternatives=tuple(others[:3]),
    )


def _inside(place: Box, photo: Photo) -> Box:
    box = place.clipped(photo.width, photo.height)
    if box is None:
        raise InputError(
            f"the box {_plain(place)} lies outside {photo.name}, which has "
            f"{photo.width} x {photo.height} pixels: give x0,y0,x1,y1 within it."
        )
    return box


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


def parse_polygon(text: str) -> list[float]:
    """``x,y x,y x,y ...`` in pixels, as x0, y0, x1, y1 ...

    Raises:
        InputError: not three corners or more of two numbers each, or far too many.
    """
    corners = [_numbers(piece) for piece in text.split()]
    if len(corners) < 3 or any(len(corner) != 2 for corner in corners):
        short = text if len(text) <= 60 else text[:60] + " ..."
        raise InputError(
            f"the polygon {short!r} is not of the form 'x,y x,y x,y ...': give three or more corners."
        )
    if len(corners) > MAX_CORNERS:
        raise InputError(f"a polygon has {len(corners)} corners, more than the limit of {MAX_CORNERS}.")
    return [number for corner in corners for number in corner]


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
            f"{option} was given {len(given)} times for {count} objects: give it once, or once for each."
        )
    return list(given) * (count if len(given) == 1 else 1)


def _plain(box: Box) -> str:
    return ",".join(f"{v:g}" for v in box.to_tuple())
