from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cadpose.detection import brush_rle
from cadpose.detection.brush_rle import decode_brush
from tests.detection.brush_writing import brush_stream

# Written by label-studio-converter 0.0.59 (Apache-2.0), ``brush.mask2rle``: 255 in rows 1 to 3 and columns
# 2 to 5 of 5 x 7 pixels, and in an ellipse of 24 x 40 pixels.
BLOCK = [0, 0, 0, 140, 57, 27, 254, 35, 0, 191, 255, 108, 2, 255, 253, 176, 11, 255, 248, 124, 0]
ELLIPSE = [
    0, 0, 15, 0, 57, 27, 255, 2, 23, 0, 198, 127, 249, 124, 3, 37, 255, 228, 176, 12, 183, 255, 143, 192, 51,
    31, 254, 55, 0, 205, 127, 248, 188, 3, 57, 255, 226, 176, 12, 231, 255, 138, 192, 51, 159, 254, 43, 0,
    206, 127, 248, 172, 3, 57, 255, 226, 176, 12, 231, 255, 138, 192, 51, 159, 254, 47, 0, 205, 127, 248,
    220, 3, 49, 255, 227, 240, 12, 183, 255, 146, 192, 50, 95, 254, 95, 0, 198, 127, 252, 10, 204, 0,
]  # fmt: skip


def test_label_studios_own_streams() -> None:
    block = np.zeros((5, 7), np.bool_)
    block[1:4, 2:6] = True
    np.testing.assert_array_equal(decode_brush(bytes(BLOCK), 7, 5), block)
    y, x = np.mgrid[:24, :40]
    ellipse = ((x - 20) / 15) ** 2 + ((y - 11) / 9) ** 2 < 1
    np.testing.assert_array_equal(decode_brush(bytes(ELLIPSE), 40, 24), ellipse)


def test_the_writer_of_these_tests_writes_the_same() -> None:
    block = np.zeros((5, 7, 4), np.uint8)
    block[1:4, 2:6] = 255
    # The converter ends with a byte of zeros where eight bits are full already.
    assert brush_stream(block) == bytes(BLOCK[: len(brush_stream(block))])


def pictures(draw_from: st.SearchStrategy[int]) -> st.SearchStrategy[NDArray[np.uint8]]:
    sizes = st.tuples(st.integers(1, 9), st.integers(1, 9))
    return sizes.flatmap(
        lambda s: st.lists(draw_from, min_size=4 * s[0] * s[1], max_size=4 * s[0] * s[1]).map(
            lambda v: np.array(v, np.uint8).reshape(s[0], s[1], 4)
        )
    )


@given(
    pictures(st.one_of(st.sampled_from([0, 255]), st.integers(0, 255))),
    st.booleans(),
    st.sampled_from([(3, 4, 8, 16), (1, 2, 3, 9), (2, 5, 7, 16)]),
)
def test_any_picture_comes_back(rgba: NDArray[np.uint8], literal: bool, sizes: tuple[int, ...]) -> None:
    stream = brush_stream(rgba, literal=literal, sizes=sizes)
    mask = decode_brush(stream, rgba.shape[1], rgba.shape[0])
    np.testing.assert_array_equal(mask, rgba[..., 3] >= 128)


@given(st.binary(max_size=200))
def test_noise_is_a_mask_or_told(noise: bytes) -> None:
    head = bytes([0, 0, 0, 140, 57, 27, 255])  # of 35 pixels
    for stream in (noise, head + noise):
        try:
            assert decode_brush(stream, 7, 5).shape == (5, 7)
        except ValueError as error:
            assert "brush mask" in str(error)


@pytest.mark.parametrize(
    ("stream", "size", "told"),
    [
        (b"", (7, 5), "cut short"),
        (bytes(BLOCK[:6]), (7, 5), "cut short"),
        (bytes(BLOCK[:-6]), (7, 5), "cut short"),
        (bytes(BLOCK), (5, 5), "140 values"),
        (bytes([255] * 4 + BLOCK[4:]), (7, 5), "4294967295 values"),
        (bytes([*BLOCK[:4], 0xF9, *BLOCK[5:]]), (7, 5), "no bytes"),
        (bytes([0, 0, 0, 4, 57, 27, 255, 0xFF, 0xFF]), (1, 1), "past its end"),
        (bytes(BLOCK), (10**5, 10**5), "above the limit"),
    ],
)
def test_what_does_not_fit(stream: bytes, size: tuple[int, int], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        decode_brush(stream, *size)


def test_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brush_rle, "MAX_BYTES", 10)
    with pytest.raises(ValueError, match="MB"):
        decode_brush(bytes(BLOCK), 7, 5)
