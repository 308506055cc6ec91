"""COCO's file as pycocotools reads it, and after other tools changed it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from cadpose.annotations.formats.registry import documents_from
from cadpose.detection.coco_json import FileDetector
from cadpose.errors import InputError
from cadpose.photos import read_photo
from cadpose.rle import decode_mask
from tests.annotations.formats.made import Made


@pytest.fixture
def file(made: Made, tmp_path: Path) -> Path:
    return made.export("coco", tmp_path / "coco.json")


def test_pycocotools_reads_boxes_and_masks(made: Made, file: Path) -> None:
    coco = COCO(str(file))
    assert [i["file_name"] for i in coco.loadImgs(coco.getImgIds())] == [
        "a/street.png", "b/street.png", "e vil;$(x).png", "a/empty.png",
    ]  # fmt: skip
    annotations = coco.loadAnns(coco.getAnnIds())
    parts = [part for document in made.documents for part in document.annotations]
    assert len(annotations) == len(parts) == 4
    for told, part in zip(annotations, parts, strict=True):
        assert coco.loadCats(told["category_id"])[0]["name"] == part.detection.category
        x, y, width, height = told["bbox"]
        assert (x, y, x + width, y + height) == pytest.approx(part.detection.box, abs=1e-12)
        assert told["pose"] == part.pose.model_dump(mode="json")
        if part.detection.mask is not None:
            mask = decode_mask(part.detection.mask.size, part.detection.mask.counts)
            np.testing.assert_array_equal(coco.annToMask(told).astype(bool), mask)
            assert told["area"] == mask.sum()


@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_coco_evaluates_it(file: Path, kind: str) -> None:
    coco = COCO(str(file))
    keys = ("image_id", "category_id", "bbox", "segmentation", "score")
    told = [a for a in coco.loadAnns(coco.getAnnIds()) if kind == "bbox" or "segmentation" in a]
    found = coco.loadRes([{k: a[k] for k in keys if k in a} for a in told])
    truth = COCO()
    truth.dataset = coco.dataset | {"annotations": told}
    truth.createIndex()
    run = COCOeval(truth, found, kind)
    run.evaluate()
    run.accumulate()
    run.summarize()
    assert run.stats[0] == pytest.approx(1.0)


def test_the_detections_are_read_from_it(made: Made, file: Path) -> None:
    (first, second) = FileDetector(file).detect(read_photo(made.folder / "a/street.png"))
    assert {first.category, second.category} == {"car"}
    assert sum(d.mask is not None for d in (first, second)) == 1


def change(file: Path, edit: Any) -> list[Any]:
    told = json.loads(file.read_text())
    edit(told)
    file.write_text(json.dumps(told))
    return list(documents_from("coco", file))


def test_what_another_tool_changed_counts(made: Made, file: Path) -> None:
    def edit(told: Any) -> None:
        told["categories"][0]["name"] = "van"
        first, second, third, _ = told["annotations"]
        first["bbox"] = [1.0, 2.0, 10.0, 20.0]
        second["segmentation"] = [[10.0, 10.0, 30.0, 10.0, 30.0, 20.0, 10.0, 20.0]]
        del third["segmentation"]
        third["their_own"] = 1

    street, other, *_ = change(file, edit)
    first, second = street.annotations
    assert first.detection.box == (1.0, 2.0, 11.0, 22.0)
    assert first.detection.category == second.detection.category == "van"
    assert first.pose == made.documents[0].annotations[0].pose
    mask = second.detection.mask
    assert mask is not None and sum(mask.counts[1::2]) == 200
    assert decode_mask(mask.size, mask.counts)[10:20, 10:30].all()
    assert other.annotations[0].detection.mask is None


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda a: a[0].pop("pose"), "no annotation of a pose"),
        (lambda a: a[0]["pose"].update(focal_px=-1.0), "pose"),
        (lambda a: a[0]["pose"].update(azimuth=1.0), "not the matrix"),
        (lambda a: a[0].update(bbox=[1, 2, 0, 4]), "empty"),
        (lambda a: a[0].update(bbox=[1, 2, 3]), "bbox"),
        (lambda a: a[0].update(segmentation={"size": [80, 120], "counts": "!"}), "unusable segmentation"),
        (lambda a: a[0].update(segmentation={"size": [2, 2], "counts": [4]}), "does not fit"),
        (lambda a: a[0].update(segmentation={"size": [10**6, 10**6], "counts": [10**12]}), "limit"),
        (lambda a: a[0].update(image_id=99), "image 99"),
        (lambda a: a.append(a[0]), "sort them by image_id"),
    ],
)
def test_mistakes_name_the_annotation(file: Path, edit: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        change(file, lambda told: edit(told["annotations"]))
    assert str(caught.value).startswith(str(file)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("size", "words"), [(None, "its photo's size"), ([10**6, 10**6], "more than 100000000 pixels")]
)
def test_a_polygon_needs_a_photo_of_a_size(file: Path, size: Any, words: str) -> None:
    told = json.loads(file.read_text())
    told["annotations"][0]["segmentation"] = [[1.0, 1.0, 9.0, 1.0, 9.0, 9.0]]
    told["images"][0]["cadpose"]["size"] = size
    file.write_text(json.dumps(told))
    with pytest.raises(InputError, match=words):
        list(documents_from("coco", file))


def test_a_file_of_others_is_told_apart(file: Path) -> None:
    with pytest.raises(InputError, match="--detections"):
        change(
            file, lambda told: [a.pop(k) for a in told["annotations"] for k in ("pose", "detection", "cad")]
        )
