from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.detection import Detector, coco_json, reading
from cadpose.detection.coco_json import FileDetector
from cadpose.errors import InputError
from cadpose.records import Photo, Rotation

PHOTO = Photo(rgb=np.zeros((40, 60, 3), np.uint8), name="holiday/img_1.jpg")


def content(**annotation: Any) -> dict[str, Any]:
    return {
        "info": {"ignored": True},
        "images": [{"id": 7, "file_name": "img_1.jpg", "width": 60, "height": 40}],
        "categories": [{"id": 3, "name": "car"}, {"id": 63, "name": "couch"}, {"id": 9, "name": "Gadget"}],
        "annotations": [{"image_id": 7, "category_id": 3, "bbox": [10, 5, 20, 30]} | annotation],
    }


def detector(tmp_path: Path, document: object, **options: Any) -> FileDetector:
    path = tmp_path / "boxes.json"
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return FileDetector(path, **options)


def test_box_class_score_and_rotation(tmp_path: Path) -> None:
    made: Detector = detector(
        tmp_path, content(category_id=63, score=0.4, azimuth=370, elevation=-10, inplane=5)
    )
    (found,) = made.detect(PHOTO)
    assert found.box.to_tuple() == (10, 5, 30, 35)
    assert (found.category, found.score, found.source) == ("sofa", 0.4, "file")
    assert found.rotation == Rotation(10, -10, 5) and found.mask is None


def test_unknown_classes_keep_their_name_and_the_filter_works(tmp_path: Path) -> None:
    document = content(category_id=9)
    assert detector(tmp_path, document).detect(PHOTO)[0].category == "gadget"
    assert detector(tmp_path, document, categories=["car"]).detect(PHOTO) == []


def test_best_first_crowds_left_out_other_photos_untouched(tmp_path: Path) -> None:
    document = content(score=0.2)
    base = document["annotations"][0]
    document["annotations"] += [base | {"score": 0.9}, base | {"iscrowd": 1}, base | {"image_id": 8}]
    made = detector(tmp_path, document)
    assert [d.score for d in made.detect(PHOTO)] == [0.9, 0.2]
    assert made.detect(Photo(rgb=PHOTO.rgb, name="other.jpg")) == []


def test_people_animals_and_food_are_left_out_unless_asked_for(tmp_path: Path) -> None:
    document = content()
    document["categories"] += [{"id": 1, "name": "person"}, {"id": 59, "name": "pizza"}]
    base = document["annotations"][0]
    document["annotations"] += [base | {"category_id": 1}, base | {"category_id": 59}]
    assert [d.category for d in detector(tmp_path, document).detect(PHOTO)] == ["car"]
    assert [d.category for d in detector(tmp_path, document, categories=["person"]).detect(PHOTO)] == [
        "person"
    ]


def test_which_photos_it_knows(tmp_path: Path) -> None:
    document = content()
    document["images"].append({"id": 8, "file_name": "empty.jpg"})
    made = detector(tmp_path, document)
    assert made.knows("x/img_1.jpg") and made.knows("empty.jpg") and not made.knows("other.jpg")


def test_what_a_detector_was_unsure_of_comes_back(tmp_path: Path) -> None:
    others = [{"category": "bus", "score": 0.3}, {"category": "bed", "score": 0.1}]
    (found,) = detector(tmp_path, content(unsure=True, alternatives=others)).detect(PHOTO)
    assert found.unsure and found.alternatives == (("bus", 0.3), ("bed", 0.1))


def test_too_many_masks_for_a_photo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 60 * 40)
    document = content(segmentation=[[10, 5, 30, 5, 30, 35, 10, 35]])
    document["annotations"] *= 2
    with pytest.raises(InputError, match="2 masks of"):
        detector(tmp_path, document).detect(PHOTO)


def test_folders_tell_photos_of_the_same_name_apart(tmp_path: Path) -> None:
    document = content()
    document["images"] = [{"id": 6, "file_name": "a/img_1.jpg"}, {"id": 7, "file_name": "b\\img_1.jpg"}]
    made = detector(tmp_path, document)
    assert len(made.detect(Photo(rgb=PHOTO.rgb, name="/data/b/img_1.jpg"))) == 1
    assert made.detect(Photo(rgb=PHOTO.rgb, name="/data/a/img_1.jpg")) == []
    with pytest.raises(InputError, match="several images"):
        made.detect(Photo(rgb=PHOTO.rgb, name="img_1.jpg"))


def test_polygon_and_runs_and_text_give_the_same_mask(tmp_path: Path) -> None:
    truth = np.zeros((40, 60), np.bool_)
    truth[5:35, 10:30] = True
    runs = [10 * 40 + 5] + [30, 10] * 19 + [30, 5 + 30 * 40]
    shapes = [
        [[10, 5, 30, 5, 30, 35, 10, 35]],
        {"size": [40, 60], "counts": runs},
        {"size": [40, 60], "counts": encoded(runs)},
    ]
    for segmentation in shapes:
        mask = detector(tmp_path, content(segmentation=segmentation)).detect(PHOTO)[0].mask
        assert mask is not None
        np.testing.assert_array_equal(mask, truth)


def encoded(runs: list[int]) -> str:
    """COCO's text form, written from its description."""
    text = ""
    for i, run in enumerate(runs):
        value = run - (runs[i - 2] if i > 2 else 0)
        while True:
            low, value = value & 31, value >> 5
            done = (value == -1 and low & 16) or (value == 0 and not low & 16)
            text += chr(48 + low + (0 if done else 32))
            if done:
                break
    return text


@pytest.mark.parametrize(
    ("annotation", "told"),
    [
        ({"bbox": [10, 5, 0, 30]}, "an empty bbox"),
        ({"bbox": [100, 5, 10, 30]}, "outside its photo"),
        ({"segmentation": [[200, 200, 210, 200, 210, 210]]}, "covers no pixel"),
        ({"segmentation": {"size": [40, 60], "counts": [2400]}}, "covers no pixel"),
    ],
)
def test_an_object_without_a_pixel_is_left_out_and_told(
    tmp_path: Path, annotation: dict[str, Any], told: str, caplog: pytest.LogCaptureFixture
) -> None:
    document = content(score=0.7)
    document["annotations"].insert(0, content(**annotation)["annotations"][0])
    with caplog.at_level(logging.WARNING):
        found = detector(tmp_path, document).detect(PHOTO)
    assert [d.score for d in found] == [0.7]
    assert "boxes.json: annotation 0 has" in caplog.text and told in caplog.text


@pytest.mark.parametrize(
    ("annotation", "told"),
    [
        ({"category_id": 99}, "category_id 99"),
        ({"bbox": [1, 2, 3]}, "bbox"),
        ({"bbox": "all"}, "bbox"),
        ({"score": 1.5}, "score"),
        ({"azimuth": 10}, "azimuth and elevation"),
        ({"azimuth": 10, "elevation": 91}, "elevation"),
        ({"segmentation": [[1, 2, 3, 4]]}, "three corners"),
        ({"segmentation": {"size": [40, 61], "counts": [2440]}}, "size"),
        ({"segmentation": {"size": [40, 60], "counts": [2401]}}, "add up"),
        ({"segmentation": {"size": [40, 60], "counts": [-5, 2405]}}, "negative"),
        ({"segmentation": {"size": [40, 60], "counts": "\u00e9"}}, "character"),
        ({"segmentation": {"size": [40, 60], "counts": "oooooooooooo"}}, "out of range"),
        ({"segmentation": {"size": [40, 60], "counts": "o"}}, "within a number"),
        ({"segmentation": {"size": [10**12, 10**12], "counts": [10**24]}}, "segmentation"),
    ],
)
def test_what_does_not_fit_gets_one_sentence(tmp_path: Path, annotation: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        detector(tmp_path, content(**annotation)).detect(PHOTO)
    message = str(caught.value)
    assert "boxes.json" in message and "\n" not in message


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", '[{"image_id": 1}]', '{"images": []}', "[" * 100_000, '{"images": NaN}', "\x00\xff"],
)
def test_not_a_coco_file(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"boxes\.json is not a detections file") as caught:
        detector(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_numbers_that_are_none_are_refused(tmp_path: Path) -> None:
    text = json.dumps(content()).replace("[10, 5, 20, 30]", "[NaN, 5, Infinity, 30]")
    with pytest.raises(InputError, match="bbox"):
        detector(tmp_path, text)


def test_photo_of_another_size(tmp_path: Path) -> None:
    turned = Photo(rgb=np.zeros((60, 40, 3), np.uint8), name="img_1.jpg")
    with pytest.raises(InputError, match="60 x 40"):
        detector(tmp_path, content()).detect(turned)


def test_missing_and_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        FileDetector(tmp_path / "none.json")
    monkeypatch.setattr(coco_json, "MAX_BYTES", 10)
    with pytest.raises(InputError, match="limit"):
        detector(tmp_path, content())
