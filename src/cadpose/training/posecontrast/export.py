"""The trained network as ONNX, its preprocessing within the graph.

Input ``images``: (N, 224, 224, 3) uint8 RGB crops, the box's aspect kept, its longer side 224 px, black
beside it. The graph divides by 255, subtracts ImageNet's mean and divides by its deviation. Outputs:
``azimuth``, ``elevation``, ``inplane`` (logits of 24, 12 and 24 bins) and ``azimuth_offset``,
``elevation_offset``, ``inplane_offset``, all (N, bins) float32; see :mod:`cadpose.rotation.bins`.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from cadpose.errors import DependencyError
from cadpose.library.storage import write_atomic
from cadpose.rotation.posecontrast import INPUT, OUTPUTS
from cadpose.training.posecontrast.network import PoseContrast, normalised

#: Largest difference between ONNX Runtime and torch that an export may have.
TOLERANCE = 1e-4
_OPSET = 17


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
    try:
        data = _exported(model, images)
        with torch.no_grad():
            wanted = [output.numpy() for output in model(images)]
    finally:
        network.to(device).train(training)
    found = _run(data, images.numpy())
    difference = max(float(np.abs(a - b).max()) for a, b in zip(wanted, found, strict=True))
    if not difference <= TOLERANCE:
        raise DependencyError(
            f"the exported network differs from torch's by {difference:.2g}, more than {TOLERANCE:g}: "
            "use another version of torch or onnxruntime"
        )
    write_atomic(path, data)
    return difference


def _exported(model: nn.Module, images: Tensor) -> bytes:
    descriptor, name = tempfile.mkstemp(suffix=".onnx")
    os.close(descriptor)
    try:
        with warnings.catch_warnings():
            # The newer exporter needs onnxscript besides and takes ten times as long for the same graph.
            warnings.simplefilter("ignore", DeprecationWarning)
            # Mean and deviation are constants, and meant to be.
            warnings.filterwarnings("ignore", "torch.tensor results are registered as constants")
            torch.onnx.export(
                model,
                (images,),
                name,
                input_names=[INPUT],
                output_names=list(OUTPUTS),
                dynamic_axes={key: {0: "n"} for key in (INPUT, *OUTPUTS)},
                opset_version=_OPSET,
                dynamo=False,
            )
        return Path(name).read_bytes()
    finally:
        Path(name).unlink(missing_ok=True)


def _run(data: bytes, images: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> list[np.ndarray]:
    import onnxruntime as ort

    session = ort.InferenceSession(data, providers=["CPUExecutionProvider"])
    return list(session.run(list(OUTPUTS), {INPUT: images}))
