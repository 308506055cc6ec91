"""A network as ONNX, written only when ONNX Runtime gives torch's answers."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from cadpose.errors import DependencyError, InputError
from cadpose.library.storage import write_atomic

#: Largest difference between ONNX Runtime and torch that an export may have.
TOLERANCE = 1e-4
_OPSET = 17


def export_compared(
    model: nn.Module,
    inputs: Mapping[str, Tensor],
    outputs: tuple[str, ...],
    path: Path,
    *,
    axes: Mapping[str, str],
    metadata: Mapping[str, str] | None = None,
) -> float:
    """Write a network as ONNX and compare it with torch on the inputs.

    Args:
        model: On the CPU, in evaluation mode; answers a tuple of tensors.
        inputs: Example inputs by name, in order.
        outputs: Names of what it answers.
        path: File to write; it is whole or not there.
        axes: Input or output to the name of its first axis, whose length is free.
        metadata: What else the file tells.

    Returns:
        The largest absolute difference of any output, at most :data:`TOLERANCE`.

    Raises:
        DependencyError: the difference is larger: this torch and ONNX Runtime do not fit together.
        InputError: the network answers values that are not numbers.
    """
    data = _exported(model, inputs, outputs, axes)
    if metadata:
        data = _labelled(data, metadata)
    with torch.no_grad():
        wanted = [output.numpy() for output in model(*inputs.values())]
    found = _run(data, inputs, outputs)
    # Python's max() would pass over a NaN that is not the first.
    difference = float(np.max([np.abs(a - b).max() for a, b in zip(wanted, found, strict=True)]))
    if np.isnan(difference):
        raise InputError(f"{path}: not written, for the network answers values that are not numbers")
    if not difference <= TOLERANCE:
        raise DependencyError(
            f"the exported network differs from torch's by {difference:.2g}, more than {TOLERANCE:g}: "
            "use another version of torch or onnxruntime"
        )
    write_atomic(path, data)
    return difference


def _exported(
    model: nn.Module, inputs: Mapping[str, Tensor], outputs: tuple[str, ...], axes: Mapping[str, str]
) -> bytes:
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
                tuple(inputs.values()),
                name,
                input_names=list(inputs),
                output_names=list(outputs),
                dynamic_axes={key: {0: axis} for key, axis in axes.items()},
                opset_version=_OPSET,
                dynamo=False,
            )
        return Path(name).read_bytes()
    finally:
        Path(name).unlink(missing_ok=True)


def _labelled(data: bytes, metadata: Mapping[str, str]) -> bytes:
    import onnx

    model = onnx.load_from_string(data)
    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    return bytes(model.SerializeToString())


def _run(data: bytes, inputs: Mapping[str, Tensor], outputs: tuple[str, ...]) -> list[np.ndarray]:
    import onnxruntime as ort

    session = ort.InferenceSession(data, providers=["CPUExecutionProvider"])
    return list(session.run(list(outputs), {key: value.numpy() for key, value in inputs.items()}))
