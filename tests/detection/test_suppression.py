from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.detection.coco import COCO_NAMES, LIVING, is_living
from cadpose.detection.suppression import share_inside, suppress
from cadpose.geometry.boxes import Box, box_iou
from cadpose.records import Detection


def found(score: float, box: tuple[float, float, float, float], category: str = "car") -> Detection:
    return Detection(Box(*box), category, score)


WHOLE = (0.0, 0.0, 100.0, 100.0)


@pytest.mark.parametrize(
    ("box", "category", "kept"),
    [
        ((0, 0, 100, 55), "car", False),  # IoU 0.55 within one category
        ((0, 0, 100, 55), "bus", True),
        ((0, 0, 100, 65), "bus", False),  # and 0.65 across two
        ((10, 10, 30, 30), "car", False),  # a part of it
        ((10, 10, 30, 30), "wheel", True),
        ((80, 80, 200, 200), "car", True),
    ],
)
def test_the_better_of_two_on_one_place_is_kept(
    box: tuple[float, float, float, float], category: str, kept: bool
) -> None:
    better, other = found(0.9, WHOLE), found(0.8, box, category)
    assert suppress([other, better]) == ([better, other] if kept else [better])


numbers = st.floats(0, 100)
boxes = st.builds(lambda x, y, w, h: (x, y, x + w + 1, y + h + 1), numbers, numbers, numbers, numbers)


@given(st.lists(st.builds(found, st.floats(0, 1), boxes, st.sampled_from(["car", "bus"])), max_size=12))
def test_what_is_kept_overlaps_little_and_what_is_dropped_overlaps_much(all_of_them: list[Detection]) -> None:
    kept = suppress(all_of_them)
    assert [d.score for d in kept] == sorted((d.score for d in kept), reverse=True)

    def one(d: Detection, k: Detection) -> bool:
        a, b = (np.array(x.box.to_tuple()) for x in (d, k))
        alike = d.category == k.category
        return bool(box_iou(a, b) > (0.5 if alike else 0.6) or (alike and share_inside(a, b) > 0.9))

    for i, d in enumerate(kept):
        assert not any(one(d, k) for k in kept[:i])
    for d in all_of_them:
        assert d in kept or any(one(d, k) and k.score >= d.score for k in kept)
    assert suppress(kept) == kept


def test_people_animals_and_food_are_ignored() -> None:
    living = {COCO_NAMES[i] for i in LIVING}
    assert len(living) == 21 and {"person", "bird", "giraffe", "banana", "cake"} <= living
    assert not {"backpack", "chair", "teddy bear", "bowl"} & living
    assert is_living(" Person ") and not is_living("teddy bear")
