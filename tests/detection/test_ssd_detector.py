from __future__ import annotations

import numpy as np
import pytest

from cadpose.detection import Detector
from cadpose.detection.coco import COCO_NAMES
from cadpose.detection.ssd import RawBoxes
from cadpose.detection.ssd_detector import SsdDetector
from cadpose.records import Photo

PHOTO = Photo(np.zeros((100, 100, 3), np.uint8), name="a.png")
IDS = {name: i for i, name in COCO_NAMES.items()}
Seen = list[tuple[str, float, tuple[float, float, float, float]]]


class Sees:
    """Stands in for the network."""

    def __init__(self, *seen: tuple[str, float, tuple[float, float, float, float]]) -> None:
        self.seen = seen
        self.asked: list[tuple[float, bool]] = []

    def boxes(self, rgb: object, *, floor: float, tiles: bool) -> RawBoxes:
        self.asked.append((floor, tiles))
        seen = [one for one in self.seen if one[1] >= floor]
        return RawBoxes(
            np.array([box for *_, box in seen], float).reshape(-1, 4),
            np.array([IDS[name] for name, *_ in seen], np.int64),
            np.array([score for _, score, _ in seen], float),
        )


def detector(net: Sees, *categories: str, min_score: float = 0.3) -> SsdDetector:
    made = SsdDetector(categories or None, min_score)
    made.__dict__["_ssd"] = net
    return made


def test_classes_become_library_categories_best_first() -> None:
    net = Sees(
        ("suitcase", 0.4, (0, 0, 30, 30)),
        ("motorcycle", 0.9, (50, 50, 90, 90)),
        ("kite", 0.9, (0, 50, 30, 90)),
    )
    made: Detector = detector(net)
    found = made.detect(PHOTO)
    assert [(d.category, d.score, d.source) for d in found] == [
        ("motorbike", 0.9, "ssd"),
        ("bag", 0.4, "ssd"),
    ]
    assert found[0].box.to_tuple() == (50, 50, 90, 90)


def test_one_object_is_told_once_whatever_its_classes() -> None:
    twice = Sees(("car", 0.5, (0, 0, 50, 50)), ("truck", 0.8, (1, 1, 50, 50)), ("car", 0.6, (60, 0, 99, 50)))
    assert [d.category for d in detector(twice).detect(PHOTO)] == ["truck", "car"]


def test_people_and_animals_only_where_asked_for() -> None:
    net = Sees(("person", 0.9, (0, 0, 50, 50)), ("dog", 0.8, (50, 0, 99, 50)), ("chair", 0.7, (0, 0, 49, 50)))
    # Whoever sits on the chair does not take its place.
    assert [d.category for d in detector(net).detect(PHOTO)] == ["chair"]
    assert [d.category for d in detector(net, "dog", "person").detect(PHOTO)] == ["person", "dog"]


def test_threshold_and_tiles() -> None:
    net = Sees(("car", 0.2, (0, 0, 50, 50)))
    assert detector(net).detect(PHOTO) == []
    assert len(detector(net, min_score=0.1).detect(PHOTO)) == 1
    tiled = SsdDetector(tiles=True)
    tiled.__dict__["_ssd"] = net
    assert tiled.detect(PHOTO) == [] and tiled.name == "ssd:tiles"
    assert net.asked == [(pytest.approx(0.3), False), (0.1, False), (0.3, True)]
