from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.detection.given import given_detections, parse_box, parse_polygon, parse_rotation
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


@pytest.mark.parametrize(
    "text", ["", "1,2 3,4", "1,2,3,4,5,6", "1,2 3,4 5", "1,2 3,4 5,6,7", "a,b 3,4 5,6", "1,2 3,4 nan,6"]
)
def test_no_polygon(text: str) -> None:
    with pytest.raises(InputError, match="polygon"):
        parse_polygon(text)


def test_polygons_and_masks_bring_their_boxes() -> None:
    triangle = parse_polygon("10,10 30,10 10.5,30")
    assert triangle == [10, 10, 30, 10, 10.5, 30]
    mask = np.zeros((40, 60), np.bool_)
    mask[5:9, 50:52] = True
    found = given_detections(
        PHOTO, [Box(0, 0, 5, 5)], ["car", "bed", "clock"], polygons=[triangle], masks=[mask]
    )
    assert [d.category for d in found] == ["car", "bed", "clock"]
    assert found[0].mask is None and found[2].mask is mask
    assert found[1].mask is not None and 180 < found[1].mask.sum() < 220
    assert [d.box.to_tuple() for d in found] == [(0, 0, 5, 5), (10, 10, 30, 30), (50, 5, 52, 9)]
    with pytest.raises(InputError, match="2 times for 3 objects"):
        given_detections(PHOTO, [Box(0, 0, 5, 5)], ["car"] * 2, polygons=[triangle], masks=[mask])
    with pytest.raises(InputError, match="no pixel of photo, which has 60 x 40"):
        given_detections(PHOTO, [], ["car"], polygons=[[100, 100, 120, 100, 100, 120]])


def test_one_category_for_all_boxes_or_one_each() -> None:
    boxes = [Box(0, 0, 20, 20), Box(30, 10, 80, 30)]
    found = given_detections(PHOTO, boxes, ["couches"], [Rotation(1, 2)])
    assert [(d.category, d.box.x1, d.source) for d in found] == [("sofa", 20, "user"), ("sofa", 60, "user")]
    assert all(d.rotation == Rotation(1, 2) and d.score == 1.0 for d in found)
    assert [d.category for d in given_detections(PHOTO, boxes, ["car", "my thing"])] == ["car", "my thing"]
    with pytest.raises(InputError, match="3 times for 2 objects"):
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
