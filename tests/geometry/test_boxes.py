from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.boxes import Box, box_iou, mask_iou

coordinates = st.floats(-1000.0, 1000.0)
sides = st.floats(0.01, 1000.0)
boxes = st.builds(Box.from_xywh, coordinates, coordinates, sides, sides)
small_ints = st.integers(0, 30)


def iou(a: Box, b: Box) -> float:
    return float(box_iou(np.array(a.to_tuple()), np.array(b.to_tuple())))


@given(boxes)
def test_box_properties(box: Box) -> None:
    assert box.width > 0 and box.height > 0
    assert box.area == pytest.approx(box.width * box.height)
    assert box.x0 <= box.centre[0] <= box.x1
    np.testing.assert_allclose(Box.from_xywh(*box.to_xywh()).to_tuple(), box.to_tuple(), atol=1e-9)


@given(boxes, st.floats(0.1, 10.0))
def test_scaling_keeps_the_middle(box: Box, factor: float) -> None:
    scaled = box.scaled(factor)
    np.testing.assert_allclose(scaled.centre, box.centre, atol=1e-9)
    assert scaled.width == pytest.approx(box.width * factor, abs=1e-9)
    assert scaled.height == pytest.approx(box.height * factor, abs=1e-9)


@given(boxes, st.integers(1, 500), st.integers(1, 500))
def test_clipping_keeps_what_lies_inside(box: Box, width: int, height: int) -> None:
    clipped = box.clipped(width, height)
    overlap = max(0.0, min(box.x1, width) - max(box.x0, 0.0)) * max(
        0.0, min(box.y1, height) - max(box.y0, 0.0)
    )
    if clipped is None:
        assert overlap == 0.0
    else:
        assert clipped.area == pytest.approx(overlap)
        assert clipped.x0 >= 0 and clipped.y0 >= 0 and clipped.x1 <= width and clipped.y1 <= height


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ((0.0, 0.0, 0.0, 1.0), "empty"),
        ((0.0, 1.0, 1.0, 1.0), "empty"),
        ((5.0, 0.0, 1.0, 1.0), "empty"),
        ((math.nan, 0.0, 1.0, 1.0), "not finite"),
        ((0.0, 0.0, math.inf, 1.0), "not finite"),
    ],
)
def test_refuses_what_is_no_box(corners: tuple[float, float, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Box(*corners)


@given(boxes, boxes)
def test_iou_is_symmetric_and_within_0_and_1(a: Box, b: Box) -> None:
    assert 0.0 <= iou(a, b) <= 1.0 + 1e-12
    assert iou(a, b) == pytest.approx(iou(b, a))
    assert iou(a, a) == pytest.approx(1.0)


@given(boxes, boxes, st.floats(-100, 100), st.floats(0.5, 2.0))
def test_iou_forgets_shift_and_scale(a: Box, b: Box, shift: float, scale: float) -> None:
    moved = [Box(*(shift + scale * v for v in box.to_tuple())) for box in (a, b)]
    assert iou(*moved) == pytest.approx(iou(a, b), abs=1e-6)


@given(
    st.tuples(small_ints, small_ints, st.integers(1, 30), st.integers(1, 30)),
    st.tuples(small_ints, small_ints, st.integers(1, 30), st.integers(1, 30)),
)
def test_iou_of_boxes_is_the_iou_of_their_pixels(
    a: tuple[int, int, int, int], b: tuple[int, int, int, int]
) -> None:
    masks = []
    for x, y, w, h in (a, b):
        mask = np.zeros((60, 60), np.bool_)
        mask[y : y + h, x : x + w] = True
        masks.append(mask)
        assert Box.from_mask(mask) == Box.from_xywh(x, y, w, h), "a pixel's box ends after the pixel"
    assert iou(Box.from_xywh(*a), Box.from_xywh(*b)) == pytest.approx(mask_iou(*masks))


def test_iou_numbers_worked_by_hand() -> None:
    a = np.array([0.0, 0.0, 2.0, 2.0])
    others = np.array(
        [[1.0, 1.0, 3.0, 3.0], [0.0, 0.0, 1.0, 2.0], [2.0, 0.0, 4.0, 2.0], [5.0, 5.0, 6.0, 6.0]]
    )
    np.testing.assert_allclose(box_iou(a, others), [1 / 7, 1 / 2, 0.0, 0.0])


def test_empty_masks() -> None:
    empty = np.zeros((4, 4), np.bool_)
    assert mask_iou(empty, empty) == 0.0
    assert mask_iou(empty, ~empty) == 0.0
    with pytest.raises(ValueError, match="empty mask"):
        Box.from_mask(empty)
