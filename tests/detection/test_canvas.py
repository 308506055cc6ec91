from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.detection.canvas import Canvas, network_input
from cadpose.detection.onnx_head import HeadInput


def wanted(**how: Any) -> HeadInput:
    return HeadInput.model_validate({"name": "x", "resize": "stretch", **how})


SHAPES = [
    {"size": (64, 48)},
    {"longest": 100, "multiple": 32},
    {"size": (64, 48), "resize": "letterbox"},
    {"size": (64, 48), "resize": "letterbox", "place": "corner"},
    {"longest": 100, "multiple": 32, "resize": "letterbox"},
]


@pytest.mark.parametrize("how", SHAPES, ids=str)
@given(width=st.integers(1, 900), height=st.integers(1, 900), data=st.data())
def test_boxes_return_to_where_they_were(how: dict[str, Any], width: int, height: int, data: Any) -> None:
    told = wanted(**how)
    canvas = Canvas.of(width, height, told)
    corners = np.array([[0.0, 0.0, width, height], [0.25 * width, 0.5 * height, 0.5 * width, 0.75 * height]])
    inside = corners * np.array(canvas.scale * 2) + np.array([canvas.inner[0], canvas.inner[1]] * 2)
    np.testing.assert_allclose(inside[0], canvas.inner, atol=1e-9)
    np.testing.assert_allclose(canvas.to_photo(inside), corners, atol=1e-6)
    if told.size is None:
        assert all(side % told.multiple == 0 for side in canvas.size)
    else:
        assert canvas.size == told.size
    if told.resize == "letterbox" and min(width, height) > 200:
        assert canvas.scale[0] == pytest.approx(canvas.scale[1], rel=0.1)


def test_letterbox_of_a_known_photo() -> None:
    centred = Canvas.of(200, 100, wanted(size=(64, 64), resize="letterbox"))
    assert centred.inner == (0, 16, 64, 48)
    assert Canvas.of(200, 100, wanted(size=(64, 64), resize="letterbox", place="corner")).inner == (
        0,
        0,
        64,
        32,
    )
    assert Canvas.of(200, 100, wanted(longest=64, multiple=32, resize="letterbox")).size == (64, 32)
    assert Canvas.of(100, 200, wanted(longest=100, multiple=32)).size == (64, 96)
    np.testing.assert_allclose(centred.to_photo(np.array([[0.0, 16.0, 32.0, 32.0]])), [[0, 0, 100, 50]])
    with pytest.raises(ValueError, match="no place"):
        Canvas((5, 5), (4, 4), (0, 0, 5, 4))


def test_pixels_are_scaled_swapped_and_padded() -> None:
    rgb = np.zeros((2, 4, 3), np.uint8)
    rgb[..., 0], rgb[..., 2] = 100, 20
    told = wanted(
        size=(4, 4), resize="letterbox", pad=50, channels="bgr", scale=0.5, mean=(1, 2, 3), std=(1, 2, 4)
    )
    x = network_input(rgb, Canvas.of(4, 2, told), told)
    assert x.shape == (1, 3, 4, 4) and x.dtype == np.float32
    # Blue comes first: (20 / 2 - 1) / 1, (0 - 2) / 2, (100 / 2 - 3) / 4; around it 50 / 2 instead.
    np.testing.assert_allclose(x[0, :, 1, 2], [9.0, -1.0, 11.75], rtol=1e-6)
    np.testing.assert_allclose(x[0, :, 0, 2], [24.0, 11.5, 5.5], rtol=1e-6)
    last = told.model_copy(update={"layout": "nhwc"})
    np.testing.assert_array_equal(network_input(rgb, Canvas.of(4, 2, last), last), x.transpose(0, 2, 3, 1))


def test_antialiasing_averages_and_its_absence_does_not() -> None:
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[:, ::8] = 255
    smooth = wanted(size=(8, 8), scale=1.0, antialias=True)
    assert np.ptp(network_input(stripes, Canvas.of(64, 64, smooth), smooth)) <= 1
    sharp = wanted(size=(8, 8), scale=1.0)
    assert network_input(stripes, Canvas.of(64, 64, sharp), sharp).max() == 0  # falls between the stripes


@given(
    st.integers(2, 120), st.integers(2, 120), st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1)
)
def test_a_stretched_mask_is_what_opencv_resizes(w: int, h: int, cols: int, rows: int, seed: int) -> None:
    maps = np.random.default_rng(seed).normal(size=(rows, cols)).astype(np.float32)
    canvas = Canvas((w, h), (64, 48), (0, 0, 64, 48))
    # OpenCV puts pixels' middles where we do, and lets the border go on.
    reference = cv2.resize(maps, (w, h), interpolation=cv2.INTER_LINEAR)
    assert (canvas.mask(maps) == (reference > 0))[np.abs(reference) > 1e-3].all()


@pytest.mark.parametrize("how", SHAPES, ids=str)
def test_a_mask_lands_on_its_object(how: dict[str, Any]) -> None:
    told = wanted(**how)
    canvas = Canvas.of(300, 180, told)
    truth = np.zeros((180, 300), np.uint8)
    truth[60:150, 30:120] = 255
    drawn = canvas.filled(np.repeat(truth[..., None], 3, axis=2), 0)[..., 0] / np.float32(255) - 0.5
    mask = canvas.mask(drawn.astype(np.float32))
    ys, xs = np.nonzero(mask != (truth > 0))
    step = 1.5 / min(canvas.scale)
    near = [(abs(ys - e) <= step) for e in (60, 150)] + [(abs(xs - e) <= step) for e in (30, 120)]
    assert mask.shape == (180, 300) and np.any(near, axis=0).all()


def test_an_empty_mask_and_one_of_a_single_cell() -> None:
    canvas = Canvas((30, 20), (64, 64), (0, 0, 64, 64))
    assert not canvas.mask(np.full((4, 4), -1.0, np.float32)).any()
    assert canvas.mask(np.ones((1, 1), np.float32)).all()
