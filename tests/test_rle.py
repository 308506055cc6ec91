from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from cadpose.records import Mask
from cadpose.rle import MAX_PIXELS, decode_mask, encode_mask, runs_from_text, text_from_runs


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=40), elements=st.booleans()))
def test_a_mask_comes_back(mask: Mask) -> None:
    counts = encode_mask(mask)
    assert np.array_equal(decode_mask(mask.shape, counts), mask)
    assert all(run > 0 for run in counts[1:])


def test_runs_go_down_the_columns_and_start_with_background() -> None:
    mask = np.array([[True, False, False], [True, False, True]])
    assert encode_mask(mask) == [0, 2, 3, 1]
    assert encode_mask(~mask) == [2, 3, 1]
    assert encode_mask(np.zeros((3, 4), np.bool_)) == [12]


def test_runs_of_zero_are_read() -> None:
    assert decode_mask((1, 4), [1, 0, 1, 2]).tolist() == [[False, False, True, True]]


@pytest.mark.parametrize(
    ("size", "counts", "message"),
    [
        ((2, 3), [5], "add up to 5"),
        ((2, 3), [7, -1], "negative"),
        ((0, 3), [0], "at least 1"),
        ((2, 3, 1), [6], "height, width"),
        ((MAX_PIXELS, 2), [2 * MAX_PIXELS], "above the limit"),
    ],
)
def test_bad_runs_are_refused(size: tuple[int, ...], counts: list[int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        decode_mask(size, counts)


@given(st.lists(st.integers(0, 1 << 20)))
def test_runs_come_back_from_text(runs: list[int]) -> None:
    assert runs_from_text(text_from_runs(runs)) == runs


def test_text_is_what_coco_writes() -> None:
    # As pycocotools 2.0 encodes a 10 x 10 mask whose rows 2 to 4 and columns 3 to 6 are set.
    mask = np.zeros((10, 10), np.bool_)
    mask[2:5, 3:7] = True
    assert text_from_runs(encode_mask(mask)) == "P13700000l0"


@pytest.mark.parametrize("runs", [[3, -1], [1 << 40]])
def test_runs_that_text_cannot_hold_are_refused(runs: list[int]) -> None:
    with pytest.raises(ValueError, match="must be between"):
        text_from_runs(runs)
