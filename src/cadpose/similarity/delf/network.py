"""DELF's network: ResNet-50 up to its third block as TF-slim has it, stride 32, and the attention on top.

TF-slim puts a block's stride into its last unit, so that the third block's map has stride 32; torchvision's
``layer3`` would have 16. Convolutions of stride 2 are padded by the same on all sides (``conv2d_same``), but
the max pooling has TensorFlow's SAME, which pads an even side at its end only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError
from cadpose.similarity.delf.parameters import ATTENTION, BLOCKS, ROOT, Parameters

if TYPE_CHECKING:
    from torch import Tensor


class Network:
    """The network on a device; torch is imported here and not before.

    Args:
        parameters: Its weights.
        device: ``"cpu"`` or ``"cuda"``.

    Raises:
        DependencyError: torch is not installed, or has no such device.
    """

    def __init__(self, parameters: Parameters, device: str = "cpu") -> None:
        require_torch(device)
        import torch

        self.device = device
        self._layers = {
            scope: (torch.from_numpy(c.weight).to(device), torch.from_numpy(c.bias).to(device))
            for scope, c in parameters.convolutions.items()
        }

    def __call__(self, image: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """One image to its features and their attention.

        Args:
            image: (H, W, 3) float32 RGB, (x - 128) / 128.

        Returns:
            (ceil(H / 32), ceil(W / 32), 1024) features and, without the last axis, their scores >= 0.
        """
        import torch
        from torch.nn import functional as F

        # On a GPU cuDNN would round to 10 bits of mantissa.
        with torch.inference_mode(), torch.backends.cudnn.flags(enabled=True, allow_tf32=False):
            x = torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))[None].to(self.device)
            x = _pooled(self._conv(x, ROOT, stride=2, relu=True))
            for block, (_, units) in enumerate(BLOCKS, 1):
                for unit in range(1, units + 1):
                    scope = f"resnet_v1_50/block{block}/unit_{unit}/bottleneck_v1"
                    x = self._bottleneck(x, scope, stride=2 if unit == units else 1)
            hidden, score = ATTENTION
            attention = F.softplus(self._conv(self._conv(x, hidden, relu=True), score))
            features = x[0].permute(1, 2, 0).contiguous().cpu().numpy()
            return features, attention[0, 0].cpu().numpy()

    def _bottleneck(self, x: Tensor, scope: str, stride: int) -> Tensor:
        # TF-slim halves the identity by a max pooling of one pixel, which takes every other one.
        projected = f"{scope}/shortcut" in self._layers
        shortcut = self._conv(x, f"{scope}/shortcut", stride) if projected else x[:, :, ::stride, ::stride]
        x = self._conv(x, f"{scope}/conv1", relu=True)
        x = self._conv(x, f"{scope}/conv2", stride, relu=True)
        return (self._conv(x, f"{scope}/conv3") + shortcut).relu_()

    def _conv(self, x: Tensor, scope: str, stride: int = 1, *, relu: bool = False) -> Tensor:
        from torch.nn import functional as F

        weight, bias = self._layers[scope]
        x = F.conv2d(x, weight, bias, stride=stride, padding=weight.shape[-1] // 2)
        return x.relu_() if relu else x


def _pooled(x: Tensor) -> Tensor:
    """Max pooling of 3 x 3 at stride 2 with TensorFlow's padding, -inf as there."""
    from torch.nn import functional as F

    height, width = x.shape[2:]
    x = F.pad(x, (width % 2, 1, height % 2, 1), value=float("-inf"))
    return F.max_pool2d(x, 3, 2)


def require_torch(device: str) -> None:
    """Nothing, where torch and the device are there.

    Raises:
        DependencyError: they are not.
    """
    try:
        import torch
    except ImportError:
        raise DependencyError("DELF needs PyTorch: install it with `pip install 'cadpose[delf]'`") from None
    if device == "cuda" and not torch.cuda.is_available():
        raise DependencyError("DELF on cuda needs a GPU and a build of torch for CUDA; neither is seen here")
