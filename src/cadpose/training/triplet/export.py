"""Both trained encoders as one ONNX file, their preprocessing within the graph.

Inputs ``photos`` (N, S, S, 3) and ``renders`` (M, S, S, 3), uint8 RGB, framed as the metadata tells (see
:class:`cadpose.similarity.triplet_framing.Framing`). Outputs ``photo_features`` (N, D) and
``render_features`` (M, D) float32 of unit length.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from cadpose.similarity.triplet import FRAMING, INPUTS, OUTPUTS
from cadpose.similarity.triplet_framing import Framing
from cadpose.training.exporting import export_compared
from cadpose.training.triplet.network import TwoEncoders


def export_onnx(network: TwoEncoders, framing: Framing, path: Path, seed: int = 0) -> float:
    """Write both encoders as ONNX and compare them with torch on random pictures.

    Args:
        network: Put into evaluation mode and onto the CPU for the export, and back afterwards.
        framing: What the encoders were shown.
        path: File to write; it is whole or not there.
        seed: Seeds the pictures.

    Returns:
        The largest absolute difference of any output, at most 1e-4.

    Raises:
        DependencyError: the difference is larger: this torch and ONNX Runtime do not fit together.
    """
    training, device = network.training, next(network.parameters()).device
    rng = np.random.default_rng(seed)
    square = (framing.side, framing.side, 3)
    inputs = {
        name: torch.from_numpy(rng.integers(0, 256, (n, *square), np.uint8))
        for name, n in zip(INPUTS, (1, 2), strict=True)
    }
    axes = dict(zip((*INPUTS, *OUTPUTS), ("n", "m", "n", "m"), strict=True))
    try:
        return export_compared(
            network.cpu().eval(), inputs, OUTPUTS, path, axes=axes, metadata={FRAMING: framing.to_json()}
        )
    finally:
        network.to(device).train(training)
