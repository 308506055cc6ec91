"""What is painted over, and with what."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from cadpose.poses import Pose4Dof, Rotation
from cadpose.replacement.inpainting import (
    FastMarchingInpainter,
    PatchInpainter,
    default_inpainter,
    paint_over,
)
from cadpose.replacement.region import contact_region, floor_row, removed_region
from tests.rendering.shapes import cube
from tests.replacement.scenes import SmearInpainter


def disc(x: float, y: float, r: float, size: int = 120) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    rows, columns = np.mgrid[:size, :size]
    return np.asarray((columns - x) ** 2 + (rows - y) ** 2 < r * r)


NOTHING = np.zeros((120, 120), np.bool_)


def test_the_mask_goes_with_a_rim() -> None:
    mask = disc(60, 60, 30)
    region = removed_region(mask, mask, NOTHING)
    assert region[mask].all()
    assert disc(60, 60, 31.5)[~region].sum() == 0
    assert not region[~disc(60, 60, 37)].any()


def test_what_the_mask_missed_goes_where_the_model_explains_the_mask() -> None:
    model = disc(60, 60, 30)
    mask = model & ~disc(75, 60, 12)
    assert removed_region(mask, model, NOTHING)[model].all()


def test_a_model_that_fits_badly_says_nothing() -> None:
    mask, elsewhere = disc(40, 60, 20), disc(90, 60, 20)
    assert not removed_region(mask, elsewhere, NOTHING)[60, 95]


def test_spokes_go_with_what_is_between_them() -> None:
    mask = NOTHING.copy()
    mask[20:100, 20:100:16] = True
    mask[20:24, 20:100] = True
    assert removed_region(mask, NOTHING, NOTHING)[60, 28]


def test_the_contact_shadow_lies_under_the_model() -> None:
    pose = Pose4Dof(Rotation(20.0, 25.0), 130.0, (60.0, 50.0))
    mask = disc(60, 55, 22)
    contact = contact_region(cube(), pose, mask)
    x, y = pose.project(np.array([(0.0, -0.25, 0.0)]))[0]
    assert contact[int(y), int(x)]
    assert not contact[:30].any()
    assert floor_row(cube(), pose) == pytest.approx(np.flatnonzero(contact.any(axis=1))[0], abs=4)
    below = Pose4Dof(Rotation(20.0, -25.0), 130.0, (60.0, 50.0))
    assert not contact_region(cube(), below, mask).any()
    assert floor_row(cube(), below) == np.inf


@pytest.mark.parametrize("size", [80, 600])
def test_nothing_outside_changes(size: int) -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (size, size, 3)).astype(np.uint8)
    region = disc(size / 2, size / 2, size / 4, size)
    out = paint_over(rgb, region, np.zeros_like(region), SmearInpainter(), floor=size / 2)
    assert (out[~region] == rgb[~region]).all()
    assert (out[region] != rgb[region]).any()


def test_a_red_object_leaves_no_red() -> None:
    rgb = np.full((400, 400, 3), (90, 120, 90), np.uint8)
    mask = disc(200, 200, 150, 400)
    rgb[mask] = (255, 0, 0)
    region = disc(200, 200, 153, 400)
    for inpainter in (FastMarchingInpainter(), SmearInpainter()):
        out = paint_over(rgb, region, np.zeros_like(region), inpainter)
        assert np.abs(out[region].astype(int) - (90, 120, 90)).max() < 20


@pytest.mark.parametrize("apart", ["nothing", "half of the rim", "all that is wide enough"])
def test_a_thin_rim_is_enough_not_to_be_black(apart: str) -> None:
    """Reduced, all of the photo belongs to the hole."""
    size = (1200, 1600)
    region = np.ones(size, np.bool_)
    region[:3] = region[-3:] = region[:, :3] = region[:, -3:] = False
    barred = np.zeros(size, np.bool_)
    rgb = np.zeros((*size, 3), np.uint8)
    rgb[~region] = (200, 120, 60)
    if apart == "half of the rim":
        barred[:, :800] = True
    if apart == "all that is wide enough":
        region[:, :200] = False
        barred[:, :200] = True
    rgb[barred] = (0, 0, 255)
    for inpainter in (SmearInpainter(), FastMarchingInpainter()):
        out = paint_over(rgb, region, barred, inpainter)
        assert (out[~region] == rgb[~region]).all()
        assert np.abs(out[region].astype(int) - (200, 120, 60)).max() <= 1


def test_ground_is_filled_with_ground() -> None:
    rgb = np.full((200, 200, 3), (200, 200, 255), np.uint8)
    rgb[100:] = (60, 80, 60)
    region = disc(100, 110, 40, 200)
    out = paint_over(rgb, region, np.zeros_like(region), SmearInpainter(), floor=100)
    assert np.abs(out[140, 100].astype(int) - (60, 80, 60)).max() < 12


def test_what_is_barred_is_not_copied() -> None:
    rgb = np.full((120, 120, 3), 100, np.uint8)
    other = disc(100, 60, 18)
    rgb[other] = (255, 0, 0)
    out = paint_over(rgb, disc(60, 60, 20), other, SmearInpainter())
    assert np.abs(out[60, 60].astype(int) - 100).max() <= 1


def test_a_photo_that_is_all_object() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (40, 40, 3)).astype(np.uint8)
    everything = np.ones((40, 40), np.bool_)
    assert paint_over(rgb, everything, ~everything, FastMarchingInpainter()).std(axis=(0, 1)).max() == 0


def test_patchmatch_copies_texture_and_repeats_itself() -> None:
    pytest.importorskip("patchmatch")
    rng = np.random.default_rng(0)
    rgb = (rng.integers(0, 2, (60, 60, 1)).repeat(3, axis=2) * 120 + 60).astype(np.uint8)
    region = disc(30, 30, 12, 60)
    first, second = (paint_over(rgb, region, ~np.ones_like(region), PatchInpainter(3)) for _ in range(2))
    assert (first == second).all()
    assert first[region].std() > 15
    assert default_inpainter().name == "patchmatch"


def test_without_the_package_it_is_told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("cadpose.replacement.inpainting.find_spec", lambda name: None)
    with caplog.at_level(logging.WARNING):
        assert default_inpainter().name == "telea"
    assert "cadpose[replace]" in caplog.text
