from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.detection.given import given_detections, parse_box, parse_rotation
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import read_photo
from cadpose.records import Photo, Rotation

PHOTO = Photo(rgb=np.zeros((40, 60, 3), np.uint8))


def test_box_category_and_rotation() -> None:
    assert parse_box("1, 2.5,30,40") == Box(1, 2.5, 30, 40)
    assert parse_rotation("370,-10") == Rotation(10, -10, 0)
    assert parse_rotation("35,20,5") == Rotation(35, 20, 5)


@pytest.mark.parametrize("text", ["", "1,2,3", "1,2,3,4,5", "a,b,c,d", "nan,0,1,1", "5,0,5,9", "9,0,5,9"])
def test_no_box(text: str) -> None:
    with pytest.raises(InputError, match="box"):
        parse_box(text)


@pytest.mark.parametrize("text", ["", "1", "1,2,3,4", "1,91,0", "inf,0,0"])
def test_no_rotation(text: str) -> None:
    with pytest.raises(InputError, match="rotation"):
        parse_rotation(text)


def test_one_category_for_all_boxes_or_one_each() -> None:
    boxes = [Box(0, 0, 20, 20), Box(30, 10, 80, 30)]
    found = given_detections(PHOTO, boxes, ["couches"], [Rotation(1, 2)])
    assert [(d.category, d.box.x1, d.source) for d in found] == [("sofa", 20, "user"), ("sofa", 60, "user")]
    assert all(d.rotation == Rotation(1, 2) and d.score == 1.0 for d in found)
    assert [d.category for d in given_detections(PHOTO, boxes, ["car", "my thing"])] == ["car", "my thing"]
    with pytest.raises(InputError, match="3 times for 2 boxes"):
        given_detections(PHOTO, boxes, ["car"] * 3)


def test_no_box_means_the_whole_photo() -> None:
    (found,) = given_detections(PHOTO, [], ["car"])
    assert found.box == Box(0, 0, 60, 40)


def test_box_outside_and_empty_category() -> None:
    with pytest.raises(InputError, match="outside"):
        given_detections(PHOTO, [Box(100, 100, 120, 120)], ["car"])
    with pytest.raises(InputError, match="empty"):
        given_detections(PHOTO, [], [" "])


def test_without_a_category_lite0_names_the_box(bench: Path) -> None:
    photo = read_photo(bench / "photos" / "n04099969_rocking_chair.JPEG")
    (found,) = given_detections(photo, [])
    assert found.category == "chair" and len(found.alternatives) == 3
