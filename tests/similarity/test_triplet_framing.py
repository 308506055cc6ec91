from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.records import Views
from cadpose.similarity.triplet_framing import Framing


def test_langers_numbers() -> None:
    framing = Framing()
    assert (framing.side, framing.longer, framing.masked) == (256, 150, True)
    seen = framing.photo(np.full((224, 224, 3), 200, np.uint8))
    # As in the published code: rows and columns 53 to 202.
    assert (seen[53:203, 53:203] == 200).all()
    seen[53:203, 53:203] = 0
    assert not seen.any()


def test_the_mask_takes_the_background_away() -> None:
    crop = np.full((60, 60, 3), 90, np.uint8)
    mask = np.zeros((60, 60), np.bool_)
    mask[10:40, 20:50] = True
    inside = Framing(side=60, longer=60).photo(crop, mask)
    np.testing.assert_array_equal(inside, np.where(mask[..., None], crop, 0))
    # Without masking the box still ends where it ends.
    plain = Framing(side=60, longer=60, masked=False).photo(crop, mask, aspect=2.0)
    assert (plain[15:45] == 90).all() and not plain[:15].any() and not plain[45:].any()
    upright = Framing(side=60, longer=60).photo(crop, aspect=0.5)
    np.testing.assert_array_equal(upright, plain.swapaxes(0, 1))
    # A mask that is nowhere would leave nothing to look at.
    np.testing.assert_array_equal(Framing(side=60, longer=60).photo(crop, ~mask & mask), crop)


@given(st.integers(1, 64), st.floats(0.01, 100))
def test_what_lies_beside_the_box_is_black(size: int, aspect: float) -> None:
    seen = Framing(side=64, longer=size, masked=False).photo(
        np.full((size, size, 3), 255, np.uint8), aspect=aspect
    )
    shown = seen[..., 0] == 255
    rows, columns = shown.any(axis=1).sum(), shown.any(axis=0).sum()
    shorter = size * min(aspect, 1 / aspect)
    assert max(rows, columns) == size and shown.sum() == rows * columns
    # Pixels that the box covers in part are left out, but never all.
    assert min(rows, columns) <= max(shorter, 2) + 1e-6
    assert min(rows, columns) > shorter - 2 - 1e-6 and min(rows, columns) >= 1


def test_renders_stand_on_black() -> None:
    alpha = np.zeros((2, 8, 8), np.uint8)
    alpha[0, :4] = 255
    alpha[1, 4:] = 128
    views = Views(np.full((2, 8, 8, 3), 100, np.uint8), alpha, np.ones((2, 8, 8), np.float32))
    seen = Framing(side=16, longer=8).renders(views)
    assert seen.shape == (2, 16, 16, 3)
    assert (seen[0, 4:8, 4:12] == 100).all() and (seen[1, 8:12, 4:12] == 50).all()
    assert seen[0].sum() == 4 * 8 * 3 * 100 and seen[1].sum() == 4 * 8 * 3 * 50


def test_it_is_written_and_read() -> None:
    framing = Framing(100, 40, False)
    assert Framing.from_json(framing.to_json()) == framing
    for text in ("[]", "{}", "nothing", '{"side": 256, "longer": 150, "masked": 1}', '{"side": 256}'):
        with pytest.raises(ValueError):
            Framing.from_json(text)


def test_what_does_not_fit() -> None:
    for side, longer in ((8, 8), (64, 65), (64, 0), (4096, 10)):
        with pytest.raises(ValueError, match="do not fit"):
            Framing(side, longer)
    crop = np.zeros((32, 32, 3), np.uint8)
    for wrong in (crop[:, :20], crop[..., 0]):
        with pytest.raises(ValueError, match="a crop must be"):
            Framing().photo(wrong)
    with pytest.raises(ValueError, match="the mask must be"):
        Framing().photo(crop, np.ones((8, 8), np.bool_))
    for aspect in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="positive"):
            Framing().photo(crop, aspect=aspect)
    oblong = Views(
        np.zeros((1, 4, 8, 3), np.uint8), np.zeros((1, 4, 8), np.uint8), np.zeros((1, 4, 8), np.float32)
    )
    with pytest.raises(ValueError, match="square"):
        Framing().renders(oblong)
