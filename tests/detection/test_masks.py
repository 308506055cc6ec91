from __future__ import annotations

import json
import logging
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cadpose.detection.masks import GrabCutMasks, MaskEstimator
from cadpose.geometry.boxes import Box, mask_iou
from cadpose.photos import read_photo
from cadpose.records import Mask, Photo


def scene(height: int = 240, width: int = 320) -> tuple[NDArray[np.uint8], Mask]:
    """A noisy red disc with a hole on a noisy green ground."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    distance = np.hypot(x - 0.55 * width, y - 0.5 * height) / height
    disc = (distance < 0.35) & (distance > 0.12)
    rgb = np.where(disc[..., None], (190, 40, 30), (60, 120, 70)) + rng.normal(0, 12, (height, width, 3))
    return np.clip(rgb, 0, 255).astype(np.uint8), disc


def test_separates_an_object_from_plain_ground() -> None:
    rgb, disc = scene()
    estimator: MaskEstimator = GrabCutMasks()
    mask = estimator.mask(Photo(rgb=rgb), Box.from_mask(disc))
    assert mask.shape == disc.shape and mask.dtype == np.bool_
    assert mask_iou(mask, disc) > 0.95


def test_large_photos_are_segmented_small_and_come_back_in_full_size() -> None:
    rgb, disc = scene(1200, 1600)
    mask = GrabCutMasks().mask(Photo(rgb=rgb), Box.from_mask(disc))
    assert mask.shape == (1200, 1600) and mask_iou(mask, disc) > 0.93


def test_nothing_outside_the_box_and_the_same_again() -> None:
    rgb, _ = scene()
    box = Box(100.5, 60.2, 200.9, 170.7)
    one, two = (GrabCutMasks(seed=3).mask(Photo(rgb=rgb), box) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    outside = np.ones_like(one)
    outside[60:171, 100:201] = False
    assert one.any() and not (one & outside).any()


@pytest.mark.parametrize("box", [Box(0, 0, 320, 240), Box(-40, -30, 400, 300)])
def test_box_that_fills_the_photo(box: Box) -> None:
    rgb, _ = scene()
    mask = GrabCutMasks().mask(Photo(rgb=rgb), box)
    assert 0.1 < mask.mean() <= 1.0


def test_one_colour_gives_the_ellipse_or_the_box_and_never_nothing(caplog: pytest.LogCaptureFixture) -> None:
    photo = Photo(rgb=np.full((100, 100, 3), 128, np.uint8))
    with caplog.at_level(logging.INFO, logger="cadpose"):
        mask = GrabCutMasks().mask(photo, Box(20, 20, 80, 60))
    share = mask[20:60, 20:80].mean()
    assert share == pytest.approx(1.0) or (
        share == pytest.approx(np.pi / 4, abs=0.05) and "ellipse" in caplog.text
    )


@pytest.mark.parametrize("box", [Box(10, 10, 11, 11), Box(10.2, 10.2, 10.6, 10.6), Box(0, 50, 100, 51)])
def test_slivers_and_specks(box: Box) -> None:
    mask = GrabCutMasks().mask(Photo(rgb=scene()[0]), box)
    assert mask.any() and mask.sum() <= 101 * 2


def test_box_outside_the_photo() -> None:
    with pytest.raises(ValueError, match="outside"):
        GrabCutMasks().mask(Photo(rgb=scene()[0]), Box(500, 500, 600, 600))


def test_real_beds(bench: Path) -> None:
    """Better than the box's ellipse on photos with a mask drawn by hand."""
    folder = bench / "bench" / "pix3d_beds"
    overlaps = []
    for entry in json.loads((folder / "pix3d.json").read_text()):
        with Image.open(folder / entry["mask"]) as image:
            truth = np.asarray(image.convert("L")) > 127
        mask = GrabCutMasks().mask(read_photo(folder / entry["img"]), Box.from_mask(truth))
        overlaps.append(mask_iou(mask, truth))
    assert np.mean(overlaps) > 0.75
