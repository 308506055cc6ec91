"""The trained box-to-mask network as an ONNX file: half precision on disk, single precision when it runs."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn

from cadpose.detection.mask_crop import SIDE
from cadpose.training.checkpoints import read_checkpoint, set_weights, tensors
from cadpose.training.lite.export import write_network
from cadpose.training.masks.network import MaskNetwork


class _OfPixels(nn.Module):
    def __init__(self, network: MaskNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, images: Tensor, boxes: Tensor) -> tuple[Tensor, Tensor]:
        logits, quality = self.network(images.permute(0, 3, 1, 2).to(torch.float32), boxes)
        return logits, quality.sigmoid()


def export(weights: Path, path: Path) -> None:
    """Write the network of a checkpoint to ``path``.

    ``images`` (N, 224, 224, 3) uint8 RGB and ``boxes`` (N, 4) float32 x0, y0, x1, y1 in their pixels to
    ``logits`` (N, 224, 224), above 0 on the object, and ``quality`` (N,), the IoU expected of them.

    Raises:
        InputError: the file is no checkpoint of this network.
        DependencyError: ``onnx`` is not installed.
        ValueError: the ONNX file answers differently from the network.
    """
    images = torch.randint(0, 256, (2, SIDE, SIDE, 3), dtype=torch.uint8)
    boxes = torch.tensor([[37.0, 37.0, 187.0, 187.0], [60.0, 37.0, 164.0, 187.0]])
    network = _OfPixels(trained_network(weights)).eval()
    write_network(network, {"images": images, "boxes": boxes}, ("logits", "quality"), path, {})


def trained_network(path: Path) -> MaskNetwork:
    """The averaged network of a checkpoint.

    Raises:
        InputError: the file is no checkpoint of this kind.
    """
    content = read_checkpoint(path)
    model = MaskNetwork()
    set_weights(model.decoder, tensors(content.get("average"), str(path)), str(path))
    return model.eval()
