"""TensorFlow's frozen SSD graph as an ONNX network and its prior boxes.

ONNX Runtime gives the same boxes as OpenCV's reader of the two files, in about half the time. The text graph
tells the operations that inference needs, the frozen graph their weights. Only what SSD-MobileNetV2 is made
of is translated; any other operation is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import prod
from typing import Any

import numpy as np
import onnx
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, text_format
from numpy.typing import NDArray
from onnx import helper, numpy_helper

#: The network's input and its two outputs.
IMAGES, ENCODINGS, SCORES = "images", "encodings", "scores"
_OPSET = 17
_PACKAGE = "cadpose.tensorflow"
_FLOAT, _INT32, _UINT8 = 1, 3, 4
#: No constant of an SSD of this kind is as large.
_MOST_NUMBERS = 1 << 26
#: Offset of a prior's centre within its cell.
_MIDDLE = 0.5


@dataclass(frozen=True, eq=False)
class SsdGraph:
    """What a detector needs of the two files.

    Attributes:
        network: The ONNX file: (N, S, S, 3) uint8 RGB to (N, P, 4) encodings (y, x, height, width) and
            (N, P, C) scores in [0, 1], class 0 being none.
        priors: (P, 4) float64 centre x, centre y, width, height in shares of the picture.
        variance: (4,) what encodings of x, y, width, height are multiplied with.
    """

    network: bytes
    priors: NDArray[np.float64]
    variance: NDArray[np.float64]


def read_graph(frozen: bytes, text: str, side: int) -> SsdGraph:
    """Translate.

    Args:
        frozen: TensorFlow's frozen graph.
        text: The graph of inference alone in protobuf's text form, as OpenCV's samples make it.
        side: Pixels a side of the square that the network sees.

    Raises:
        ValueError: the files are no such graph, or do not belong together.
    """
    graph = _message("GraphDef")
    weights = _message("GraphDef")
    try:
        text_format.Parse(text, graph, allow_unknown_field=True)
        weights.ParseFromString(frozen)
    except Exception as error:  # DecodeError, ParseError: protobuf's errors share no class of their own
        raise ValueError(f"no graph of TensorFlow ({error})") from error
    constants = {n.name: n for n in (*weights.node, *graph.node) if n.op == "Const"}
    try:
        return _Translation(constants, side).of(graph.node)
    except KeyError as error:
        raise ValueError(f"the graph lacks {error}") from error
    except (IndexError, ZeroDivisionError) as error:
        raise ValueError(f"the graph has a node without what it needs ({error})") from error


class _Translation:
    """Nodes of TensorFlow to nodes of ONNX, in NCHW."""

    def __init__(self, constants: dict[str, Any], side: int) -> None:
        self._constants = constants
        self._side = side
        self._nodes: list[onnx.NodeProto] = []
        self._weights: dict[str, onnx.TensorProto] = {}
        #: Cells a side of each map.
        self._cells = {IMAGES: side}
        self._priors: dict[str, NDArray[np.float64]] = {}
        self._variance = np.zeros(4)
        self._operations: dict[str, Callable[[Any], None]] = {
            "Add": lambda n: self._add(n, "Add", [*n.input]),
            "BiasAdd": self._bias,
            "ConcatV2": self._concat,
            "Const": lambda n: None,
            "Conv2D": self._convolve,
            "DepthwiseConv2dNative": self._convolve,
            "DetectionOutput": self._outputs,
            "Flatten": self._flatten,
            "FusedBatchNorm": self._normalise,
            "Identity": lambda n: self._add(n, "Identity", [n.input[0]]),
            "Mul": self._scale,
            "Placeholder": self._placeholder,
            "PriorBox": self._prior,
            "Relu6": self._clip,
            "Sigmoid": lambda n: self._add(n, "Sigmoid", [n.input[0]]),
            "Sub": self._scale,
        }

    def of(self, nodes: Any) -> SsdGraph:
        for node in nodes:
            if node.op not in self._operations:
                raise ValueError(f"{node.name} is a {node.op}, which no SSD of this kind has")
            self._operations[node.op](node)
        if not self._priors or self._variance.shape != (4,):
            raise ValueError("the graph has no prior boxes, or not four variances of them")
        made = {name for node in self._nodes for name in node.output}
        if not {ENCODINGS, SCORES} <= made:
            raise ValueError("the graph has no detection output")
        batch = "n"
        graph = helper.make_graph(
            self._nodes,
            "ssd",
            [
                helper.make_tensor_value_info(
                    IMAGES, onnx.TensorProto.UINT8, [batch, self._side, self._side, 3]
                )
            ],
            [
                helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [batch, "p", None])
                for name in (ENCODINGS, SCORES)
            ],
            [*self._weights.values()],
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=8)
        return SsdGraph(model.SerializeToString(), np.concatenate([*self._priors.values()]), self._variance)

    def _add(self, node: Any, kind: str, inputs: list[str], **attributes: Any) -> None:
        self._emit(kind, inputs, node.name, **attributes)
        self._cells[node.name] = self._cells.get(inputs[0], 0)

    def _emit(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> None:
        self._nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))

    def _constant(self, name: str) -> NDArray[Any]:
        """The values of a constant."""
        tensor = self._constants[name].attr["value"].tensor
        kinds: dict[int, tuple[Any, Any]] = {
            _FLOAT: (np.float32, tensor.float_val),
            _INT32: (np.int32, tensor.int_val),
        }
        if tensor.dtype not in kinds:
            raise ValueError(f"{name} holds neither floats nor whole numbers")
        kind, few = kinds[tensor.dtype]
        shape = [d.size for d in tensor.tensor_shape.dim]
        if not 0 <= prod(shape) <= _MOST_NUMBERS:
            raise ValueError(f"{name} has {prod(shape)} numbers")
        values = np.frombuffer(tensor.tensor_content, kind) if tensor.tensor_content else np.array(few, kind)
        # One value may stand for all.
        return np.full(shape, values[0]) if values.size == 1 else values.reshape(shape)

    def _weight(self, name: str, values: NDArray[Any]) -> str:
        self._weights[name] = numpy_helper.from_array(np.ascontiguousarray(values), name)
        return name

    def _placeholder(self, node: Any) -> None:
        self._emit("Cast", [IMAGES], f"{node.name}/float", to=onnx.TensorProto.FLOAT)
        self._emit("Transpose", [f"{node.name}/float"], node.name, perm=[0, 3, 1, 2])
        self._cells[node.name] = self._side

    def _scale(self, node: Any) -> None:
        value, number = node.input
        if number not in self._constants:
            value, number = number, value
        self._add(node, node.op, [value, self._weight(number, self._constant(number))])

    def _convolve(self, node: Any) -> None:
        value, name = node.input
        kernel = self._constant(name)
        strides = [*node.attr["strides"].list.i][1:3]
        if node.attr["padding"].s != b"SAME" or strides[0] != strides[1]:
            raise ValueError(f"{node.name} is padded or strided as no layer of this kind is")
        groups = 1
        if node.op == "Conv2D":
            kernel = kernel.transpose(3, 2, 0, 1)
        else:
            height, width, groups, each = kernel.shape
            kernel = kernel.transpose(2, 3, 0, 1).reshape(groups * each, 1, height, width)
        weight = self._weight(name, kernel)
        self._add(node, "Conv", [value, weight], strides=strides, auto_pad="SAME_UPPER", group=groups)
        self._cells[node.name] = -(-self._cells[value] // strides[0])

    def _normalise(self, node: Any) -> None:
        value, *names = node.input
        inputs = [value, *(self._weight(name, self._constant(name)) for name in names)]
        self._add(node, "BatchNormalization", inputs, epsilon=node.attr["epsilon"].f)

    def _bias(self, node: Any) -> None:
        value, name = node.input
        self._add(node, "Add", [value, self._weight(name, self._constant(name).reshape(-1, 1, 1))])

    def _clip(self, node: Any) -> None:
        low, high = (self._weight(f"limit/{n}", np.array(n, np.float32)) for n in (0.0, 6.0))
        self._add(node, "Clip", [node.input[0], low, high])

    def _flatten(self, node: Any) -> None:
        # TensorFlow's order: cell by cell, all channels of each.
        self._emit("Transpose", [node.input[0]], f"{node.name}/cells", perm=[0, 2, 3, 1])
        shape = self._weight("flat", np.array([0, -1], np.int64))
        self._emit("Reshape", [f"{node.name}/cells", shape], node.name)

    def _concat(self, node: Any) -> None:
        *values, _ = node.input
        if not set(values) <= set(self._priors):
            self._add(node, "Concat", values, axis=1)

    def _prior(self, node: Any) -> None:
        cells = self._cells[node.input[0]]
        width, height, self._variance = (
            np.array(node.attr[key].tensor.float_val, np.float64) for key in ("width", "height", "variance")
        )
        middles = (np.arange(cells) + _MIDDLE) / cells
        y, x, k = np.meshgrid(middles, middles, np.arange(len(width)), indexing="ij")
        size = np.stack([width, height], axis=-1)[k.astype(np.int64)] / self._side
        self._priors[node.name] = np.concatenate([np.stack([x, y], axis=-1), size], axis=-1).reshape(-1, 4)

    def _outputs(self, node: Any) -> None:
        encodings, scores, _ = node.input
        classes = node.attr["num_classes"].i
        for value, output, each in ((encodings, ENCODINGS, 4), (scores, SCORES, classes)):
            shape = self._weight(f"{output}/shape", np.array([0, -1, each], np.int64))
            self._emit("Reshape", [value, shape], output)


def _message(name: str) -> Any:
    """An empty message of TensorFlow's."""
    return message_factory.GetMessageClass(_pool().FindMessageTypeByName(f"{_PACKAGE}.{name}"))()


@lru_cache(maxsize=1)
def _pool() -> Any:
    """What of TensorFlow's graph.proto is read here; protobuf passes over all other fields."""
    field = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(
        name="cadpose_tensorflow.proto", package=_PACKAGE, syntax="proto3"
    )
    kinds = file.enum_type.add(name="DataType")
    for name, number in (("DT_INVALID", 0), ("DT_FLOAT", _FLOAT), ("DT_INT32", _INT32), ("DT_UINT8", _UINT8)):
        kinds.value.add(name=name, number=number)

    def message(name: str, fields: dict[str, tuple[int, Any, str, bool]], within: Any = None) -> Any:
        made = (file.message_type if within is None else within.nested_type).add(name=name)
        for key, (number, kind, of, repeated) in fields.items():
            made.field.add(
                name=key,
                number=number,
                type=kind,
                type_name=f".{_PACKAGE}.{of}" if of else None,
                label=field.LABEL_REPEATED if repeated else field.LABEL_OPTIONAL,
            )
        return made

    message("Dim", {"size": (1, field.TYPE_INT64, "", False)})
    message("Shape", {"dim": (2, field.TYPE_MESSAGE, "Dim", True)})
    message(
        "Tensor",
        {
            "dtype": (1, field.TYPE_ENUM, "DataType", False),
            "tensor_shape": (2, field.TYPE_MESSAGE, "Shape", False),
            "tensor_content": (4, field.TYPE_BYTES, "", False),
            "float_val": (5, field.TYPE_FLOAT, "", True),
            "int_val": (7, field.TYPE_INT32, "", True),
        },
    )
    message("Numbers", {"i": (3, field.TYPE_INT64, "", True)})
    message(
        "Value",
        {
            "list": (1, field.TYPE_MESSAGE, "Numbers", False),
            "s": (2, field.TYPE_BYTES, "", False),
            "i": (3, field.TYPE_INT64, "", False),
            "f": (4, field.TYPE_FLOAT, "", False),
            "tensor": (8, field.TYPE_MESSAGE, "Tensor", False),
        },
    )
    node = message(
        "NodeDef",
        {
            "name": (1, field.TYPE_STRING, "", False),
            "op": (2, field.TYPE_STRING, "", False),
            "input": (3, field.TYPE_STRING, "", True),
            "attr": (5, field.TYPE_MESSAGE, "NodeDef.AttrEntry", True),
        },
    )
    entry = message(
        "AttrEntry",
        {"key": (1, field.TYPE_STRING, "", False), "value": (2, field.TYPE_MESSAGE, "Value", False)},
        within=node,
    )
    entry.options.map_entry = True
    message("GraphDef", {"node": (1, field.TYPE_MESSAGE, "NodeDef", True)})
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return pool
