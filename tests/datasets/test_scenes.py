from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.datasets.label import Label, RunLengths
from cadpose.datasets.labels import write_labels
from cadpose.datasets.scene_sets import open_scenes
from cadpose.datasets.scenes import Scene, SceneSet, TrueObject
from cadpose.detection.coco import COCO_80
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import read_photo
from cadpose.rle import encode_mask, text_from_runs
from tests.datasets.trees import PIX3D, write_photo, write_text


def objects(scene: Scene) -> list[TrueObject]:
    return list(scene.objects(read_photo(scene.photo)))


def told(scenes: SceneSet) -> list[list[tuple[str, tuple[float, ...]]]]:
    return [[(o.category, o.box.to_tuple()) for o in objects(scene)] for scene in scenes.scenes]


def coco(folder: Path, *annotations: dict[str, Any], **image: Any) -> Path:
    write_photo(folder / "val" / "a.png", (60, 40))
    content = {
        "images": [{"id": 7, "file_name": "a.png", "width": 60, "height": 40} | image],
        "categories": [{"id": 3, "name": "car"}, {"id": 27, "name": "backpack"}, {"id": 38, "name": "kite"}],
        "annotations": [{"image_id": 7, "category_id": 3, "bbox": [10, 5, 20, 30]} | a for a in annotations],
    }
    path = folder / "annotations" / "instances.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(content))
    return path


def test_coco(tmp_path: Path) -> None:
    runs = {"size": [40, 60], "counts": [0, 40 * 3, 40 * 57]}
    path = coco(
        tmp_path,
        {"area": 150.5, "segmentation": [[10, 5, 30, 5, 30, 35]]},
        {"category_id": 27, "iscrowd": 1, "segmentation": runs},
        {"category_id": 38, "bbox": [50, 30, 20, 20]},
        {"bbox": [10, 10, 0, 5]},
    )
    scenes = open_scenes(path, tmp_path / "val")
    assert (scenes.kind, scenes.name, scenes.synthetic) == ("coco", "annotations/instances.json", False)
    assert scenes.categories == {"car", "bag", "kite"}
    car, bag, kite = objects(scenes.scenes[0])  # the box without width is left out
    assert (car.category, car.area, car.ignored, car.box) == ("car", 150.5, False, Box(10, 5, 30, 35))
    assert (bag.crowd, bag.ignored, car.crowd) == (True, False, False)
    assert kite.box == Box(50, 30, 60, 40) and kite.area == 100 and kite.mask is None
    assert car.mask is not None and bag.mask is not None
    photo = read_photo(tmp_path / "val" / "a.png")
    assert car.mask(photo).sum() == pytest.approx(300, abs=15)
    assert np.flatnonzero(bag.mask(photo).all(axis=0)).tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("annotation", "image", "words"),
    [
        ({"category_id": 9}, {}, "annotation 0 names a category or an image"),
        ({"bbox": [1, 2, 3]}, {}, "annotations.0.bbox"),
        ({}, {"file_name": "../a.png"}, "does not lie in"),
        ({}, {"file_name": "b.png"}, "name their folder with --images"),
    ],
)
def test_coco_files_that_are_wrong(
    tmp_path: Path, annotation: dict[str, Any], image: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=r"instances\.json") as error:
        open_scenes(coco(tmp_path, annotation, **image), tmp_path / "val")
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("annotation", "image", "words"),
    [
        ({}, {"width": 40, "height": 60}, "60 x 40 pixels upright, but instances.json says 40 x 60"),
        ({"segmentation": {"size": [40, 60], "counts": [3]}}, {}, "cannot be decoded"),
        ({"segmentation": {"size": [2, 2], "counts": [0, 4]}}, {}, "another size than its photo"),
    ],
)
def test_coco_labels_that_do_not_fit_the_photo(
    tmp_path: Path, annotation: dict[str, Any], image: dict[str, Any], words: str
) -> None:
    scene = open_scenes(coco(tmp_path, annotation, **image), tmp_path / "val").scenes[0]
    photo = read_photo(scene.photo)
    with pytest.raises(InputError, match=words):
        for found in scene.objects(photo):
            assert found.mask is not None
            found.mask(photo)


def test_yolo(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_photo(tmp_path / "images" / "train" / f"{name}.png", (100, 50))
    car, kite = COCO_80.index("car"), COCO_80.index("kite")
    write_text(
        tmp_path / "labels" / "train" / "a.txt",
        f"{car} 0.5 0.5 0.2 0.4",
        "",
        f"{kite} 0 0 0.5 0 0.5 1",
    )
    assert len(COCO_80) == 80 and COCO_80[79] == "toothbrush" and car == 2
    scenes = open_scenes(tmp_path)
    assert scenes.kind == "yolo" and {"car", "bag", "kite"} <= scenes.categories
    # b has no file: it shows no object.
    assert told(scenes) == [[("car", pytest.approx((40, 15, 60, 35))), ("kite", (0, 0, 50, 50))], []]
    boxed, outlined = objects(scenes.scenes[0])
    assert boxed.mask is None and outlined.mask is not None
    assert outlined.mask(read_photo(scenes.scenes[0].photo)).sum() == pytest.approx(1250, abs=50)
    write_text(tmp_path / "classes.txt", "lawn mower", "office chair", "Motorcycle")
    write_text(tmp_path / "labels" / "train" / "a.txt", "2 0.5 0.5 1 1")
    assert open_scenes(tmp_path).categories == {"lawn mower", "office chair", "motorbike"}
    assert told(open_scenes(tmp_path))[0] == [("motorbike", (0, 0, 100, 50))]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("car 0.5 0.5 1 1", "not a class number"),
        ("80 0.5 0.5 1 1", "has the class 80, but there are 80"),
        ("-1 0.5 0.5 1 1", "has the class -1"),
        ("2 0.5 0.5 1", "has 3 numbers"),
        ("2 0.5 0.5 1 1 1 1 1", "has 7 numbers"),
        ("2 50 20 30 10", "shares of the photo's size"),
        ("2 0.5 nan 0.1 0.1", "outside 0 to 1"),
        ("2 0.5 0.5 0 0.1", "without width or height"),
    ],
)
def test_yolo_lines_that_are_wrong(tmp_path: Path, line: str, words: str) -> None:
    write_photo(tmp_path / "images" / "a.png")
    write_text(tmp_path / "labels" / "a.txt", "2 0.5 0.5 1 1", line)
    with pytest.raises(InputError, match=r"a\.txt: line 2:") as error:
        open_scenes(tmp_path)
    assert words in str(error.value)


def test_yolo_without_a_label_that_belongs_to_a_photo(tmp_path: Path) -> None:
    write_photo(tmp_path / "images" / "a.png")
    write_text(tmp_path / "labels" / "b.txt", "2 0.5 0.5 1 1")
    with pytest.raises(InputError, match=r"no label of a photo in .*images, such as a\.txt"):
        open_scenes(tmp_path)


def test_label_files(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_photo(tmp_path / f"{name}.png", (60, 40))
    seen = np.zeros((40, 60), np.bool_)
    seen[10:20, 5:25] = True
    mask = RunLengths((40, 60), text_from_runs(encode_mask(seen)))
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    labels = [
        Label(a, "car", Box(0, 0, 50, 30), mask=mask, synthetic=True),
        Label(b, "chair", synthetic=True),
        Label(a, "bed", Box(30, 0, 90, 30), difficult=True, synthetic=True),
    ]
    write_labels(tmp_path / "labels.jsonl", labels)
    for path in (tmp_path / "labels.jsonl", tmp_path):
        scenes = open_scenes(path)
        assert scenes.synthetic and scenes.categories == {"car", "chair", "bed"}
        # What is seen of the car, not the whole; the bed as far as the photo goes; all of b.
        assert told(scenes) == [
            [("car", (5, 10, 25, 20)), ("bed", (30, 0, 60, 30))],
            [("chair", (0, 0, 60, 40))],
        ]
    car, bed = objects(scenes.scenes[0])
    assert (car.ignored, bed.ignored, bed.crowd) == (False, True, False)
    assert bed.mask is None and car.mask is not None
    np.testing.assert_array_equal(car.mask(read_photo(a)), seen)
    with pytest.raises(InputError, match="leave out --images"):
        open_scenes(tmp_path, tmp_path)
    write_labels(tmp_path / "mixed.jsonl", [*labels, Label(b, "chair")])
    with pytest.raises(InputError, match="synthetic and real photos"):
        open_scenes(tmp_path / "mixed.jsonl")
    entry = {"photo": "a.png", "category": "desk", "box": [70, 0, 80, 10]}
    (tmp_path / "own.json").write_text(json.dumps([entry]))
    own = open_scenes(tmp_path / "own.json")
    assert own.categories == {"table"} and not own.synthetic
    with pytest.raises(InputError, match=r"a\.png: a labelled box lies outside"):
        objects(own.scenes[0])


def test_pix3d(tmp_path: Path) -> None:
    write_photo(tmp_path / PIX3D["img"], (120, 80))
    white = np.zeros((80, 120), np.uint8)
    white[20:60, 30:90] = 255
    (tmp_path / PIX3D["mask"]).parent.mkdir(parents=True)
    Image.fromarray(white).save(tmp_path / PIX3D["mask"])
    (tmp_path / "pix3d.json").write_text(json.dumps([PIX3D]))
    scenes = open_scenes(tmp_path)
    (bed,) = objects(scenes.scenes[0])
    assert scenes.kind == "pix3d" and bed.category == "bed" and bed.box == Box(*PIX3D["bbox"])
    assert bed.mask is not None and bed.mask(read_photo(scenes.scenes[0].photo)).sum() == 2400


def test_what_is_no_data_set(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file or folder"):
        open_scenes(tmp_path / "gone")
    with pytest.raises(InputError, match=r"holds none of pix3d\.json"):
        open_scenes(tmp_path)
    (tmp_path / "a.json").write_text("3")
    with pytest.raises(InputError, match="JSON array of labels"):
        open_scenes(tmp_path / "a.json")
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(InputError, match="no label file in COCO's JSON"):
        open_scenes(tmp_path / "a.json")
    with pytest.raises(ValueError, match="area"):
        TrueObject(Box(0, 0, 1, 1), "car", 0.0)
