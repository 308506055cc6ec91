"""The trained network as one ONNX file: half precision on disk, single precision when it runs."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from cadpose.encoder import SIDE
from cadpose.errors import DependencyError
from cadpose.library.storage import write_atomic
from cadpose.training.lite.network import LitePose, normalised

_ANGLES = ("azimuth", "elevation", "inplane")
OUTPUTS = (*_ANGLES, *(f"{name}_offset" for name in _ANGLES), "features")


class _WithPreprocessing(nn.Module):
    """uint8 RGB (N, 224, 224, 3) and (N, C) one-hot in, everything out by name."""

    def __init__(self, network: LitePose) -> None:
        super().__init__()
        self.network = network

    def forward(self, images: Tensor, category: Tensor) -> tuple[Tensor, ...]:
        x = normalised(images.permute(0, 3, 1, 2).to(torch.float32))
        logits, offsets, features = self.network(x, category)
        return (*logits, *offsets, features)


def export(network: LitePose, path: Path, told: dict[str, str] | None = None) -> None:
    """Write the network to ``path``; ``told`` goes into the file's metadata beside the categories.

    Raises:
        DependencyError: ``onnx`` is not installed.
        ValueError: the file answers differently from the network.
    """
    try:
        import onnx
        from onnx import numpy_helper
    except ImportError as error:
        raise DependencyError("the export needs onnx: pip install 'cadpose[train]'") from error
    network = network.eval()
    images = torch.randint(0, 256, (2, SIDE, SIDE, 3), dtype=torch.uint8)
    category = torch.eye(len(network.categories))[:2]
    whole = _WithPreprocessing(network).eval()
    with torch.no_grad():
        reference = whole(images, category)
    data = io.BytesIO()
    torch.onnx.export(
        whole,
        (images, category),
        data,  # type: ignore[arg-type]
        input_names=["images", "category"],
        output_names=list(OUTPUTS),
        dynamic_axes={name: {0: "n"} for name in ("images", "category", *OUTPUTS)},
        opset_version=17,
        dynamo=False,
    )
    model = onnx.load_from_string(data.getvalue())
    casts = []
    for initializer in model.graph.initializer:
        array = numpy_helper.to_array(initializer)
        if array.dtype == np.float32 and array.size > 64:
            name = initializer.name
            half = numpy_helper.from_array(array.astype(np.float16), name + "_half")
            initializer.CopyFrom(half)
            casts.append(onnx.helper.make_node("Cast", [name + "_half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    for key, value in {"categories": json.dumps(network.categories), **(told or {})}.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(model)
    blob = model.SerializeToString()
    _same(blob, images, category, reference)
    write_atomic(path, blob)


def _same(blob: bytes, images: Tensor, category: Tensor, reference: tuple[Tensor, ...]) -> None:
    import onnxruntime

    session = onnxruntime.InferenceSession(blob, providers=["CPUExecutionProvider"])
    answers = session.run(list(OUTPUTS), {"images": images.numpy(), "category": category.numpy()})
    for name, answer, expected in zip(OUTPUTS, answers, reference, strict=True):
        apart = float(np.abs(answer - expected.numpy()).max())
        # Half precision keeps three digits.
        if apart > 0.05 * max(1.0, float(expected.abs().max())):
            raise ValueError(f"the exported {name} differs from the network's by {apart:.3g}")
