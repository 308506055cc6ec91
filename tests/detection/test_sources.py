from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.detection.coco_json import FileDetector
from cadpose.detection.label_studio import LabelStudioDetector
from cadpose.detection.mask_folder import MaskFolder
from cadpose.detection.sources import open_detections
from cadpose.errors import InputError
from cadpose.records import Photo

COCO = {"images": [{"id": 1, "file_name": "a.jpg"}], "categories": [], "annotations": []}
STUDIO = [{"data": {"image": "/data/upload/1/0a1b2c3d-a.jpg"}, "annotations": []}]


def test_what_the_content_is_decides_not_the_name(tmp_path: Path) -> None:
    coco, studio = tmp_path / "one.txt", tmp_path / "other.coco"
    coco.write_text("\n " + json.dumps(COCO))
    studio.write_bytes(b"\xef\xbb\xbf" + json.dumps(STUDIO).encode())
    Image.fromarray(np.ones((4, 4), np.uint8)).save(tmp_path / "a.png")
    found = [open_detections(path) for path in (coco, studio, tmp_path)]
    assert [type(source) for source in found] == [FileDetector, LabelStudioDetector, MaskFolder]
    assert all(source.knows("photos/a.jpg") and not source.knows("b.jpg") for source in found)


def test_categories_reach_the_reader(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    path.write_text(json.dumps(COCO))
    source = open_detections(path, ["car"])
    assert isinstance(source, FileDetector) and source.categories == frozenset(["car"])


def test_other_words_for_a_category_are_wanted_too(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    annotation = {"image_id": 1, "category_id": 4, "bbox": [0, 0, 4, 4]}
    categories = [{"id": 4, "name": "motorcycle"}]
    path.write_text(json.dumps(COCO | {"categories": categories, "annotations": [annotation]}))
    value = {"x": 0, "y": 0, "width": 50, "height": 50, "rectanglelabels": ["Motorcycle"]}
    other = tmp_path / "other.json"
    other.write_text(json.dumps([STUDIO[0] | {"annotations": [{"result": [{"value": value}]}]}]))
    (tmp_path / "masks").mkdir()
    Image.fromarray(np.ones((4, 4), np.uint8)).save(tmp_path / "masks" / "a.motorcycle.png")
    photo = Photo(rgb=np.zeros((4, 4, 3), np.uint8), name="a.jpg")
    for source in (path, other, tmp_path / "masks"):
        found = open_detections(source, ["Motorcycle"]).detect(photo)
        assert [d.category for d in found] == ["motorbike"], source


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "cannot be read"),
        (b"", "not a detections file"),
        (b"id,x,y\n1,2,3\n", "COCO JSON, a JSON export of Label Studio, or a folder of PNG masks"),
        (b"\x89PNG\r\n\x1a\n", "--mask"),
        (b"{}", "COCO's JSON: images"),
        (b"[1]", "Label Studio"),
        (b"[", "Label Studio"),
    ],
)
def test_what_is_none_of_them(tmp_path: Path, content: bytes | None, told: str) -> None:
    path = tmp_path / "boxes.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=told) as caught:
        open_detections(path)
    assert "boxes.json" in str(caught.value) and "\n" not in str(caught.value)
