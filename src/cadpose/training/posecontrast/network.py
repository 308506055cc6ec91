"""The network: ResNet-50, an MLP, three heads of bins and three of offsets.

Parameters carry the names that the authors' checkpoints use (``net_feat``, ``net_vp`` and what is
below them), and ``net_feat`` those of the usual ResNet-50, so that MoCo v2's weights map one to one.
The encoder's last layer ``fc``, which the method does not use, is left out.

Sources: He et al., "Deep Residual Learning for Image Recognition", CVPR 2016; Xiao et al., 3DV 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from cadpose.rotation.bins import BINS

#: Mean and standard deviation of ImageNet's pixels, by channel, of levels in [0, 1].
MEAN = (0.485, 0.456, 0.406)
STD = (0.229, 0.224, 0.225)


class Outputs(NamedTuple):
    """What the network answers for N crops.

    Attributes:
        features: (N, D) pooled features of the encoder, D = 2048 for ResNet-50.
        logits: (N, 24), (N, 12), (N, 24) of the azimuth, elevation and in-plane bins.
        offsets: Three tensors of the same shapes.
    """

    features: Tensor
    logits: list[Tensor]
    offsets: list[Tensor]


class Bottleneck(nn.Module):
    """1x1, 3x3 (with the stride) and 1x1 convolution beside a shortcut."""

    expansion = 4

    def __init__(self, inputs: int, planes: int, stride: int) -> None:
        super().__init__()
        outputs = planes * self.expansion
        self.conv1 = nn.Conv2d(inputs, planes, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(planes)
        self.conv2 = nn.Conv2d(planes, planes, 3, stride, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(planes)
        self.conv3 = nn.Conv2d(planes, outputs, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(outputs)
        self.relu = nn.ReLU(inplace=True)
        self.downsample = (
            nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))
            if stride != 1 or inputs != outputs
            else None
        )

    def forward(self, x: Tensor) -> Tensor:
        """(N, C, H, W) to (N, 4 planes, H / stride, W / stride)."""
        shortcut = x if self.downsample is None else self.downsample(x)
        x = self.relu(self.bn1(self.conv1(x)))
        x = self.relu(self.bn2(self.conv2(x)))
        out: Tensor = self.relu(self.bn3(self.conv3(x)) + shortcut)
        return out


class ResNet(nn.Module):
    """ResNet of bottlenecks without its last layer; as it stands, ResNet-50.

    Args:
        blocks: Bottlenecks of the four stages.
        width: Channels after the first convolution.
    """

    def __init__(self, blocks: Sequence[int] = (3, 4, 6, 3), width: int = 64) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, width, 7, 2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.relu = nn.ReLU(inplace=True)
        self.maxpool = nn.MaxPool2d(3, 2, padding=1)
        self.channels = width
        self.layer1 = self._stage(blocks[0], width, 1)
        self.layer2 = self._stage(blocks[1], width * 2, 2)
        self.layer3 = self._stage(blocks[2], width * 4, 2)
        self.layer4 = self._stage(blocks[3], width * 8, 2)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def _stage(self, count: int, planes: int, stride: int) -> nn.Sequential:
        layers = []
        for i in range(count):
            layers.append(Bottleneck(self.channels, planes, stride if i == 0 else 1))
            self.channels = planes * Bottleneck.expansion
        return nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 3, H, W) normalised images to (N, D) features, averaged over the image."""
        x = self.maxpool(self.relu(self.bn1(self.conv1(x))))
        x = self.layer4(self.layer3(self.layer2(self.layer1(x))))
        return x.mean(dim=(2, 3))


class PoseHead(nn.Module):
    """Features to bins and offsets: three linear layers with BatchNorm and ReLU, then six linear heads.

    Args:
        inputs: Length of the features.
        hidden: Lengths after the three layers.
    """

    def __init__(self, inputs: int = 2048, hidden: Sequence[int] = (800, 400, 200)) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for a, b in zip((inputs, *hidden[:-1]), hidden, strict=True):
            layers += [nn.Linear(a, b), nn.BatchNorm1d(b), nn.ReLU(inplace=True)]
        self.compress = nn.Sequential(*layers)
        self.fc_cls_azi = nn.Linear(hidden[-1], BINS[0])
        self.fc_cls_ele = nn.Linear(hidden[-1], BINS[1])
        self.fc_cls_inp = nn.Linear(hidden[-1], BINS[2])
        self.fc_reg_azi = nn.Linear(hidden[-1], BINS[0])
        self.fc_reg_ele = nn.Linear(hidden[-1], BINS[1])
        self.fc_reg_inp = nn.Linear(hidden[-1], BINS[2])

    def forward(self, features: Tensor) -> tuple[list[Tensor], list[Tensor]]:
        """(N, D) features to three logits and three offsets."""
        x = self.compress(features)
        logits = [self.fc_cls_azi(x), self.fc_cls_ele(x), self.fc_cls_inp(x)]
        return logits, [self.fc_reg_azi(x), self.fc_reg_ele(x), self.fc_reg_inp(x)]


class PoseContrast(nn.Module):
    """Encoder and heads.

    Args:
        blocks: As in :class:`ResNet`; the published network is the default.
        width: As in :class:`ResNet`.
        hidden: As in :class:`PoseHead`.
    """

    def __init__(
        self,
        blocks: Sequence[int] = (3, 4, 6, 3),
        width: int = 64,
        hidden: Sequence[int] = (800, 400, 200),
    ) -> None:
        super().__init__()
        self.net_feat = ResNet(blocks, width)
        self.net_vp = PoseHead(self.net_feat.channels, hidden)

    def forward(self, images: Tensor) -> Outputs:
        """(N, 3, 224, 224) float32 images, normalised by :func:`normalised`."""
        features = self.net_feat(images)
        return Outputs(features, *self.net_vp(features))


def normalised(images: Tensor) -> Tensor:
    """(N, H, W, 3) uint8 RGB to (N, 3, H, W) float32 with ImageNet's mean 0 and deviation 1."""
    levels = images.to(torch.float32).permute(0, 3, 1, 2) / 255.0
    mean = torch.tensor(MEAN, device=images.device).view(1, 3, 1, 1)
    return (levels - mean) / torch.tensor(STD, device=images.device).view(1, 3, 1, 1)
