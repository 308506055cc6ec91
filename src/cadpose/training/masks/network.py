"""The box-to-mask network: Lite0's maps as they are, and a small decoder that is told the box."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.training.lite.network import imagenet_network, normalised

#: Blocks of Lite0 after which its maps are taken, the maps' strides and channels.
ENDS, STRIDES, CHANNELS = (1, 3, 5, 11), (2, 4, 8, 16), (16, 24, 40, 112)
#: Channels of the decoder at each of those strides.
WIDTHS = (24, 48, 96, 160)
#: What is known of a place: whether it is in the box, and where in it.
_TOLD = 3


class Taps(nn.Module):
    """Lite0 up to stride 16 with its ImageNet weights, never trained: what it knows of photos must stay."""

    def __init__(self, pretrained: bool = True) -> None:
        super().__init__()
        net = imagenet_network("lite0", pretrained)
        self.stem = nn.Sequential(net._conv_stem, net._bn0, nn.ReLU6())
        starts = (0, *ENDS[:-1])
        self.parts = nn.ModuleList(
            nn.Sequential(*list(net._blocks)[a:b]) for a, b in zip(starts, ENDS, strict=True)
        )
        self.requires_grad_(requires_grad=False)
        self.eval()

    def train(self, mode: bool = True) -> Taps:
        """Stay as it is: the statistics too are ImageNet's."""
        super().train(mode=False)
        return self

    def forward(self, images: Tensor) -> list[Tensor]:
        """(N, 3, S, S) RGB, (x - 127) / 128, to one map a stride of :data:`STRIDES`."""
        x, maps = self.stem(images), []
        for part in self.parts:
            x = part(x)
            maps.append(x)
        return maps


class Decoder(nn.Module):
    """Maps of :class:`Taps` and a box to the mask of the object that fills the box."""

    def __init__(self) -> None:
        super().__init__()
        self.context = nn.Sequential(
            _separable(WIDTHS[3] + _TOLD, WIDTHS[3], 5), _separable(WIDTHS[3], WIDTHS[3], 5)
        )
        self.whole = nn.Linear(WIDTHS[3], WIDTHS[3])
        self.lateral = nn.ModuleList(
            nn.Conv2d(c + _TOLD, w, 1) for c, w in zip(CHANNELS, WIDTHS, strict=True)
        )
        self.down = nn.ModuleList(nn.Conv2d(WIDTHS[i + 1], WIDTHS[i], 1) for i in range(3))
        self.mix = nn.ModuleList(
            nn.Sequential(*(_separable(w, w, 5 if i == 3 else 3) for _ in range(1 if i == 0 else 2)))
            for i, w in enumerate(WIDTHS)
        )
        # Four logits a cell of stride 2.
        self.out = nn.Conv2d(WIDTHS[0], 4, 1)
        self.quality = nn.Sequential(nn.Linear(WIDTHS[3], 64), nn.ReLU(), nn.Linear(64, 1))

    def forward(self, maps: Sequence[Tensor], boxes: Tensor) -> tuple[Tensor, Tensor]:
        """Logits of the mask, and of its IoU.

        Args:
            maps: Of :class:`Taps`.
            boxes: (N, 4) x0, y0, x1, y1 in pixels of the picture.

        Returns:
            (N, S, S) and (N,).
        """
        told = [places(boxes, stride, m.shape[-1]) for stride, m in zip(STRIDES, maps, strict=True)]
        x = self.lateral[3](torch.cat([maps[3], told[3]], dim=1))
        coarse = functional.avg_pool2d(x, 2)
        coarse = self.context(torch.cat([coarse, functional.avg_pool2d(told[3], 2)], dim=1))
        pooled = coarse.mean(dim=(2, 3))
        x = x + _twice(coarse) + self.whole(pooled)[..., None, None]
        x = self.mix[3](functional.relu(x))
        for i in (2, 1, 0):
            x = _twice(self.down[i](x)) + self.lateral[i](torch.cat([maps[i], told[i]], dim=1))
            x = self.mix[i](functional.relu(x))
        return functional.pixel_shuffle(self.out(x), 2)[:, 0], self.quality(pooled)[:, 0]


class MaskNetwork(nn.Module):
    """Pictures and boxes to masks.

    Args:
        pretrained: Begin with ImageNet weights.

    Raises:
        DependencyError: the packages of Lite0 are not installed.
    """

    def __init__(self, pretrained: bool = True) -> None:
        super().__init__()
        self.taps, self.decoder = Taps(pretrained), Decoder()

    def forward(self, images: Tensor, boxes: Tensor) -> tuple[Tensor, Tensor]:
        """(N, 3, S, S) values in [0, 255] and (N, 4) boxes to logits (N, S, S) and (N,)."""
        with torch.no_grad():
            maps = self.taps(normalised(images))
        found: tuple[Tensor, Tensor] = self.decoder(maps, boxes)
        return found


def _separable(inside: int, outside: int, kernel: int) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(inside, inside, kernel, padding=kernel // 2, groups=inside, bias=False),
        nn.BatchNorm2d(inside),
        nn.Conv2d(inside, outside, 1, bias=False),
        nn.BatchNorm2d(outside),
        nn.ReLU(),
    )


def _twice(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)


def places(boxes: Tensor, stride: int, cells: int) -> Tensor:
    """(N, 3, cells, cells): share of each cell in the box, and its place, -1 to 1 from edge to edge of it."""
    edge = torch.arange(cells, device=boxes.device, dtype=boxes.dtype) * stride
    low, high = boxes[:, :2, None], boxes[:, 2:, None]
    share = (torch.minimum(edge + stride, high) - torch.maximum(edge, low)).clamp(0.0, stride) / stride
    place = ((edge + stride / 2) * 2.0 - low - high) / (high - low).clamp(min=1.0)
    place = place.clamp(-2.0, 2.0)
    x, y = place[:, 0, None, :].expand(-1, cells, -1), place[:, 1, :, None].expand(-1, -1, cells)
    return torch.stack([share[:, 1, :, None] * share[:, 0, None, :], x, y], dim=1)
