"""The trained network as ONNX, its preprocessing within the graph.

Input ``images``: (N, 224, 224, 3) uint8 RGB crops, the box's aspect kept, its longer side 224 px, black
beside it. The graph divides by 255, subtracts ImageNet's mean and divides by its deviation. Outputs:
``azimuth``, ``elevation``, ``inplane`` (logits of 24, 12 and 24 bins) and ``azimuth_offset``,
``elevation_offset``, ``inplane_offset``, all (N, bins) float32; see :mod:`cadpose.rotation.bins`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from cadpose.rotation.posecontrast import INPUT, OUTPUTS
from cadpose.training.exporting import export_compared
from cadpose.training.posecontrast.network import PoseContrast, normalised


class _WithPreprocessing(nn.Module):
    def __init__(self, network: PoseContrast) -> None:
        super().__init__()
        self.network = network

    def forward(self, images: Tensor) -> tuple[Tensor, ...]:
        outputs = self.network(normalised(images))
        return (*outputs.logits, *outputs.offsets)


def export_onnx(network: PoseContrast, path: Path, seed: int = 0) -> float:
    """Write the network as ONNX and compare it with torch on random pictures.

    Args:
        network: Put into evaluation mode and onto the CPU for the export, and back afterwards.
        path: File to write; it is whole or not there.
        seed: Seeds the pictures.

    Returns:
        The largest absolute difference of any output, at most 1e-4.

    Raises:
        DependencyError: the difference is larger: this torch and ONNX Runtime do not fit together.
    """
    training, device = network.training, next(network.parameters()).device
    model = _WithPreprocessing(network).cpu().eval()
    images = torch.from_numpy(np.random.default_rng(seed).integers(0, 256, (2, 224, 224, 3), np.uint8))
    names = (INPUT, *OUTPUTS)
    try:
        return export_compared(model, {INPUT: images}, OUTPUTS, path, axes=dict.fromkeys(names, "n"))
    finally:
        network.to(device).train(training)
