from __future__ import annotations

import numpy as np
import pytest

from cadpose.detection.ssd_graph import ENCODINGS, IMAGES, SCORES, _message, read_graph
from cadpose.onnx_session import open_session

SAME = 'attr { key: "padding" value { s: "SAME" } }'
STRIDES = 'attr { key: "strides" value { list { i: 1 i: %d i: %d i: 1 } } }'


def node(name: str, op: str, *inputs: str, more: str = "") -> str:
    asked = " ".join(f'input: "{i}"' for i in inputs)
    return f'node {{ name: "{name}" op: "{op}" {asked} {more} }}'


def numbers(key: str, *values: float) -> str:
    floats = " ".join(f"float_val: {v}" for v in values)
    return f'attr {{ key: "{key}" value {{ tensor {{ dtype: DT_FLOAT {floats} }} }} }}'


TEXT = " ".join(
    [
        node("image_tensor", "Placeholder"),
        node("mul", "Mul", "image_tensor", "mul/x"),
        node("sub", "Sub", "mul", "sub/y"),
        node("conv", "Conv2D", "sub", "kernel", more=SAME + STRIDES % (2, 2)),
        node("deep", "DepthwiseConv2dNative", "conv", "deep/kernel", more=SAME + STRIDES % (1, 1)),
        node(
            "norm", "FusedBatchNorm", "deep", "gamma", "beta", "mean", "variance",
            more='attr { key: "epsilon" value { f: 0.001 } }',
        ),
        node("relu", "Relu6", "norm"),
        node("same", "Identity", "relu"),
        node("box", "Conv2D", "same", "box/kernel", more=SAME + STRIDES % (1, 1)),
        node("box/bias", "BiasAdd", "box", "box/bias/values"),
        node("class", "Conv2D", "same", "class/kernel", more=SAME + STRIDES % (1, 1)),
        node("box/flat", "Flatten", "box/bias"),
        node("class/flat", "Flatten", "class"),
        node("boxes", "ConcatV2", "box/flat", "axis"),
        node("classes", "ConcatV2", "class/flat", "axis"),
        node(
            "prior", "PriorBox", "box/bias", "image_tensor",
            more=numbers("width", 2.0, 4.0) + numbers("height", 4.0, 2.0)
            + numbers("variance", 0.1, 0.1, 0.2, 0.2),
        ),
        node("priors", "ConcatV2", "prior", "axis"),
        node("sigmoid", "Sigmoid", "classes"),
        node(
            "out", "DetectionOutput", "boxes", "sigmoid", "priors",
            more='attr { key: "num_classes" value { i: 3 } }',
        ),
        "library { }",
    ]
)  # fmt: skip
RNG = np.random.default_rng(0)
WEIGHTS: dict[str, np.ndarray] = {
    "mul/x": np.array(2.0 / 255.0, np.float32),
    "sub/y": np.array(1.0, np.float32),
    "kernel": RNG.normal(size=(3, 3, 3, 4)).astype(np.float32),
    "deep/kernel": RNG.normal(size=(3, 3, 4, 1)).astype(np.float32),
    "gamma": np.ones(4, np.float32),
    "beta": np.full(4, 3.0, np.float32),
    "mean": np.zeros(4, np.float32),
    "variance": np.ones(4, np.float32),
    "box/kernel": RNG.normal(size=(1, 1, 4, 8)).astype(np.float32),
    "box/bias/values": np.arange(8, dtype=np.float32),
    "class/kernel": RNG.normal(size=(1, 1, 4, 6)).astype(np.float32),
}


def frozen(weights: dict[str, np.ndarray]) -> bytes:
    graph = _message("GraphDef")
    for name, values in weights.items():
        tensor = graph.node.add(name=name, op="Const").attr["value"].tensor
        tensor.dtype = 1
        for size in np.shape(values):
            tensor.tensor_shape.dim.add(size=size)
        tensor.tensor_content = np.asarray(values).tobytes()
    data: bytes = graph.SerializeToString()
    return data


def by_hand(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same in NumPy, for a square of even side."""

    def convolved(x: np.ndarray, kernel: np.ndarray, stride: int) -> np.ndarray:
        k = kernel.shape[0]
        before = (k - 1) // 2 if stride == 1 else (k - 2) // 2
        padded = np.pad(x, ((before, k - 1 - before), (before, k - 1 - before), (0, 0)))
        cells = range(0, x.shape[0], stride)
        return np.array(
            [[np.tensordot(padded[y : y + k, z : z + k], kernel, axes=3) for z in cells] for y in cells]
        )

    x = image.astype(np.float64) * WEIGHTS["mul/x"] - WEIGHTS["sub/y"]
    x = convolved(x, WEIGHTS["kernel"], 2)
    deep = WEIGHTS["deep/kernel"][..., 0]
    each = [convolved(x[..., c : c + 1], deep[:, :, c, None, None], 1) for c in range(4)]
    x = np.concatenate(each, axis=-1)
    x = np.clip(x / np.sqrt(1.001) + 3.0, 0.0, 6.0)
    boxes = convolved(x, WEIGHTS["box/kernel"], 1) + WEIGHTS["box/bias/values"]
    classes = convolved(x, WEIGHTS["class/kernel"], 1)
    return boxes.reshape(-1, 4), 1.0 / (1.0 + np.exp(-classes.reshape(-1, 3)))


def test_the_network_computes_what_the_graph_says() -> None:
    graph = read_graph(frozen(WEIGHTS), TEXT, 8)
    image = RNG.integers(0, 256, (8, 8, 3), dtype=np.uint8)
    session = open_session(graph.network)
    encodings, scores = session.run([ENCODINGS, SCORES], {IMAGES: np.stack([image, image[::-1]])})
    for one, answer in ((image, 0), (image[::-1], 1)):
        boxes, chances = by_hand(one)
        np.testing.assert_allclose(encodings[answer], boxes, rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(scores[answer], chances, rtol=1e-4, atol=1e-5)


def test_priors_lie_in_the_middle_of_their_cells() -> None:
    graph = read_graph(frozen(WEIGHTS), TEXT, 8)
    assert graph.priors.shape == (4 * 4 * 2, 4)
    np.testing.assert_allclose(graph.priors[:2], [[0.125, 0.125, 0.25, 0.5], [0.125, 0.125, 0.5, 0.25]])
    np.testing.assert_allclose(graph.priors[2, :2], [0.375, 0.125])
    np.testing.assert_allclose(graph.variance, [0.1, 0.1, 0.2, 0.2], rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "weights", "reason"),
    [
        (TEXT.replace("Relu6", "Elu"), WEIGHTS, "Elu"),
        (TEXT.replace('"SAME"', '"VALID"'), WEIGHTS, "padded"),
        (TEXT, {k: v for k, v in WEIGHTS.items() if k != "kernel"}, "kernel"),
        (TEXT.replace("PriorBox", "Const"), WEIGHTS, "prior"),
        ("node {", WEIGHTS, "no graph"),
        (TEXT.replace("DetectionOutput", "Const"), WEIGHTS, "detection output"),
        (TEXT.replace("list { i: 1 i: 2 i: 2 i: 1 }", "list { i: 1 i: 0 i: 0 i: 1 }"), WEIGHTS, "needs"),
        (TEXT.replace("list { i: 1 i: 2 i: 2 i: 1 }", "list { i: 1 }"), WEIGHTS, "needs"),
        (TEXT.replace("float_val: 0.2 float_val: 0.2", ""), WEIGHTS, "variances"),
    ],
)
def test_another_graph_is_refused(text: str, weights: dict[str, np.ndarray], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        read_graph(frozen(weights), text, 8)


def test_damaged_weights_are_refused() -> None:
    with pytest.raises(ValueError, match="no graph"):
        read_graph(b"\x0a\xff", TEXT, 8)


def test_a_constant_of_absurd_size_is_refused() -> None:
    graph = _message("GraphDef")
    graph.ParseFromString(frozen(WEIGHTS))
    (node,) = [n for n in graph.node if n.name == "sub/y"]
    for _ in range(4):
        node.attr["value"].tensor.tensor_shape.dim.add(size=1 << 11)
    with pytest.raises(ValueError, match="numbers"):
        read_graph(graph.SerializeToString(), TEXT, 8)
