"""The box-to-mask network: what it is told, and what it answers."""

from __future__ import annotations

import pytest
import torch

pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")

from cadpose.detection.mask_crop import SIDE
from cadpose.training.masks.network import STRIDES, MaskNetwork, places
from cadpose.training.masks.train import ious, mask_loss


def test_answers_a_logit_a_pixel_and_learns_in_the_decoder_only() -> None:
    network = MaskNetwork(pretrained=False).train()
    images = torch.rand(2, 3, SIDE, SIDE) * 255
    boxes = torch.tensor([[20.0, 20.0, 170.0, 170.0], [60.0, 20.0, 130.0, 170.0]])
    logits, quality = network(images, boxes)
    assert logits.shape == (2, SIDE, SIDE)
    assert quality.shape == (2,)
    (logits.mean() + quality.mean()).backward()
    assert all(p.grad is not None for p in network.decoder.parameters())
    assert all(p.grad is None for p in network.taps.parameters())
    assert not network.taps.training


def test_another_box_makes_another_mask() -> None:
    network = MaskNetwork(pretrained=False).eval()
    images = torch.rand(1, 3, SIDE, SIDE) * 255
    with torch.no_grad():
        one, _ = network(images, torch.tensor([[20.0, 20.0, 170.0, 170.0]]))
        other, _ = network(images, torch.tensor([[20.0, 20.0, 90.0, 90.0]]))
    assert float((one - other).abs().max()) > 1e-3


@pytest.mark.parametrize("stride", STRIDES)
def test_places_tell_the_box_to_the_part_of_a_cell(stride: int) -> None:
    told = places(torch.tensor([[30.0, 40.0, 150.0, 100.0]]), stride, SIDE // stride)[0]
    assert float(told[0].sum()) * stride**2 == pytest.approx(120 * 60, rel=1e-5)
    row, column = int(70 // stride), int(90 // stride)
    # The middle of the box is at (90, 70): nought to half a cell.
    assert abs(float(told[1, row, column])) <= stride / 120 + 1e-6
    assert abs(float(told[2, row, column])) <= stride / 60 + 1e-6
    assert float(told[1].max()) <= 2.0
    assert float(told[1, 0, 0]) == pytest.approx(max(-2.0, (stride / 2 - 90) / 60))


def test_loss_and_iou_of_known_masks() -> None:
    mask = torch.zeros(1, 8, 8)
    mask[:, 2:6, 2:6] = 1.0
    right, wrong = (mask * 2 - 1) * 20, (1 - mask * 2) * 20
    assert float(ious(right, mask)) == 1.0
    assert float(ious(wrong, mask)) == 0.0
    half = mask.clone()
    half[:, 4:] = 0.0
    assert float(ious((half * 2 - 1) * 20, mask)) == pytest.approx(0.5)
    assert float(mask_loss(right, mask)) < 0.01 < float(mask_loss(wrong, mask))
