"""Label Studio's tasks: their shape, the masks, and what people change."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel, ConfigDict, TypeAdapter

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.registry import documents_from
from cadpose.detection.brush_rle import decode_brush, encode_brush
from cadpose.detection.label_studio import LabelStudioDetector
from cadpose.errors import InputError
from cadpose.photos import read_photo
from cadpose.rle import decode_mask
from tests.annotations.formats.made import Made


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class Region(Strict):
    """A region as labelstud.io/guide/predictions and /export describe it."""

    id: str
    type: str
    from_name: str
    to_name: str
    original_width: int
    original_height: int
    image_rotation: int
    value: dict[str, Any]
    score: float | None = None
    meta: dict[str, Any] | None = None
    parentID: str | None = None


class Prediction(Strict):
    model_version: str
    score: float
    result: list[Region]


class Task(Strict):
    data: dict[str, Any]
    predictions: list[Prediction]


@pytest.fixture
def file(made: Made, tmp_path: Path) -> Path:
    return made.export("label-studio", tmp_path / "tasks.json")


def test_the_tasks_are_what_label_studio_reads(made: Made, file: Path) -> None:
    tasks = TypeAdapter(list[Task]).validate_json(file.read_bytes())
    assert [t.data["image"] for t in tasks] == [
        "/data/local-files/?d=a/street.png", "/data/local-files/?d=b/street.png",
        "/data/local-files/?d=e%20vil%3B%24%28x%29.png", "/data/local-files/?d=a/empty.png",
    ]  # fmt: skip
    keys = {
        "rectanglelabels": {"x", "y", "width", "height", "rotation", "rectanglelabels"},
        "brushlabels": {"format", "rle", "brushlabels"},
        "choices": {"x", "y", "width", "height", "rotation", "choices"},
    }
    regions = [region for task in tasks for p in task.predictions for region in p.result]
    assert [r.type for r in regions].count("rectanglelabels") == 4
    assert [r.type for r in regions].count("brushlabels") == 3
    for region in regions:
        assert set(region.value) == keys[region.type]
    assert [r.value["choices"] for r in regions if r.type == "choices"] == [
        ["review"],
        ["review"],
        ["reject"],
    ]


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (40, 300), (500, 500)])
def test_brush_masks_come_back(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    for mask in (rng.random(shape) < 0.5, np.ones(shape, bool), np.zeros(shape, bool)):
        np.testing.assert_array_equal(decode_brush(encode_brush(mask), shape[1], shape[0]), mask)
    # Label Studio's converter packs all four channels.
    assert int.from_bytes(encode_brush(np.ones(shape, bool))[:4], "big") == 4 * shape[0] * shape[1]


def test_an_object_is_one_detection(made: Made, file: Path) -> None:
    """Box and mask of an object are told together, not as two objects."""
    photo = read_photo(made.folder / "b/street.png")
    (found,) = LabelStudioDetector(file).detect(photo)
    part = made.documents[1].annotations[0]
    assert found.box.to_tuple() == pytest.approx(part.detection.box) and found.category == "chair"
    mask = part.detection.mask
    assert found.mask is not None and mask is not None
    np.testing.assert_array_equal(found.mask, decode_mask(mask.size, mask.counts))


def annotated(file: Path, edit: Any) -> list[AnnotationDocument]:
    """The tasks as Label Studio exports them after a person submitted the predictions with a change."""
    tasks = json.loads(file.read_text())
    for task in tasks:
        result = json.loads(json.dumps(task["predictions"][0]["result"]))
        task["annotations"] = [{"id": 1, "was_cancelled": False, "result": result}]
        task["predictions"] = [17]
    edit([task["annotations"][0] for task in tasks])
    file.write_text(json.dumps(tasks))
    return list(documents_from("label-studio", file))


def test_what_people_change_counts(made: Made, file: Path, caplog: pytest.LogCaptureFixture) -> None:
    def edit(work: list[Any]) -> None:
        street = work[0]["result"]
        street[0]["value"] |= {"x": 10.0, "y": 25.0, "width": 50.0, "height": 50.0}
        street[0]["value"]["rectanglelabels"] = ["truck"]
        del street[1]  # the mask
        street[1]["value"]["choices"] = ["auto_accept"]
        street.append({"id": "new", "type": "rectanglelabels", "value": street[0]["value"]})
        work[1]["was_cancelled"] = True
        del work[2]["result"][0]  # the object, its mask and its verdict stay behind

    with caplog.at_level(logging.WARNING):
        street, other, hostile, _ = annotated(file, edit)
    first, second = street.annotations
    assert first.detection.box == pytest.approx((12.0, 20.0, 72.0, 60.0))
    assert (first.detection.category, first.detection.mask, first.verdict) == ("truck", None, "auto_accept")
    assert first.pose == made.documents[0].annotations[0].pose
    assert second == made.documents[0].annotations[1]
    assert other.annotations == hostile.annotations == ()
    assert "task 1 has 1 regions without a pose" in caplog.text


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda r: r["value"].update(rotation=12.0), "draw it upright"),
        (lambda r: r["value"].update(width=0.0), "unusable"),
        (lambda r: r["value"].update(rectanglelabels=[]), "unusable"),
        (lambda r: r["meta"]["cadpose"].pop("pose"), "no annotation of a pose"),
        (lambda r: r["meta"].update(cadpose={"detection": {}, "pose": 3}), "no valid annotation"),
    ],
)
def test_mistakes_name_the_region(file: Path, edit: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        annotated(file, lambda work: edit(work[0]["result"][0]))
    assert str(caught.value).startswith(f"{file}: task 1, region")


def test_a_broken_mask(file: Path) -> None:
    with pytest.raises(InputError, match="cut short"):
        annotated(file, lambda work: work[0]["result"][1]["value"]["rle"].__delitem__(slice(10, None)))
