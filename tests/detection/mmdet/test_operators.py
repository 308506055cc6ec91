"""Held against ONNX Runtime's own operators, which have the same definitions."""

from __future__ import annotations

from typing import Any

import numpy as np
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cadpose.detection.mmdet.operators import deform_conv2d, roi_align, suppress

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

Floats = NDArray[np.float32]


def run(operator: str, opset: int, inputs: dict[str, NDArray[Any]], **attributes: Any) -> NDArray[Any]:
    """One ONNX operator on arrays."""
    helper = onnx.helper
    given_inputs = [
        helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(value.dtype), value.shape)
        for name, value in inputs.items()
    ]
    kind = onnx.TensorProto.INT64 if operator == "NonMaxSuppression" else onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        [helper.make_node(operator, list(inputs), ["out"], **attributes)],
        "one",
        given_inputs,
        [helper.make_tensor_value_info("out", kind, None)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=9)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, inputs)[0])


def boxes_in(rng: np.random.Generator, count: int, side: float) -> Floats:
    """(count, 4) boxes, many of which overlap."""
    low = rng.uniform(0.0, side, (count, 2))
    return np.concatenate([low, low + rng.uniform(1.0, side / 2, (count, 2))], axis=1).astype(np.float32)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.sampled_from([1, 2, 17, 255, 256, 257, 700]),
    threshold=st.floats(0.05, 0.95),
)
def test_suppression_is_onnxruntimes(seed: int, count: int, threshold: float) -> None:
    rng = np.random.default_rng(seed)
    boxes = boxes_in(rng, count, 60.0)
    scores = rng.permutation(np.linspace(0.01, 0.99, count)).astype(np.float32)
    inputs: dict[str, NDArray[Any]] = {
        "boxes": boxes[None],
        "scores": scores[None, None],
        "most": np.array([count], np.int64),
        "threshold": np.array([threshold], np.float32),
    }
    wanted = run("NonMaxSuppression", 11, inputs)[:, 2]
    found = suppress(torch.from_numpy(boxes), torch.from_numpy(scores), float(np.float32(threshold)))
    np.testing.assert_array_equal(found.numpy(), wanted)


def test_suppression_of_nothing_and_of_copies() -> None:
    none = suppress(torch.zeros((0, 4)), torch.zeros(0), 0.5)
    assert none.tolist() == [] and none.dtype == torch.int64
    # Of equal scores the first is kept, over many blocks.
    copies = torch.tensor([[0.0, 0.0, 4.0, 4.0]]).repeat(1000, 1)
    assert suppress(copies, torch.ones(1000), 0.5).tolist() == [0]
    apart = copies + 10.0 * torch.arange(1000)[:, None]
    assert suppress(apart, torch.arange(1000.0), 0.5).tolist() == list(range(999, -1, -1))


def test_counting_whole_pixels() -> None:
    boxes = torch.tensor([[0.0, 0.0, 9.0, 9.0], [5.0, 0.0, 14.0, 9.0]])  # 10 pixels wide, 5 shared: 1/3
    scores = torch.tensor([0.9, 0.8])
    assert suppress(boxes, scores, 0.32, offset=1).tolist() == [0]
    assert suppress(boxes, scores, 0.32).tolist() == [0, 1]  # 4 of 14 shared


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    sampling=st.sampled_from([0, 1, 2, 3]),
    aligned=st.booleans(),
    size=st.sampled_from([(7, 7), (14, 14), (1, 1), (3, 5)]),
    scale=st.sampled_from([1.0, 0.25, 0.5, 0.37]),
)
def test_roi_align_is_onnxruntimes(
    seed: int, sampling: int, aligned: bool, size: tuple[int, int], scale: float
) -> None:
    rng = np.random.default_rng(seed)
    features = rng.standard_normal((2, 3, 19, 23)).astype(np.float32)
    # Some reach out of the picture, and some lie outside of it.
    boxes = (boxes_in(rng, 30, 24.0) - 6.0) / np.float32(scale)
    which = rng.integers(0, 2, 30)
    inputs = {"x": features, "rois": boxes, "which": which}
    wanted = run(
        "RoiAlign",
        16,
        inputs,
        output_height=size[0],
        output_width=size[1],
        sampling_ratio=sampling,
        spatial_scale=scale,
        coordinate_transformation_mode="half_pixel" if aligned else "output_half_pixel",
    )
    rois = torch.from_numpy(np.concatenate([which[:, None].astype(np.float32), boxes], axis=1))
    found = roi_align(torch.from_numpy(features), rois, size, scale, sampling, aligned=aligned)
    np.testing.assert_allclose(found.numpy(), wanted, atol=6e-5)


def test_roi_align_of_nothing() -> None:
    features = torch.zeros((1, 5, 8, 8))
    assert roi_align(features, torch.zeros((0, 5)), (7, 7), 0.25).shape == (0, 5, 7, 7)
    flat = torch.tensor([[0.0, 2.0, 2.0, 2.0, 6.0]])  # no width: no sample
    assert roi_align(features + 1, flat, (2, 2), 1.0).tolist() == [[[[0.0, 0.0]] * 2] * 5]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    kernel=st.sampled_from([(3, 3), (1, 1), (3, 5)]),
    stride=st.sampled_from([(1, 1), (2, 2), (2, 1)]),
    dilation=st.sampled_from([(1, 1), (3, 3), (1, 2)]),
    groups=st.sampled_from([1, 2]),
    offset_groups=st.sampled_from([1, 2]),
)
def test_deformed_convolution_is_onnxruntimes(
    seed: int,
    kernel: tuple[int, int],
    stride: tuple[int, int],
    dilation: tuple[int, int],
    groups: int,
    offset_groups: int,
) -> None:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((2, 4, 13, 17)).astype(np.float32)
    weight = rng.standard_normal((6, 4 // groups, *kernel)).astype(np.float32)
    padding = tuple(d * (k // 2) for d, k in zip(dilation, kernel, strict=True))
    out = [
        (side + 2 * p - d * (k - 1) - 1) // s + 1
        for side, p, d, k, s in zip(x.shape[2:], padding, dilation, kernel, stride, strict=True)
    ]
    # Far enough to leave the picture on all sides.
    offset = rng.uniform(-6.0, 6.0, (2, offset_groups * 2 * kernel[0] * kernel[1], *out)).astype(np.float32)
    wanted = run(
        "DeformConv",
        19,
        {"x": x, "weight": weight, "offset": offset},
        strides=stride,
        pads=[*padding, *padding],
        dilations=dilation,
        group=groups,
        offset_group=offset_groups,
    )
    found = deform_conv2d(
        torch.from_numpy(x),
        torch.from_numpy(offset),
        torch.from_numpy(weight),
        stride=stride,
        padding=(padding[0], padding[1]),
        dilation=dilation,
        groups=groups,
        offset_groups=offset_groups,
    )
    np.testing.assert_allclose(found.numpy(), wanted, atol=6e-5)


def test_without_offsets_it_is_a_convolution() -> None:
    torch.manual_seed(0)
    x, weight = torch.randn(1, 8, 40, 60), torch.randn(5, 8, 3, 3)
    plain = torch.nn.functional.conv2d(x, weight, stride=2, padding=3, dilation=3)
    none = torch.zeros((1, 18, *plain.shape[2:]))
    found = deform_conv2d(x, none, weight, stride=(2, 2), padding=(3, 3), dilation=(3, 3))
    np.testing.assert_allclose(found.numpy(), plain.numpy(), atol=1e-4)
