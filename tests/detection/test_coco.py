from __future__ import annotations

import pytest

from cadpose.detection.coco import COCO_NAMES, VANS, votes
from cadpose.library.class_map import category_from_coco


@pytest.mark.parametrize(
    ("category", "wanted"),
    [
        ("bus", {"bus": 0.8, "car": 0.4}),
        ("truck", {"truck": 0.8, "car": 0.4}),
        ("car", {"car": 0.8}),
        ("chair", {"chair": 0.8}),
    ],
)
def test_what_may_be_a_van_is_a_car_by_half(category: str, wanted: dict[str, float]) -> None:
    assert votes(category, 0.8) == wanted


def test_vans_hide_among_two_classes() -> None:
    assert {name for name in COCO_NAMES.values() if category_from_coco(name) in VANS} == {"bus", "truck"}
