"""The trained networks as ONNX files: half precision on disk, single precision when they run."""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from cadpose.encoder import SIDE
from cadpose.errors import DependencyError
from cadpose.library.storage import write_atomic
from cadpose.rotation.features import LEVELS
from cadpose.training.lite.embedder import SIDE as EMBEDDED_SIDE
from cadpose.training.lite.embedder import Embedder
from cadpose.training.lite.head import MapHead
from cadpose.training.lite.network import LitePose, normalised

_ANGLES = ("azimuth", "elevation", "inplane")
INPUTS = ("images", "fine", "coarse", "category")
OUTPUTS = (*_ANGLES, *(f"{name}_offset" for name in _ANGLES))


class Members(nn.Module):
    """All networks side by side; their answers are stacked, (N, members, bins), the fine-tuned one first."""

    def __init__(self, tuned: LitePose, heads: Sequence[MapHead]) -> None:
        super().__init__()
        self.tuned, self.heads = tuned, nn.ModuleList(heads)

    def forward(self, images: Tensor, fine: Tensor, coarse: Tensor, category: Tensor) -> tuple[Tensor, ...]:
        """The inputs of :data:`INPUTS` to the outputs of :data:`OUTPUTS`."""
        x = normalised(images.permute(0, 3, 1, 2).to(torch.float32))
        told = [self.tuned(x, category), *(head(fine, coarse, category) for head in self.heads)]
        return tuple(torch.stack([t[part][i] for t in told], dim=1) for part in (0, 1) for i in range(3))


def export(tuned: LitePose, heads: Sequence[MapHead], path: Path, told: dict[str, str] | None = None) -> None:
    """Write all members to ``path``; ``told`` goes into the file's metadata beside the categories.

    Inputs: ``images`` (N, 224, 224, 3) uint8 RGB, ``fine`` (N, 196, 112) and ``coarse`` (N, 49, 192) int8
    cells of the shared encoder, ``category`` (N, C) one-hot.

    Raises:
        DependencyError: ``onnx`` is not installed.
        ValueError: the members know different categories, or the file answers differently from them.
    """
    if any(tuned.categories != head.categories for head in heads):
        raise ValueError("the members were trained on different categories")
    whole = Members(tuned, heads).eval()
    example = (
        torch.randint(0, 256, (2, SIDE, SIDE, 3), dtype=torch.uint8),
        *(torch.randint(-60, 60, (2, level.cells, level.channels), dtype=torch.int8) for level in LEVELS),
        torch.eye(len(tuned.categories))[:2],
    )
    write_network(
        whole,
        dict(zip(INPUTS, example, strict=True)),
        OUTPUTS,
        path,
        {"categories": json.dumps(tuned.categories), **(told or {})},
    )


def export_embedder(embedder: Embedder, path: Path) -> None:
    """Write the embedder to ``path``: ``images`` (N, 112, 112, 3) uint8 RGB to ``embedding`` (N, 128).

    Raises:
        DependencyError: ``onnx`` is not installed.
        ValueError: the file answers differently from the network.
    """
    example = torch.randint(0, 256, (2, EMBEDDED_SIDE, EMBEDDED_SIDE, 3), dtype=torch.uint8)
    write_network(_OfPixels(embedder).eval(), {"images": example}, ("embedding",), path, {})


class _OfPixels(nn.Module):
    def __init__(self, embedder: Embedder) -> None:
        super().__init__()
        self.embedder = embedder

    def forward(self, images: Tensor) -> tuple[Tensor]:
        return (self.embedder(normalised(images.permute(0, 3, 1, 2).to(torch.float32))),)


def write_network(
    network: nn.Module,
    inputs: dict[str, Tensor],
    outputs: Sequence[str],
    path: Path,
    told: dict[str, str],
) -> None:
    """Write a network to ``path``, its weights in half precision, any number of inputs at a time.

    Args:
        network: In evaluation mode; answers a tuple.
        inputs: Examples by name; their first axis may have any length.
        outputs: Names of the answers.
        path: ONNX file to write.
        told: Metadata.

    Raises:
        DependencyError: ``onnx`` is not installed.
        ValueError: the file answers differently from the network.
    """
    try:
        import onnx
    except ImportError as error:
        raise DependencyError("the export needs onnx: pip install 'cadpose[train]'") from error
    with torch.no_grad():
        reference = network(*inputs.values())
    data = io.BytesIO()
    with warnings.catch_warnings():
        # PyTorch's older exporter is meant, see docs/dependencies.md; it warns of slices it does not fold.
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.filterwarnings("ignore", "Constant folding", UserWarning)
        # It writes into a buffer too, which its type hints do not say.
        torch.onnx.export(
            network,
            tuple(inputs.values()),
            data,  # type: ignore[arg-type]
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes={name: {0: "n"} for name in (*inputs, *outputs)},
            opset_version=17,
            dynamo=False,
        )
    model = onnx.load_from_string(data.getvalue())
    _halve(model)
    for key, value in told.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(model)
    blob = model.SerializeToString()
    _same(blob, inputs, outputs, reference)
    write_atomic(path, blob)


def _halve(model: Any) -> None:
    """Keep weights in half precision, cast when the file is loaded."""
    import onnx
    from onnx import numpy_helper

    casts = []
    for initializer in model.graph.initializer:
        array = numpy_helper.to_array(initializer)
        if array.dtype == np.float32 and array.size > 64:
            name = initializer.name
            initializer.CopyFrom(numpy_helper.from_array(array.astype(np.float16), name + "_half"))
            casts.append(onnx.helper.make_node("Cast", [name + "_half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


def _same(
    blob: bytes, inputs: dict[str, Tensor], outputs: Sequence[str], reference: tuple[Tensor, ...]
) -> None:
    import onnxruntime

    session = onnxruntime.InferenceSession(blob, providers=["CPUExecutionProvider"])
    answers = session.run(list(outputs), {name: value.numpy() for name, value in inputs.items()})
    for name, answer, expected in zip(outputs, answers, reference, strict=True):
        apart = float(np.abs(answer - expected.numpy()).max())
        # Half precision keeps three digits.
        if apart > 0.05 * max(1.0, float(expected.abs().max())):
            raise ValueError(f"the exported {name} differs from the network's by {apart:.3g}")
