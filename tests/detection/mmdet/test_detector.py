"""From the network's COCO objects to the library's; the network is made up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.detection.coco import COCO_NAMES
from cadpose.detection.mmdet import detector, packages
from cadpose.detection.mmdet.detector import DetectorsDetector
from cadpose.detection.mmdet.model import Instances
from cadpose.errors import DependencyError
from cadpose.records import Photo
from cadpose.weights import UNPUBLISHED

IDS = {name: i for i, name in COCO_NAMES.items()}
PHOTO = Photo(np.zeros((60, 80, 3), np.uint8))
#: Class, score and box of what is in the photo; the box's left half is the object.
SEEN = (
    ("person", 0.99, (0, 0, 20, 40)),
    ("truck", 0.9, (2, 2, 40, 30)),
    ("handbag", 0.8, (50, 10, 70, 40)),
    ("backpack", 0.7, (50, 10, 70, 41)),
    ("traffic light", 0.65, (1, 1, 9, 9)),
    ("horse", 0.6, (0, 30, 40, 60)),
    ("chair", 0.45, (30, 40, 50, 60)),
    ("pizza", 0.44, (30, 40, 50, 60)),
    ("bus", 0.35, (40, 30, 80, 60)),
    ("clock", 0.1, (0, 50, 9, 60)),
)


class MadeUp:
    """In place of :class:`cadpose.detection.mmdet.model.Htc`."""

    def __init__(self, device: str, scale: tuple[int, int] | None) -> None:
        self.asked: list[Any] = [device, scale]

    def load(self, path: Path) -> None:
        self.asked.append(path)

    def instances(
        self, rgb: NDArray[np.uint8], floor: float, classes: NDArray[np.int64] | None = None
    ) -> Instances:
        wanted = None if classes is None else set(classes.tolist())
        seen = [s for s in SEEN if s[1] >= floor and (wanted is None or IDS[s[0]] in wanted)]
        masks = np.zeros((len(seen), *rgb.shape[:2]), np.bool_)
        for mask, (name, _, (x0, y0, x1, y1)) in zip(masks, seen, strict=True):
            mask[y0:y1, x0 : (x0 + x1) // 2] = name != "chair"
        return Instances(
            boxes=np.array([s[2] for s in seen], np.float64).reshape(-1, 4),
            classes=np.array([IDS[s[0]] for s in seen], np.int64),
            scores=np.array([s[1] for s in seen], np.float64),
            masks=masks,
        )


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detector, "Htc", MadeUp)
    monkeypatch.setattr(packages, "require", lambda device: None)


def test_coco_classes_become_categories() -> None:
    found = DetectorsDetector(checkpoint=Path("x.pth")).detect(PHOTO)
    # Two kinds of bag on one place are one bag; people, animals, food and the unknown are left out.
    named = [("truck", 0.9), ("bag", 0.8), ("chair", 0.45), ("bus", 0.35)]
    assert [(d.category, d.score) for d in found] == named
    assert found[0].alternatives == (("car", 0.45),) and found[1].alternatives == ()
    assert found[1].box.to_tuple() == (50.0, 10.0, 70.0, 40.0) and found[1].source == "detectors"
    mask = found[1].mask
    assert mask is not None and mask.shape == (60, 80) and mask.sum() == 300 and mask[10:40, 50:60].all()
    assert found[2].mask is None, "no pixel is in it"


def test_wanted_categories_only_and_vans_are_cars_by_half() -> None:
    found = DetectorsDetector({"car", "horse"}, checkpoint=Path("x.pth"), min_score=0.2).detect(PHOTO)
    # The bus counts for 0.35 / 2 only.
    assert [(d.category, d.score, d.alternatives) for d in found] == [("horse", 0.6, ()), ("car", 0.45, ())]
    assert DetectorsDetector(set(), checkpoint=Path("x.pth")).detect(PHOTO) == []


def test_the_network_itself_can_be_asked() -> None:
    raw = DetectorsDetector(checkpoint=Path("x.pth")).instances(PHOTO)
    assert [COCO_NAMES[int(c)] for c in raw.classes] == [s[0] for s in SEEN]


def test_what_the_network_is_made_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = DetectorsDetector(None, "cuda", tmp_path / "x.pth", scale=(640, 480))
    assert made._network.asked == ["cuda", (640, 480), tmp_path / "x.pth"]  # type: ignore[attr-defined]
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path))
    entry = UNPUBLISHED["detectors-htc-r50"]
    with pytest.raises(DependencyError) as caught:
        DetectorsDetector()
    message = str(caught.value)
    assert entry.url in message and str(tmp_path / "weights" / entry.file) in message and "\n" not in message
