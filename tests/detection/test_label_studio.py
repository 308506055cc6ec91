from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.detection import DetectionSource, label_studio, reading
from cadpose.detection.label_studio import LabelStudioDetector
from cadpose.errors import InputError
from cadpose.records import Photo
from tests.detection.brush_writing import brush_stream

PHOTO = Photo(rgb=np.zeros((40, 60, 3), np.uint8), name="holiday/img_1.jpg")
UPLOADED = "/data/upload/3/0a1b2c3d-img_1.jpg"
CAR: dict[str, Any] = {"x": 10, "y": 25, "width": 50, "height": 50, "rotation": 0, "rectanglelabels": ["Car"]}


def region(kind: str = "rectanglelabels", **value: Any) -> dict[str, Any]:
    return {
        "id": "x1",
        "from_name": "label",
        "to_name": "image",
        "type": kind,
        "original_width": 60,
        "original_height": 40,
        "image_rotation": 0,
        "value": value or CAR,
    }


def task(*regions: dict[str, Any], image: str = UPLOADED, **other: Any) -> dict[str, Any]:
    annotation = {"id": 5, "was_cancelled": False, "ground_truth": False, "result": list(regions)}
    return {"id": 1, "data": {"image": image}, "annotations": [annotation], "predictions": []} | other


def detector(tmp_path: Path, *tasks: object, **options: Any) -> LabelStudioDetector:
    path = tmp_path / "export.json"
    path.write_text(json.dumps(tasks))
    return LabelStudioDetector(path, **options)


def test_a_rectangle_in_percent(tmp_path: Path) -> None:
    made: DetectionSource = detector(tmp_path, task(region()))
    (found,) = made.detect(PHOTO)
    assert found.box.to_tuple() == pytest.approx((6, 10, 36, 30))
    assert (found.category, found.score, found.source, found.mask) == ("car", 1.0, "file", None)


def test_a_turned_rectangle_is_turned_about_its_corner(tmp_path: Path) -> None:
    """30 x 20 pixels at (36, 10), a quarter turn clockwise: it then lies to the left of its corner, below."""
    (found,) = detector(
        tmp_path, task(region(**CAR | {"x": 60, "rotation": 90, "width": 50, "height": 50}))
    ).detect(PHOTO)
    assert found.box.to_tuple() == pytest.approx((16, 10, 36, 40))
    (found,) = detector(
        tmp_path, task(region(**CAR | {"x": 50, "y": 10, "rotation": 45, "width": 20, "height": 30}))
    ).detect(PHOTO)
    half = np.sqrt(0.5)  # 12 x 12 pixels at (30, 4): a square that stands on its corner
    assert found.box.to_tuple() == pytest.approx((30 - 12 * half, 4, 30 + 12 * half, 4 + 24 * half))


def test_a_polygon_is_box_and_mask(tmp_path: Path) -> None:
    points = [[10, 25], [60, 25], [60, 75], [10, 75]]
    (found,) = detector(
        tmp_path, task(region("polygonlabels", points=points, closed=True, polygonlabels=["Couch"]))
    ).detect(PHOTO)
    assert found.box.to_tuple() == pytest.approx((6, 10, 36, 30)) and found.category == "sofa"
    truth = np.zeros((40, 60), np.bool_)
    truth[10:30, 6:36] = True
    assert found.mask is not None
    np.testing.assert_array_equal(found.mask, truth)


def test_a_brush_mask(tmp_path: Path) -> None:
    rgba = np.zeros((40, 60, 4), np.uint8)
    rgba[10:30, 6:36] = (200, 30, 3, 255)
    rle = list(brush_stream(rgba, literal=True))
    value = {"format": "rle", "rle": rle, "brushlabels": ["chair"]}
    (found,) = detector(tmp_path, task(region("brushlabels", **value))).detect(PHOTO)
    assert found.box.to_tuple() == (6, 10, 36, 30) and found.category == "chair"
    assert found.mask is not None
    np.testing.assert_array_equal(found.mask, rgba[..., 3] > 0)


@pytest.mark.parametrize(
    ("image", "photo", "known"),
    [
        (UPLOADED, "img_1.jpg", True),
        (UPLOADED, "0a1b2c3d-img_1.jpg", True),
        ("0a1b2c3d-img_1.jpg", "photos/img_1.jpg", True),
        ("img_1.jpg", "photos/img_1.jpg", True),
        ("/data/local-files/?d=holiday%2Fimg_1.jpg", "holiday/img_1.jpg", True),
        ("s3://bucket/a/img_1.jpg", "img_1.jpg", True),
        ("https://host/a/img%201.jpg?token=abc", "img 1.jpg", True),
        ("/data/upload/3/0a1b2c3d-my_photo_1.jpg", "my photo (1).jpg", True),
        ("C:\\photos\\img_1.jpg", "img_1.jpg", True),
        (UPLOADED, "img_2.jpg", False),
        ("/data/upload/3/zzzzzzzz-img_1.jpg", "img_1.jpg", False),
    ],
)
def test_photos_by_their_names(tmp_path: Path, image: str, photo: str, known: bool) -> None:
    made = detector(tmp_path, task(region(), image=image))
    assert made.knows(photo) == known
    assert len(made.detect(Photo(rgb=PHOTO.rgb, name=photo))) == known


def test_a_photo_uploaded_twice_is_told_apart_by_its_own_name_alone(tmp_path: Path) -> None:
    again = UPLOADED.replace("0a1b2c3d", "ffffffff")
    made = detector(tmp_path, task(region()), task(image=again))
    assert made.knows("img_1.jpg")
    with pytest.raises(InputError, match="several images"):
        made.detect(PHOTO)
    assert made.detect(Photo(rgb=PHOTO.rgb, name="ffffffff-img_1.jpg")) == []


def test_which_annotation_counts(tmp_path: Path) -> None:
    def work(category: str, **other: Any) -> dict[str, Any]:
        return {"result": [region(**CAR | {"rectanglelabels": [category]})]} | other

    def category(annotations: list[Any], predictions: list[Any]) -> list[str]:
        made = detector(tmp_path, task(annotations=annotations, predictions=predictions))
        return [d.category for d in made.detect(PHOTO)]

    skipped, first, marked = work("bus", was_cancelled=True), work("car"), work("bed", ground_truth=True)
    assert category([skipped, first, work("chair")], [work("clock")]) == ["car"]
    assert category([first, marked], []) == ["bed"]
    assert category([skipped], [7, work("clock", score=0.4)]) == ["clock"]
    assert category([], []) == []
    made = detector(tmp_path, task(annotations=[], predictions=[work("clock", score=0.4)]))
    assert made.detect(PHOTO)[0].score == 0.4


def test_a_score_that_is_no_share_counts_as_none(tmp_path: Path) -> None:
    regions = [region() | {"score": score} for score in (0.3, 97.5, -1, None)]
    assert [d.score for d in detector(tmp_path, task(*regions)).detect(PHOTO)] == [1.0, 1.0, 1.0, 0.3]


def test_labels_and_shapes_in_two_tags_and_other_results(tmp_path: Path) -> None:
    plain = {key: value for key, value in CAR.items() if key != "rectanglelabels"}
    made = detector(
        tmp_path,
        task(
            region("rectangle", **plain),
            region("labels", **plain, labels=["old", "van"]),
            region("choices", choices=["blurred"]),
            {"type": "relation", "from_id": "a", "to_id": "b"},
        ),
    )
    assert [d.category for d in made.detect(PHOTO)] == ["car"]


def test_people_are_left_out_unless_asked_for(tmp_path: Path) -> None:
    regions = [region(**CAR | {"rectanglelabels": [name]}) for name in ("Person", "Dogs", "pizza", "Chair")]
    assert [d.category for d in detector(tmp_path, task(*regions)).detect(PHOTO)] == ["chair"]
    made = detector(tmp_path, task(*regions), categories=["person"])
    assert [d.category for d in made.detect(PHOTO)] == ["person"]


def test_an_ellipse_is_left_out_and_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    ellipse = region("ellipselabels", x=50, y=50, radiusX=10, radiusY=10, rotation=0, ellipselabels=["car"])
    with caplog.at_level(logging.WARNING):
        assert len(detector(tmp_path, task(ellipse, region())).detect(PHOTO)) == 1
    (record,) = caplog.records
    assert "export.json: task 0 has a ellipselabels" in record.getMessage()


BRUSH: dict[str, Any] = {"format": "rle", "brushlabels": ["car"]}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"original_width": 61}, "61 x 40 pixels but it has 60 x 40"),
        ({"image_rotation": 90}, "turned photo"),
        ({"value": CAR | {"width": 0}}, r"rectangle \(width: "),
        ({"value": CAR | {"width": "wide"}}, r"rectangle \(width: "),
        ({"value": CAR | {"x": 1e9}}, r"rectangle \(x: "),
        ({"value": CAR | {"x": 101, "width": 5}}, "rectangle outside its photo"),
        ({"value": {"points": [[1, 2], [3, 4]], "polygonlabels": ["car"]}}, r"polygon \(points: "),
        ({"value": {"points": [[200, 200], [300, 200], [300, 300]], "polygonlabels": ["car"]}}, "no pixel"),
        ({"value": BRUSH | {"rle": [1, 2, 300]}}, r"brush mask \(rle.2: "),
        ({"value": BRUSH | {"rle": []}}, "cut short"),
        ({"value": BRUSH | {"rle": [255] * 40}}, "4294967295 values"),
        ({"value": BRUSH | {"rle": list(brush_stream(np.zeros((40, 60, 4), np.uint8)))}}, "no pixel"),
        ({"value": BRUSH | {"rle": [0], "format": "png"}}, r"brush mask \(format: "),
    ],
)
def test_what_does_not_fit_gets_one_sentence(tmp_path: Path, change: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        detector(tmp_path, task(region() | change)).detect(PHOTO)
    message = str(caught.value)
    assert "export.json: task 0" in message and "\n" not in message


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ([], "holds no task"),
        ([{"image": "a.jpg", "label": []}], "JSON-MIN"),
        ([{"image_id": 1, "category_id": 2, "bbox": [1, 2, 3, 4], "score": 0.5}], "data: Field required"),
        ([{"data": {"text": "no photo"}}], "does not tell its one photo"),
        ([{"data": {"a": "1.jpg", "b": "2.jpg"}}], "does not tell its one photo"),
        ([{"data": {"image": "a.jpg"}, "annotations": 3}], "annotations"),
    ],
)
def test_not_an_export(tmp_path: Path, content: list[Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        detector(tmp_path, *content)
    assert "export.json" in str(caught.value) and "\n" not in str(caught.value)


def test_too_large_and_too_many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 2 * 60 * 40)
    outline = region("polygonlabels", points=[[10, 25], [60, 25], [60, 75]], polygonlabels=["car"])
    assert len(detector(tmp_path, task(*[outline] * 2, *[region()] * 2)).detect(PHOTO)) == 4
    with pytest.raises(InputError, match=r"has 3 masks of .* no more than 2"):
        detector(tmp_path, task(*[outline] * 3)).detect(PHOTO)
    monkeypatch.setattr(label_studio, "MAX_BYTES", 10)
    with pytest.raises(InputError, match="limit"):
        detector(tmp_path, task(region()))
