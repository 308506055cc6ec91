from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.detection.coco_json import FileDetector
from cadpose.detection.coco_writing import CocoWriter
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import CATEGORIES, category_from_name
from cadpose.records import Detection, Photo, Rotation


def photo(name: str) -> Photo:
    return Photo(np.zeros((40, 60, 3), np.uint8), name)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    mask = np.zeros((40, 60), np.bool_)
    mask[5:20, 7:33] = True
    mask[9, 11] = False
    first = [
        Detection(Box(7.25, 5, 33.5, 20), "motorbike", 0.875, mask, "embedded", Rotation(275, 5, -1)),
        Detection(Box(1, 2, 3, 4), "table", 0.5, unsure=True, alternatives=(("bench", 0.25), ("bed", 0.125))),
    ]
    second = [Detection(Box(0, 0, 60, 40), "table", 1.0, truncated=True)]
    writer = CocoWriter()
    writer.add("a/one.jpg", 60, 40, first)
    writer.add("b/one.jpg", 60, 40, second)
    writer.add("none.jpg", 60, 40, [])
    path = tmp_path / "all.json"
    path.write_bytes(writer.to_json())
    read = FileDetector(path)
    assert read.knows("none.jpg") and read.detect(photo("none.jpg")) == []
    for name, made in (("a/one.jpg", first), ("b/one.jpg", second)):
        again = read.detect(photo(name))
        assert [(d.category, d.score, d.rotation, d.alternatives, d.unsure) for d in again] == [
            (d.category, d.score, d.rotation, d.alternatives, d.unsure) for d in made
        ]
        for d, before in zip(again, made, strict=True):
            assert d.box.to_tuple() == pytest.approx(before.box.to_tuple())
            assert (d.mask is None) == (before.mask is None)
            if d.mask is not None and before.mask is not None:
                np.testing.assert_array_equal(d.mask, before.mask)


def test_the_file_is_what_coco_says_it_is() -> None:
    mask = np.zeros((3, 4), np.bool_)
    mask[1, 1:3] = True
    writer = CocoWriter()
    writer.add(
        "a.jpg", 4, 3, [Detection(Box(1, 1, 3, 2), "car", 0.5, mask), Detection(Box(0, 0, 1, 2), "bed")]
    )
    content = json.loads(writer.to_json())
    assert content["images"] == [{"id": 1, "file_name": "a.jpg", "width": 4, "height": 3}]
    assert content["categories"] == [{"id": 1, "name": "car"}, {"id": 2, "name": "bed"}]
    one, two = content["annotations"]
    assert (one["id"], one["image_id"], one["category_id"], one["iscrowd"]) == (1, 1, 1, 0)
    assert one["bbox"] == [1, 1, 2, 1] and one["area"] == 2 and two["area"] == 2
    # Runs 4 1 2 1 4 down the columns; COCO's text takes the run two before from the fourth on.
    assert one["segmentation"] == {"size": [3, 4], "counts": "41202"}
    assert "segmentation" not in two


def test_every_category_of_the_library_comes_back() -> None:
    assert all(category_from_name(name) == name for name in CATEGORIES)


@given(st.text(max_size=20))
def test_any_name_can_be_written(name: str) -> None:
    writer = CocoWriter()
    writer.add(f"caf\udce9{name}", 4, 3, [])
    assert json.loads(writer.to_json())["images"][0]["file_name"].startswith("caf\\udce9")
