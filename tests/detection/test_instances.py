from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pytest

from cadpose.detection import reading
from cadpose.detection.canvas import Canvas
from cadpose.detection.coco import COCO_NAMES
from cadpose.detection.instances import Instances, class_categories, detections
from cadpose.detection.onnx_head import Suppression
from cadpose.records import Detection

NAMES = ("person", "chair", "couch", "bed", "traffic light", "backpack", "handbag")
#: The photo is twice as wide as the canvas and as high.
CANVAS = Canvas((200, 100), (100, 100), (0, 0, 100, 100))


def found(*rows: tuple[Sequence[float], Sequence[float]], **more: Any) -> Instances:
    return Instances(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), **more)


def detected(
    what: Instances, wanted: Collection[str] | None = None, iou: float | None = 0.7, **how: Any
) -> list[Detection]:
    told = {"min_score": 0.3, "most": 50, "source": "net", **how}
    suppression = None if iou is None else Suppression(iou=iou, across_classes=how.pop("across", True))
    told.pop("across", None)
    return detections(what, CANVAS, class_categories(NAMES, wanted), wanted, suppression=suppression, **told)


BOX = [10.0, 20.0, 30.0, 60.0]


def test_categories_of_classes() -> None:
    assert class_categories(NAMES, None) == (None, "chair", "sofa", "bed", None, "bag", "bag")
    assert class_categories([" Chair ", "Forklift", "", "Hot Dog"], None) == ("chair", "forklift", None, None)
    # Asked for by name, even a horse is an object.
    assert class_categories(["horse", "dog", "traffic light"], {"horse"}) == ("horse", None, None)
    known = [c for c in class_categories(list(COCO_NAMES.values()), None) if c]
    assert 40 < len(known) < 60 and "table" in known and "tv" in known


def test_a_detection_in_photo_pixels_with_its_alternatives() -> None:
    (d,) = detected(found((BOX, [0.0, 0.8, 0.3, 0.04, 0.2, 0.1, 0.15])))
    assert d.box.to_tuple() == (20.0, 20.0, 60.0, 60.0)
    assert (d.category, d.score, d.source, d.mask) == ("chair", 0.8, "net", None)
    assert d.alternatives == (("sofa", 0.3), ("bag", 0.15))


def test_people_and_unnamed_classes_win_and_are_left_out() -> None:
    person, lights = [0.9, 0.8, 0, 0, 0, 0, 0], [0, 0.5, 0, 0, 0.6, 0, 0]
    assert detected(found((BOX, person), ([50, 0, 70, 60], lights))) == []


def test_only_wanted_categories() -> None:
    row = (BOX, [0.0, 0.2, 0.8, 0.4, 0, 0, 0])
    (d,) = detected(found(row), {"bed", "chair"})
    assert (d.category, d.score, d.alternatives) == ("bed", 0.4, (("chair", 0.2),))
    assert detected(found(row), {"chair"}) == [] and detected(found(row), set()) == []


def test_vans_are_cars_by_half_where_told() -> None:
    def categories(vans: bool, wanted: Collection[str] | None) -> list[tuple[str, float]]:
        out = detections(
            found((BOX, [0.8, 0.1])), CANVAS, ("truck", "car"), wanted,
            min_score=0.3, suppression=None, most=9, source="x", vans=vans,
        )  # fmt: skip
        return [(d.category, d.score) for d in out]

    assert categories(True, {"car"}) == [("car", 0.4)] and categories(False, {"car"}) == []
    assert categories(True, None) == categories(False, None) == [("truck", 0.8)]


def test_boxes_are_clipped_and_slivers_dropped() -> None:
    chair = [0, 0.9, 0, 0, 0, 0, 0]
    outside, sliver, inverted = [110, 0, 120, 50], [10, 10, 10.4, 50], [30, 30, 20, 40]
    (d,) = detected(found(([-20, -10, 30, 120], chair), (outside, chair), (sliver, chair), (inverted, chair)))
    assert d.box.to_tuple() == (0.0, 0.0, 60.0, 100.0)


def test_suppression_within_and_across_classes() -> None:
    chair, sofa = [0, 0.9, 0, 0, 0, 0, 0], [0, 0, 0.8, 0, 0, 0, 0]
    rows = (BOX, chair), (BOX, sofa), ([10.0, 20.0, 30.0, 58.0], [0, 0.5, 0, 0, 0, 0, 0])
    assert [d.category for d in detected(found(*rows))] == ["chair"]
    assert [d.category for d in detected(found(*rows), across=False)] == ["chair", "sofa"]
    assert len(detected(found(*rows), iou=None)) == 3
    # A smaller one inside is another object, not a part.
    assert len(detected(found((BOX, chair), ([12.0, 25.0, 20.0, 40.0], [0, 0.5, 0, 0, 0, 0, 0])))) == 2


def test_masks_follow_their_boxes_through_sorting() -> None:
    chair = [0, 0.5, 0, 0, 0, 0, 0]
    halves = [np.where(np.arange(10) < 5, 1.0, -1.0), np.where(np.arange(10) < 5, -1.0, 1.0)]
    maps = [np.tile(h.astype(np.float32), (10, 1)) for h in halves] + [np.full((10, 10), -1.0, np.float32)]
    rows = ([0, 0, 50, 100], chair), ([50, 0, 100, 100], [0, 0.9, 0, 0, 0, 0, 0]), ([0, 0, 20, 20], chair)
    right, left, none = detected(found(*rows, mask_of=maps.__getitem__))
    assert right.score == 0.9 and none.mask is None
    assert left.mask is not None and right.mask is not None and left.mask.shape == (100, 200)
    np.testing.assert_array_equal(np.flatnonzero(left.mask.all(axis=0)), np.arange(100))
    np.testing.assert_array_equal(left.mask, ~right.mask)


def test_masks_end_at_their_boxes_where_asked() -> None:
    everywhere = np.ones((4, 4), np.float32)
    row = ([10, 20, 30, 60.5], [0, 0.5, 0, 0, 0, 0, 0])
    (d,) = detected(found(row, mask_of=lambda i: everywhere, crop=True))
    expected = np.zeros((100, 200), np.bool_)
    expected[20:60, 20:60] = True
    np.testing.assert_array_equal(d.mask, expected)
    (d,) = detected(found(row, mask_of=lambda i: everywhere))
    assert d.mask is not None and d.mask.all()


def test_no_more_than_asked_for_and_than_memory_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [([10.0 * i, 0, 10.0 * i + 9, 50], [0, 0.9 - 0.05 * i, 0, 0, 0, 0, 0]) for i in range(9)]
    assert [d.score for d in detected(found(*rows), most=2)] == pytest.approx([0.9, 0.85])
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 3 * 200 * 100)
    assert len(detected(found(*rows))) == 9
    assert len(detected(found(*rows, mask_of=lambda i: np.ones((2, 2), np.float32)))) == 3


def test_instances_must_fit() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        Instances(np.zeros((2, 4)), np.zeros((3, 5)))
