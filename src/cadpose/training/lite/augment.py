"""Crops and their flaws, made on the device that trains: drawing new photos takes time enough."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from cadpose.encoder import SIDE
from cadpose.photos import FILL
from cadpose.training.lite.objective import Targets


@dataclass(frozen=True)
class Augmentation:
    """Chances in [0, 1] and sizes of what is done to a crop.

    Attributes:
        jitter: Each side of the box moves by up to this share of its length.
        visible_box: Chance that the box bounds what is seen rather than the whole object.
        context: Chance that the photo beside the box is shown, where otherwise there is white.
        flip: Chance of a mirrored crop.
        turn: Chance of a turn in the image plane, by up to ``turn_degrees``.
        turn_degrees: Degrees.
        colour: Strength of changes of brightness, contrast and saturation.
        grey: Chance of a grey crop.
        small: Chance of a crop reduced to 24 to 112 pixels.
        blur: Chance of a blurred crop.
        noise: Chance of a noisy crop.
        erase: Chance of a patch of one colour.
    """

    jitter: float = 0.12
    visible_box: float = 0.3
    context: float = 0.2
    flip: float = 0.5
    turn: float = 0.3
    turn_degrees: float = 20.0
    colour: float = 0.4
    grey: float = 0.12
    small: float = 0.25
    blur: float = 0.25
    noise: float = 0.3
    erase: float = 0.15


NOTHING = Augmentation(*([0.0] * 12))
#: What an ordinary photo and a detector's box may do.
GENTLE = Augmentation(
    jitter=0.1, turn_degrees=15.0, colour=0.2, grey=0.08, small=0.15, blur=0.1, noise=0.15, erase=0.0
)


def crops(
    photos: Tensor,
    boxes: Tensor,
    visible_boxes: Tensor,
    targets: Targets,
    options: Augmentation,
    generator: torch.Generator,
) -> tuple[Tensor, Targets]:
    """Square crops as :func:`cadpose.photos.crop_square` cuts them, changed at random, and their targets.

    Args:
        photos: (N, 3, S, S) uint8.
        boxes: (N, 4) x0, y0, x1, y1 of the whole objects in pixels.
        visible_boxes: (N, 4) of what is seen of them.
        targets: Of the photos.
        options: What is done.
        generator: Of the photos' device.

    Returns:
        (N, 3, 224, 224) float32 in [0, 255] and the targets after flips and turns.
    """
    n, side = len(photos), photos.shape[-1]
    device = photos.device

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return torch.rand(n, *shape, generator=generator, device=device) * (high - low) + low

    def chance(share: float) -> Tensor:
        return torch.rand(n, generator=generator, device=device) < share

    box = torch.where(chance(options.visible_box)[:, None], visible_boxes, boxes.clamp(0, side))
    size = (box[:, 2:] - box[:, :2]).clamp(min=4.0)
    box = box + uniform(-options.jitter, options.jitter, 4) * size.repeat(1, 2)
    size = (box[:, 2:] - box[:, :2]).clamp(min=4.0)
    centre = (box[:, :2] + box[:, 2:]) / 2
    longer = size.amax(dim=1)

    most = options.turn_degrees
    turn = torch.where(chance(options.turn), uniform(-most, most), 0.0)
    mirror = torch.where(chance(options.flip), -1.0, 1.0)
    c, s = torch.deg2rad(turn).cos(), torch.deg2rad(turn).sin()
    # From the crop to the photo: mirrored, then turned back clockwise, then scaled to the box.
    linear = torch.stack([torch.stack([c * mirror, -s], -1), torch.stack([s * mirror, c], -1)], -2)
    scale = longer / side
    theta = torch.cat([linear * scale[:, None, None], (centre * 2 / side - 1.0)[..., None]], dim=2)
    grid = functional.affine_grid(theta, [n, 3, SIDE, SIDE], align_corners=False)
    picture = functional.grid_sample(photos.float() - FILL, grid, padding_mode="zeros", align_corners=False)
    reach = (torch.arange(SIDE, device=device, dtype=torch.float32) + 0.5) * 2 / SIDE - 1.0
    share = size / longer[:, None]
    inside = (reach.abs()[None, None, :] <= share[:, 0, None, None]) & (
        reach.abs()[None, :, None] <= share[:, 1, None, None]
    )
    inside = inside | chance(options.context)[:, None, None]
    picture = picture * inside[:, None] + FILL

    angles = targets.angles.clone()
    angles[:, 0] = angles[:, 0] * mirror
    angles[:, 2] = (angles[:, 2] + turn) * mirror
    return flawed(picture, options, generator), Targets(angles, targets.turns)


def flawed(picture: Tensor, options: Augmentation, generator: torch.Generator) -> Tensor:
    """(N, 3, H, W) float in [0, 255] with colours, sharpness and noise changed."""
    n, device = len(picture), picture.device

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return torch.rand(n, *shape, generator=generator, device=device) * (high - low) + low

    def chance(share: float) -> Tensor:
        return torch.rand(n, generator=generator, device=device) < share

    a = options.colour
    if a > 0 or options.grey > 0:
        grey = (picture * picture.new_tensor([0.299, 0.587, 0.114])[None, :, None, None]).sum(1, keepdim=True)
        keep = torch.where(chance(options.grey), torch.zeros(n, device=device), uniform(1 - a, 1 + a))
        picture = grey + (picture - grey) * keep[:, None, None, None]
        mean = picture.mean(dim=(1, 2, 3), keepdim=True)
        gain = uniform(1 - a, 1 + a)[:, None, None, None] * uniform(1 - a / 6, 1 + a / 6, 3)[..., None, None]
        picture = (picture - mean) * uniform(1 - a, 1 + a)[:, None, None, None] + mean * gain
        picture = picture.clamp(0, 255)
    picture = _reduced(picture, options.small, generator)
    picture = _blurred(picture, options.blur, generator)
    if options.noise > 0:
        strength = chance(options.noise) * uniform(2.0, 16.0)
        noise = torch.randn(picture.shape, generator=generator, device=device)
        picture = picture + noise * strength[:, None, None, None]
    if options.erase > 0:
        picture = _erased(picture, chance(options.erase), uniform(0, 1, 4), uniform(0, 255, 3))
    return picture.clamp(0, 255)


def _reduced(picture: Tensor, share: float, generator: torch.Generator) -> Tensor:
    """A share of the batch at low resolution, in four groups of one size each."""
    out = picture.clone()
    n, full = len(picture), picture.shape[-1]
    for group in torch.randperm(n, generator=generator, device=picture.device)[: round(n * share)].chunk(4):
        if len(group) and share > 0:
            draw = float(torch.rand((), generator=generator, device=picture.device))
            side = round(24 * (112 / 24) ** draw)
            small = functional.interpolate(picture[group], size=(side, side), mode="area")
            out[group] = functional.interpolate(small, size=(full, full), mode="bicubic", align_corners=False)
    return out


def _blurred(picture: Tensor, share: float, generator: torch.Generator) -> Tensor:
    out = picture.clone()
    n = len(picture)
    for group in torch.randperm(n, generator=generator, device=picture.device)[: round(n * share)].chunk(3):
        if len(group) and share > 0:
            sigma = 0.4 + 1.8 * float(torch.rand((), generator=generator, device=picture.device))
            x = torch.arange(-4, 5, device=picture.device, dtype=picture.dtype)
            k = torch.exp(-(x**2) / (2 * sigma**2))
            k = (k / k.sum()).expand(3, 1, -1)
            padded = functional.pad(picture[group], (4, 4, 4, 4), mode="reflect")
            wide = functional.conv2d(padded, k[:, :, None], groups=3)
            out[group] = functional.conv2d(wide, k[..., None], groups=3)
    return out


def _erased(picture: Tensor, which: Tensor, where: Tensor, colour: Tensor) -> Tensor:
    """A rectangle of 10 to 40 % of the width and height in one colour."""
    size = picture.shape[-1]
    extent = (0.1 + 0.3 * where[:, 2:]) * size
    low = where[:, :2] * (size - extent)
    at = torch.arange(size, device=picture.device, dtype=picture.dtype)
    across = (at[None] >= low[:, :1]) & (at[None] < low[:, :1] + extent[:, :1])
    down = (at[None] >= low[:, 1:]) & (at[None] < low[:, 1:] + extent[:, 1:])
    patch = (across[:, None, :] & down[:, :, None] & which[:, None, None])[:, None]
    return torch.where(patch, colour[..., None, None].expand_as(picture), picture)
