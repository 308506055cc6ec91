"""The shared encoder in torch: what ``rotation.features.describe`` sees, on the device that trains."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.rotation.features import LEVELS, STEPS, cell_statistics
from cadpose.training.lite.network import imagenet_network

#: Blocks up to the stride-16 and the stride-32 map, as scripts/export_lite0.py cuts the encoder.
_ENDS = (11, 14)


class FrozenEncoder(nn.Module):
    """EfficientNet-Lite0 with its ImageNet weights, never trained; without it what they know is unlearnt."""

    def __init__(self) -> None:
        super().__init__()
        net = imagenet_network("lite0", pretrained=True)
        self.stem = nn.Sequential(net._conv_stem, net._bn0, nn.ReLU6())
        self.parts = nn.ModuleList(
            nn.Sequential(*list(net._blocks)[a:b]) for a, b in zip((0, *_ENDS), _ENDS, strict=False)
        )
        for level in LEVELS:
            for name, values in zip(("mean", "spread"), cell_statistics()[level.name], strict=True):
                self.register_buffer(f"{level.name}_{name}", torch.from_numpy(values.copy()))
        self.requires_grad_(requires_grad=False)
        self.eval()

    def train(self, mode: bool = True) -> FrozenEncoder:
        """Stay as it is: the statistics too are ImageNet's."""
        super().train(mode=False)
        return self

    @torch.no_grad()
    def forward(self, images: Tensor) -> Sequence[Tensor]:
        """Cells of each level of ``rotation.features.LEVELS``.

        Args:
            images: (N, 3, 224, 224) RGB, (x - 127) / 128.

        Returns:
            (N, 196, 112) and (N, 49, 192) float32 whole numbers, what ``describe`` keeps as int8.
        """
        # Half precision is exact enough for steps of a twentieth of a deviation; bfloat16 is not.
        with torch.autocast(images.device.type, torch.float16, enabled=images.device.type == "cuda"):
            x, maps = self.stem(images), []
            for part in self.parts:
                x = part(x)
                maps.append(x)
        cells = []
        for level, found in zip(LEVELS, maps, strict=True):
            mean, spread = self.get_buffer(f"{level.name}_mean"), self.get_buffer(f"{level.name}_spread")
            flat = (found.float().flatten(2).transpose(1, 2) - mean) * (STEPS / spread)
            cells.append(functional.hardtanh(flat.round(), -127.0, 127.0))
        return cells
