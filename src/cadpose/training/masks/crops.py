"""What the network sees of an object in training: a crop with flaws, a box a little off, the mask."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from cadpose.detection.mask_crop import CONTEXT, FILL, SIDE
from cadpose.training.lite.augment import Augmentation, flawed
from cadpose.training.masks.stream import MaskedObjects


@dataclass(frozen=True)
class Crops:
    """N crops.

    Attributes:
        images: (N, 3, SIDE, SIDE) float32 in [0, 255].
        boxes: (N, 4) float32 in pixels of the crop.
        masks: (N, SIDE, SIDE) float32, share of each pixel that the object covers.
    """

    images: Tensor
    boxes: Tensor
    masks: Tensor


def crops(drawn: MaskedObjects, options: Augmentation, generator: torch.Generator) -> Crops:
    """Crops as :class:`cadpose.detection.mask_crop.MaskCrop` cuts them, with flaws.

    Args:
        drawn: The objects.
        options: ``jitter``, ``flip`` and what :func:`flawed` does are used.
        generator: Of the objects' device.
    """
    n, side = len(drawn), drawn.photos.shape[-1]
    device = drawn.photos.device
    box = drawn.boxes
    size = (box[:, 2:] - box[:, :2]).clamp(min=4.0)
    move = (torch.rand((n, 4), generator=generator, device=device) * 2.0 - 1.0) * options.jitter
    box = (box + move * size.repeat(1, 2)).clamp(0.0, float(side))
    size = (box[:, 2:] - box[:, :2]).clamp(min=4.0)
    centre, square = (box[:, :2] + box[:, 2:]) / 2, size.amax(dim=1) * CONTEXT
    mirror = torch.where(torch.rand(n, generator=generator, device=device) < options.flip, -1.0, 1.0)
    theta = torch.zeros((n, 2, 3), device=device)
    theta[:, 0, 0], theta[:, 1, 1] = mirror * square / side, square / side
    theta[:, :, 2] = centre * 2.0 / side - 1.0
    grid = functional.affine_grid(theta, [n, 3, SIDE, SIDE], align_corners=False)
    both = torch.cat([drawn.photos.float() - FILL, drawn.masks[:, None].float()], dim=1)
    cut = functional.grid_sample(both, grid, padding_mode="zeros", align_corners=False)
    half = size / square[:, None] * SIDE / 2
    boxes = torch.cat([SIDE / 2 - half, SIDE / 2 + half], dim=1)
    return Crops(flawed(cut[:, :3] + FILL, options, generator), boxes, cut[:, 3].contiguous())
