"""Descriptions and networks for the tests: a network that boxes what is bright, made of ONNX operators."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SIDE = 64


def described(**changes: Any) -> dict[str, Any]:
    """A description of :func:`bright_network`, with changes; None takes a key away."""
    base: dict[str, Any] = {
        "format": "cadpose-detector",
        "version": 1,
        "network": "net.onnx",
        "input": {"name": "image", "size": [SIDE, SIDE], "resize": "stretch"},
        "boxes": {"output": "boxes", "form": "xyxy", "unit": "pixels"},
        "scores": {"output": "scores", "form": "probability"},
        "classes": ["person", "chair", "table"],
        "masks": {"kind": "queries", "output": "masks"},
    }
    merged = {**base, **changes}
    return {k: v for k, v in merged.items() if v is not None}


def write(folder: Path, description: dict[str, Any], network: bytes = b"") -> Path:
    """The description and its network as files; the path of the description."""
    (folder / "net.onnx").write_bytes(network)
    path = folder / "net.json"
    path.write_text(json.dumps(description), encoding="utf-8")
    return path


def bright_network(
    scores: NDArray[np.float32], *, shape: tuple[Any, ...] = (1, 3, "h", "w"), layout: str = "nchw"
) -> bytes:
    """One query: the box of what is brighter than half, in pixels of the input, and its mask at stride 4.

    Args:
        scores: (1, C), given out as they are.
        shape: The input's.
        layout: Its order of axes.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    def node(op: str, inputs: list[str], output: str, **how: Any) -> Any:
        return helper.make_node(op, inputs, [output], **how)

    def constant(name: str, values: Any, kind: Any = np.float32) -> Any:
        return numpy_helper.from_array(np.asarray(values, kind), name)

    nodes = [node("Transpose", ["image"], "x", perm=[0, 3, 1, 2] if layout == "nhwc" else [0, 1, 2, 3])]
    nodes += [
        node("ReduceMean", ["x"], "grey", axes=[1], keepdims=1),
        node("Greater", ["grey", "half"], "is_bright"),
        node("Cast", ["is_bright"], "bright", to=TensorProto.FLOAT),
        node("ReduceMax", ["bright"], "cols", axes=[1, 2], keepdims=0),
        node("ReduceMax", ["bright"], "rows", axes=[1, 3], keepdims=0),
    ]
    for end, axis, last in (("x0", "cols", 0), ("y0", "rows", 0), ("x1", "cols", 1), ("y1", "rows", 1)):
        nodes += [
            node("ArgMax", [axis], f"{end}_i", axis=1, keepdims=1, select_last_index=last),
            node("Cast", [f"{end}_i"], f"{end}_f", to=TensorProto.FLOAT),
            node("Add", [f"{end}_f", "one" if last else "zero"], end),
        ]
    nodes += [
        node("Concat", ["x0", "y0", "x1", "y1"], "corners", axis=1),
        node("Unsqueeze", ["corners", "axis"], "boxes"),
        node("AveragePool", ["grey"], "coarse", kernel_shape=[4, 4], strides=[4, 4]),
        node("Sub", ["coarse", "half"], "masks"),
        node("Identity", ["told"], "scores"),
    ]
    graph = helper.make_graph(
        nodes,
        "bright",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, list(shape))],
        [
            helper.make_tensor_value_info("boxes", TensorProto.FLOAT, [1, 1, 4]),
            helper.make_tensor_value_info("masks", TensorProto.FLOAT, [1, 1, "mh", "mw"]),
            helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, *scores.shape]),
        ],
        [
            constant("half", 0.5),
            constant("one", 1.0),
            constant("zero", 0.0),
            constant("axis", [1], np.int64),
            constant("told", scores[None]),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def constant_network(outputs: dict[str, NDArray[Any]], taken: type[np.generic] = np.float32) -> bytes:
    """Gives the same outputs for every (1, 3, SIDE, SIDE) input."""
    from onnx import helper, numpy_helper

    nodes, infos, constants = [], [], []
    for name, values in outputs.items():
        constants.append(numpy_helper.from_array(values, f"{name}_told"))
        nodes.append(helper.make_node("Identity", [f"{name}_told"], [name]))
        kind = helper.np_dtype_to_tensor_dtype(values.dtype)
        infos.append(helper.make_tensor_value_info(name, kind, list(values.shape)))
    kind = helper.np_dtype_to_tensor_dtype(np.dtype(taken))
    image = helper.make_tensor_value_info("image", kind, [1, 3, SIDE, SIDE])
    graph = helper.make_graph(nodes, "constant", [image], infos, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return bytes(model.SerializeToString())
