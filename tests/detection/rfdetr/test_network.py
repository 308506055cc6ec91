from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from cadpose.detection.rfdetr.network import build, configuration, require_transformers, run
from cadpose.detection.rfdetr.sizes import SIZES
from cadpose.errors import DependencyError
from tests.detection.rfdetr.published import (
    NARROW,
    SMALL,
    published_shapes,
    published_tensors,
    small_settings,
)

torch = pytest.importorskip("torch")


def network(tensors: dict[str, Any] | None = None) -> Any:
    pytest.importorskip("transformers")
    return build(small_settings(), tensors or published_tensors(SMALL, NARROW))


#: Published names and where transformers has them, one of each kind.
PLACES = {
    "backbone.0.encoder.encoder.embeddings.cls_token": "model.model.backbone.backbone.embeddings.cls_token",
    "backbone.0.encoder.encoder.encoder.layer.1.attention.attention.query.weight": (
        "model.model.backbone.backbone.encoder.layer.1.attention.q_proj.weight"
    ),
    "backbone.0.encoder.encoder.encoder.layer.1.attention.attention.key.bias": (
        "model.model.backbone.backbone.encoder.layer.1.attention.k_proj.bias"
    ),
    "backbone.0.encoder.encoder.encoder.layer.2.attention.attention.value.weight": (
        "model.model.backbone.backbone.encoder.layer.2.attention.v_proj.weight"
    ),
    "backbone.0.encoder.encoder.encoder.layer.0.attention.output.dense.weight": (
        "model.model.backbone.backbone.encoder.layer.0.attention.o_proj.weight"
    ),
    "backbone.0.encoder.encoder.encoder.layer.3.mlp.fc2.weight": (
        "model.model.backbone.backbone.encoder.layer.3.mlp.fc2.weight"
    ),
    "backbone.0.projector.stages.0.0.cv2.conv.weight": (
        "model.model.backbone.projector.projector_layer.conv2.conv.weight"
    ),
    "backbone.0.projector.stages.0.0.m.2.cv1.bn.weight": (
        "model.model.backbone.projector.projector_layer.bottlenecks.2.conv1.norm.weight"
    ),
    "backbone.0.projector.stages.0.1.bias": "model.model.backbone.projector.layer_norm.bias",
    "transformer.decoder.layers.1.norm1.weight": "model.model.decoder.layers.1.self_attn_layer_norm.weight",
    "transformer.decoder.layers.1.norm2.weight": "model.model.decoder.layers.1.cross_attn_layer_norm.weight",
    "transformer.decoder.layers.1.norm3.weight": "model.model.decoder.layers.1.layer_norm.weight",
    "transformer.decoder.layers.0.linear2.weight": "model.model.decoder.layers.0.mlp.fc2.weight",
    "transformer.decoder.layers.0.cross_attn.sampling_offsets.bias": (
        "model.model.decoder.layers.0.cross_attn.sampling_offsets.bias"
    ),
    "transformer.enc_out_bbox_embed.7.layers.1.weight": "model.model.enc_out_bbox_embed.7.layers.1.weight",
    "refpoint_embed.weight": "model.model.reference_point_embed.weight",
    "query_feat.weight": "model.model.query_feat.weight",
    "class_embed.weight": "model.class_embed.weight",
    "bbox_embed.layers.2.weight": "model.bbox_embed.layers.2.weight",
    "segmentation_head.blocks.1.dwconv.weight": "blocks.1.depthwise_conv.weight",
    "segmentation_head.blocks.1.pwconv1.weight": "blocks.1.pointwise_conv.weight",
    "segmentation_head.query_features_block.layers.2.weight": "query_features_block.mlp.fc2.weight",
    "segmentation_head.query_features_proj.weight": "query_features_proj.weight",
    "segmentation_head.spatial_features_proj.weight": "spatial_features_proj.weight",
    "segmentation_head.bias": "segmentation_bias",
}


def test_every_published_tensor_finds_its_place() -> None:
    tensors = published_tensors(SMALL, NARROW)
    parameters = dict(network(tensors).named_parameters())
    for name, place in PLACES.items():
        assert torch.equal(parameters[place], tensors[name]), name
    joined = tensors["transformer.decoder.layers.1.self_attn.in_proj_weight"].chunk(3)
    for part, values in zip("qkv", joined, strict=True):
        place = f"model.model.decoder.layers.1.self_attn.{part}_proj.weight"
        assert torch.equal(parameters[place], values), place
    # Nothing is left as it was initialised, and nothing is left over.
    assert sum(p.numel() for p in parameters.values()) == sum(t.numel() for t in tensors.values())


def test_outputs_have_the_described_shapes_and_repeat() -> None:
    x = np.random.default_rng(0).normal(size=(1, 3, SMALL.side, SMALL.side)).astype(np.float32)
    net = network()
    first, second = run(net, x), run(net, x)
    assert {k: v.shape for k, v in first.items()} == {
        "dets": (1, SMALL.queries, 4),
        "labels": (1, SMALL.queries, 91),
        "masks": (1, SMALL.queries, SMALL.side // 4, SMALL.side // 4),
    }
    for name, values in first.items():
        assert np.isfinite(values).all()
        np.testing.assert_array_equal(values, second[name])
    assert not np.allclose(first["masks"], run(net, -x)["masks"], atol=1e-3)


@pytest.mark.parametrize(
    ("change", "said"),
    [("missing", "lack 1 tensors"), ("extra", "have in excess 1"), ("shape", "have in another shape 1")],
)
def test_weights_of_another_network_are_refused(change: str, said: str) -> None:
    tensors = published_tensors(SMALL, NARROW)
    if change == "missing":
        del tensors["class_embed.bias"]
    elif change == "extra":
        tensors["segmentation_head.blocks.2.dwconv.bias"] = torch.zeros(NARROW.decoder)
    else:
        tensors["query_feat.weight"] = tensors["query_feat.weight"][:-1]
    with pytest.raises(DependencyError, match="do not fit") as caught:
        network(tensors)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_nothing_is_printed_and_transformers_keeps_its_settings(capfd: pytest.CaptureFixture[str]) -> None:
    logging = pytest.importorskip("transformers.utils.logging")
    logging.set_verbosity_info()
    logging.enable_progress_bar()
    try:
        network()
        assert logging.get_verbosity() == logging.INFO and logging.is_progress_bar_enabled()
    finally:
        logging.set_verbosity_warning()
    assert capfd.readouterr() == ("", "")


def test_without_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(DependencyError, match=r"pip install 'cadpose\[rfdetr\]'"):
        require_transformers("cpu")


def test_without_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("transformers")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    require_transformers("cpu")
    with pytest.raises(DependencyError, match="GPU"):
        require_transformers("cuda")


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_the_published_sizes_take_the_published_names(name: str) -> None:
    pytest.importorskip("transformers")
    tensors = {n: torch.zeros(s) for n, s in published_shapes(SIZES[name])}
    net = build(configuration(SIZES[name]), tensors)
    millions = sum(p.numel() for p in net.parameters()) / 1e6
    # As the package's README tells.
    told = {"n": 33.6, "s": 33.7, "m": 35.7, "l": 36.2, "xl": 38.1, "2xl": 38.6}[name]
    assert millions == pytest.approx(told, abs=0.4)
