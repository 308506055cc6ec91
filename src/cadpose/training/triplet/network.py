"""Two encoders of one form, VGG16 up to conv5_3: one for photos, one for renders.

Parameters of an encoder carry torchvision's names (``features.0.weight`` ...), so that its ImageNet weights
map one to one. As in Langer's published code, the last ReLU and max pool are left out, the maximum over all
cells is taken, and the vector brought to unit length.

Source: Simonyan, Zisserman, "Very Deep Convolutional Networks for Large-Scale Image Recognition", ICLR 2015.
"""

from __future__ import annotations

from copy import deepcopy

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.training.posecontrast.network import MEAN, STD

#: Convolutions of the five blocks, and their channels in widths.
_CONVOLUTIONS = (2, 2, 3, 3, 3)
_CHANNELS = (1, 2, 4, 8, 8)


class Vgg16(nn.Module):
    """Images to vectors of unit length.

    Args:
        width: Channels of the first block; 64 is VGG16, which gives 512 numbers.
    """

    def __init__(self, width: int = 64) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        self._starts: list[int] = []
        inputs = 3
        for count, channels in zip(_CONVOLUTIONS, _CHANNELS, strict=True):
            self._starts.append(len(layers))
            for _ in range(count):
                layers += [nn.Conv2d(inputs, channels * width, 3, padding=1), nn.ReLU(inplace=True)]
                inputs = channels * width
            layers.append(nn.MaxPool2d(2))
        self.features = nn.Sequential(*layers[:-2])
        for module in self.features:
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
                assert module.bias is not None
                nn.init.zeros_(module.bias)

    def train_blocks(self, count: int) -> None:
        """Let the last ``count`` of the five blocks learn and keep the others as they are."""
        first = self._starts[len(self._starts) - count]
        for i, layer in enumerate(self.features):
            layer.requires_grad_(i >= first)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 3, S, S) to (N, 8 width), each of length 1; S at least 16."""
        maps: Tensor = self.features(x)
        return functional.normalize(maps.amax(dim=(2, 3)), dim=1)


class TwoEncoders(nn.Module):
    """The photos' and the renders' encoder, alike at first.

    Args:
        width: Channels of the first block of both.
        normalise: Bring levels to ImageNet's mean 0 and deviation 1; else only into [0, 1].
    """

    def __init__(self, width: int = 64, normalise: bool = False) -> None:
        super().__init__()
        self.normalise = normalise
        self.photo = Vgg16(width)
        self.render = deepcopy(self.photo)

    def train_blocks(self, count: int) -> None:
        """Let the last ``count`` blocks of both learn."""
        self.photo.train_blocks(count)
        self.render.train_blocks(count)

    def trained(self) -> list[nn.Parameter]:
        """The parameters that learn."""
        return [p for p in self.parameters() if p.requires_grad]

    def forward(self, photos: Tensor, renders: Tensor) -> tuple[Tensor, Tensor]:
        """(N, S, S, 3) and (M, S, S, 3) uint8 RGB to (N, D) and (M, D) of unit length."""
        return self.photo(self._levels(photos)), self.render(self._levels(renders))

    def _levels(self, images: Tensor) -> Tensor:
        levels = images.to(torch.float32).permute(0, 3, 1, 2) / 255.0
        if not self.normalise:
            return levels
        mean = torch.tensor(MEAN, device=images.device).view(1, 3, 1, 1)
        return (levels - mean) / torch.tensor(STD, device=images.device).view(1, 3, 1, 1)
