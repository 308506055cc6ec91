"""Crops in training are those that the network sees when it is used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")

from cadpose.detection.mask_crop import SIDE, MaskCrop
from cadpose.geometry.boxes import Box
from cadpose.training.lite.augment import NOTHING
from cadpose.training.masks.crops import crops
from cadpose.training.masks.stream import MaskedObjects


def _object(box: tuple[float, float, float, float], side: int = 128) -> MaskedObjects:
    y, x = np.mgrid[:side, :side]
    smooth = np.stack([x * 255 / side, y * 255 / side, (x + y) * 127 / side]).astype(np.uint8)
    mask = np.zeros((side, side), np.bool_)
    mask[int(box[1]) : int(box[3]), int(box[0]) : int(box[2])] = True
    return MaskedObjects(
        torch.from_numpy(smooth[None]), torch.from_numpy(mask[None]), torch.tensor([box], dtype=torch.float32)
    )


def test_same_as_at_inference() -> None:
    drawn = _object((30.0, 40.0, 100.0, 90.0))
    cut = crops(drawn, NOTHING, torch.Generator().manual_seed(0))
    crop = MaskCrop.of(drawn.photos[0].permute(1, 2, 0).numpy(), Box(30.0, 40.0, 100.0, 90.0))
    np.testing.assert_allclose(cut.boxes[0].numpy(), crop.box, atol=1e-3)
    apart = np.abs(cut.images[0].permute(1, 2, 0).numpy() - crop.rgb)
    assert np.median(apart) < 2.0
    assert np.percentile(apart[8:-8, 8:-8], 99) < 6.0


def test_mask_fills_the_box_and_flips_with_the_picture() -> None:
    drawn = _object((20.0, 30.0, 60.0, 110.0))
    drawn.masks[:, :, 20:40] = False  # the right half is left
    plain = crops(drawn, NOTHING, torch.Generator().manual_seed(0))
    mirrored = crops(drawn, replace(NOTHING, flip=1.0), torch.Generator().manual_seed(0))
    x0, _, x1, _ = plain.boxes[0].tolist()
    inside = plain.masks[0, :, int(x0) : int(x1)].sum(dim=0)
    assert float(inside[: len(inside) // 2 - 2].sum()) == 0.0
    assert float(inside[len(inside) // 2 + 2 :].min()) > 0.0
    np.testing.assert_allclose(mirrored.masks.flip(2), plain.masks, atol=1e-4)
    np.testing.assert_allclose(mirrored.images.flip(3), plain.images, atol=0.1)


def test_jitter_moves_each_side_by_no_more_than_told() -> None:
    drawn = _object((32.0, 32.0, 96.0, 96.0))
    many = MaskedObjects(*(t.repeat(64, *[1] * (t.dim() - 1)) for t in drawn.fields()))
    cut = crops(many, replace(NOTHING, jitter=0.1), torch.Generator().manual_seed(0))
    sides = cut.boxes[:, 2:] - cut.boxes[:, :2]
    assert float(sides.min() / sides.max()) >= 0.8 / 1.2
    assert len(torch.unique(cut.boxes[:, 0])) > 10
    assert float(cut.boxes.min()) >= 0.0
    assert float(cut.boxes.max()) <= SIDE
