"""Masks by the network: where they land in the photo, and how well they fit real objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.detection.mask_crop import CONTEXT, SIDE, MaskCrop
from cadpose.detection.mask_network import BEYOND, NetworkMasks
from cadpose.geometry.boxes import Box, mask_iou
from cadpose.photos import read_photo
from cadpose.records import Photo

PHOTO = Photo(np.random.default_rng(0).integers(0, 256, (90, 140, 3), dtype=np.uint8))


class Sees:
    """In the place of the network: what it answers is a function of the crop's pixel grid and the box."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer
        self.boxes: list[np.ndarray] = []

    def run(self, _names: list[str], inputs: dict[str, Any]) -> list[Any]:
        assert inputs["images"].shape == (1, SIDE, SIDE, 3)
        self.boxes.append(inputs["boxes"][0])
        y, x = np.mgrid[:SIDE, :SIDE] + 0.5
        return [self.answer(x, y, inputs["boxes"][0])[None].astype(np.float32), np.array([0.9], np.float32)]


def masks(answer: Any) -> tuple[NetworkMasks, Sees]:
    made = NetworkMasks()
    seen = Sees(answer)
    made._session = seen
    return made, seen


def test_crop_shows_the_box_in_the_middle() -> None:
    crop = MaskCrop.of(PHOTO.rgb, Box(20, 30, 100, 70))
    assert crop.rgb.shape == (SIDE, SIDE, 3)
    assert crop.square.width == pytest.approx(80 * CONTEXT)
    width, height = crop.box[2] - crop.box[0], crop.box[3] - crop.box[1]
    assert width == pytest.approx(SIDE / CONTEXT)
    assert height == pytest.approx(width / 2)
    assert (crop.box[0] + crop.box[2]) / 2 == pytest.approx(SIDE / 2)


@given(st.floats(0, 100), st.floats(0, 60), st.floats(8, 100), st.floats(8, 80), st.integers(0, 3))
def test_what_the_network_sees_lands_where_it_is(
    x: float, y: float, width: float, height: float, corner: int
) -> None:
    box = Box(x, y, x + width, y + height)
    inner = box.clipped(140, 90)
    if inner is None or min(inner.width, inner.height) < 6:
        return

    def quarter(gx: np.ndarray, gy: np.ndarray, told: np.ndarray) -> np.ndarray:
        mx, my = (told[0] + told[2]) / 2, (told[1] + told[3]) / 2
        inside = (gx > told[0]) & (gx < told[2]) & (gy > told[1]) & (gy < told[3])
        return np.where(inside & ((gx > mx) == bool(corner & 1)) & ((gy > my) == bool(corner & 2)), 9.0, -9.0)

    found = masks(quarter)[0].mask(PHOTO, box)
    mx, my = inner.centre
    x0, x1 = (mx, inner.x1) if corner & 1 else (inner.x0, mx)
    y0, y1 = (my, inner.y1) if corner & 2 else (inner.y0, my)
    rows, columns = np.nonzero(found)
    step = max(inner.width, inner.height) * CONTEXT / SIDE + 1.0
    assert columns.min() + 0.5 >= x0 - step
    assert columns.max() + 0.5 <= x1 + step
    assert rows.min() + 0.5 >= y0 - step
    assert rows.max() + 0.5 <= y1 + step
    assert found.sum() >= (x1 - x0 - 2 * step) * (y1 - y0 - 2 * step)


def test_a_little_beyond_the_box_and_no_further() -> None:
    found = masks(lambda x, y, _: np.full_like(x, 5.0))[0].mask(PHOTO, Box(40, 30, 100, 60))
    rows, columns = np.nonzero(found)
    reach = BEYOND * 60
    assert (columns.min(), columns.max() + 1) == (int(40 - reach), int(np.ceil(100 + reach)))
    assert (rows.min(), rows.max() + 1) == (int(30 - reach), int(np.ceil(60 + reach)))


def test_specks_pinholes_and_what_lies_beside_the_box_are_noise() -> None:
    def answer(x: np.ndarray, y: np.ndarray, told: np.ndarray) -> np.ndarray:
        seen = (x > told[0] + 20) & (x < told[2] - 20) & (y > told[1] + 5) & (y < told[3] - 5)
        hole = (abs(x - 96) < 1.1) & (abs(y - 96) < 1.1)
        speck = (abs(x - told[0] - 8) < 2.1) & (abs(y - 96) < 2.1)
        beside = (x > told[2] + 2) & (y > told[1]) & (y < told[3])
        return np.where((seen & ~hole) | speck | beside, 9.0, -9.0)

    rgb = np.zeros((192, 192, 3), np.uint8)
    made, _ = masks(answer)
    found = made.mask(Photo(rgb), Box(25, 25, 167, 167))
    rows, columns = np.nonzero(found)
    assert (columns.min(), columns.max()) == pytest.approx((45, 146), abs=2)
    assert found[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].all()


def test_nothing_seen_gives_the_box() -> None:
    found = masks(lambda x, y, _: np.full_like(x, -5.0))[0].mask(PHOTO, Box(40, 30, 100, 60))
    assert found.sum() == 60 * 30
    assert found[30:60, 40:100].all()


def test_box_outside_the_photo() -> None:
    with pytest.raises(ValueError, match="outside"):
        NetworkMasks().mask(PHOTO, Box(200, 30, 240, 60))


def test_shipped_network_on_shapes() -> None:
    """A bright plate with a hole before a noisy wall, a dark bar across it."""
    rng = np.random.default_rng(1)
    rgb = rng.integers(60, 120, (300, 400, 3)).astype(np.uint8)
    true = np.zeros((300, 400), np.bool_)
    true[80:220, 120:280] = True
    true[120:180, 170:230] = False
    rgb[true] = (220, 190, 60)
    found = NetworkMasks().mask(Photo(rgb), Box(118, 78, 282, 222))
    assert mask_iou(found, true) > 0.75
    again = NetworkMasks().mask(Photo(rgb), Box(118, 78, 282, 222))
    assert np.array_equal(found, again)


def test_shipped_network_on_a_real_bed(bench: Path) -> None:
    from cadpose.datasets.scene_sets import open_scenes

    overlaps = []
    for scene in open_scenes(bench / "bench" / "pix3d_beds").scenes:
        photo = read_photo(scene.photo)
        for one in scene.objects(photo):
            assert one.mask is not None
            overlaps.append(mask_iou(NetworkMasks().mask(photo, one.box), one.mask(photo)))
    assert len(overlaps) == 3
    # The true masks are of the CAD model, bare of bedding.
    assert np.mean(overlaps) > 0.7
