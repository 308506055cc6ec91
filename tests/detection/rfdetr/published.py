"""Names and shapes of the tensors in a published file of RF-DETR-Seg, and a small network of that kind.

Written from the modules of Roboflow's package ``rfdetr`` 1.11.2, and compared with what its
``build_model_from_config`` makes for all six sizes: equal but for ``_kp_active_mask``, an empty buffer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cadpose.detection.rfdetr.network import configuration
from cadpose.detection.rfdetr.sizes import GROUPS, PATCH, Size

if TYPE_CHECKING:
    from torch import Tensor

CLASSES = 91


@dataclass(frozen=True)
class Widths:
    """Widths of the layers; the defaults are the published ones."""

    backbone: int = 384
    blocks: int = 12
    decoder: int = 256
    feedforward: int = 2048


#: A network of a few hundred thousand parameters, and its widths.
SMALL = Size("n", 48, 2, 2, 6)
NARROW = Widths(backbone=24, blocks=4, decoder=32, feedforward=40)


def small_settings() -> Any:
    """transformers' configuration of SMALL with widths NARROW."""
    settings = configuration(SMALL)
    return type(settings)(
        backbone_config={
            **settings.backbone_config.to_dict(),
            "hidden_size": NARROW.backbone,
            "num_hidden_layers": NARROW.blocks,
            "out_features": ["stage1", "stage2", "stage3", "stage4"],
            "out_indices": None,
        },
        **{
            k: getattr(settings, k)
            for k in ("num_queries", "group_detr", "decoder_layers", "decoder_n_points", "layer_norm_eps")
        },
        decoder_self_attention_heads=8,
        decoder_cross_attention_heads=16,
        num_labels=CLASSES,
        d_model=NARROW.decoder,
        decoder_ffn_dim=NARROW.feedforward,
        intermediate_size=4 * NARROW.decoder,
    )


def published_tensors(size: Size, widths: Widths = Widths(), *, seed: int = 0) -> dict[str, Tensor]:
    """Random tensors by their published names; those of norms near one, so that nothing blows up."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    out = {}
    for name, shape in published_shapes(size, widths):
        values = torch.randn(shape, generator=generator)
        is_gain = name.endswith(
            (".lambda1", "norm.weight", "norm_in.weight", "bn.weight", "stages.0.1.weight")
        )
        if is_gain or (".norm" in name and name.endswith("weight")):
            values = 1.0 + 0.1 * values
        elif values.ndim > 1 and "embed" not in name:
            values = values / values[0].numel() ** 0.5
        else:
            values = values * 0.1
        out[name] = values
    return out


def published_shapes(size: Size, widths: Widths = Widths()) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Every name with its shape."""
    d, w = widths.decoder, widths.backbone
    yield from _decoder(size, widths)
    for g in range(GROUPS):
        yield from _linear(f"transformer.enc_output.{g}", d, d)
        yield from _vectors(f"transformer.enc_output_norm.{g}", d)
        yield from _box_head(f"transformer.enc_out_bbox_embed.{g}", d)
        yield from _linear(f"transformer.enc_out_class_embed.{g}", CLASSES, d)
    yield from _linear("class_embed", CLASSES, d)
    yield from _box_head("bbox_embed", d)
    yield from _mask_head(size, d)
    yield "refpoint_embed.weight", (GROUPS * size.queries, 4)
    yield "query_feat.weight", (GROUPS * size.queries, d)
    root = "backbone.0.encoder.encoder"
    yield f"{root}.embeddings.cls_token", (1, 1, w)
    yield f"{root}.embeddings.mask_token", (1, w)
    yield f"{root}.embeddings.position_embeddings", (1, 1 + (size.side // PATCH) ** 2, w)
    yield f"{root}.embeddings.patch_embeddings.projection.weight", (w, 3, PATCH, PATCH)
    yield f"{root}.embeddings.patch_embeddings.projection.bias", (w,)
    for i in range(widths.blocks):
        yield from _block(f"{root}.encoder.layer.{i}", w)
    yield from _vectors(f"{root}.layernorm", w)
    yield from _projector("backbone.0.projector.stages.0", d, w)


def _linear(name: str, rows: int, cols: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.weight", (rows, cols)
    yield f"{name}.bias", (rows,)


def _vectors(name: str, width: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.weight", (width,)
    yield f"{name}.bias", (width,)


def _box_head(name: str, d: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    for i, rows in enumerate((d, d, 4)):
        yield from _linear(f"{name}.layers.{i}", rows, d)


def _decoder(size: Size, widths: Widths) -> Iterator[tuple[str, tuple[int, ...]]]:
    d, f = widths.decoder, widths.feedforward
    for i in range(size.layers):
        root = f"transformer.decoder.layers.{i}"
        yield f"{root}.self_attn.in_proj_weight", (3 * d, d)
        yield f"{root}.self_attn.in_proj_bias", (3 * d,)
        yield from _linear(f"{root}.self_attn.out_proj", d, d)
        # 16 heads, one level, two points.
        yield from _linear(f"{root}.cross_attn.sampling_offsets", 64, d)
        yield from _linear(f"{root}.cross_attn.attention_weights", 32, d)
        yield from _linear(f"{root}.cross_attn.value_proj", d, d)
        yield from _linear(f"{root}.cross_attn.output_proj", d, d)
        yield from _linear(f"{root}.linear1", f, d)
        yield from _linear(f"{root}.linear2", d, f)
        for k in (1, 2, 3):
            yield from _vectors(f"{root}.norm{k}", d)
    yield from _vectors("transformer.decoder.norm", d)
    yield from _linear("transformer.decoder.ref_point_head.layers.0", d, 2 * d)
    yield from _linear("transformer.decoder.ref_point_head.layers.1", d, d)


def _mask_head(size: Size, d: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield "segmentation_head.bias", (1,)
    for i in range(size.layers):
        root = f"segmentation_head.blocks.{i}"
        yield f"{root}.dwconv.weight", (d, 1, 3, 3)
        yield f"{root}.dwconv.bias", (d,)
        yield from _vectors(f"{root}.norm", d)
        yield from _linear(f"{root}.pwconv1", d, d)
    yield "segmentation_head.spatial_features_proj.weight", (d, d, 1, 1)
    yield "segmentation_head.spatial_features_proj.bias", (d,)
    yield from _vectors("segmentation_head.query_features_block.norm_in", d)
    yield from _linear("segmentation_head.query_features_block.layers.0", 4 * d, d)
    yield from _linear("segmentation_head.query_features_block.layers.2", d, 4 * d)
    yield from _linear("segmentation_head.query_features_proj", d, d)


def _block(root: str, w: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield from _vectors(f"{root}.norm1", w)
    for part in ("query", "key", "value"):
        yield from _linear(f"{root}.attention.attention.{part}", w, w)
    yield from _linear(f"{root}.attention.output.dense", w, w)
    yield f"{root}.layer_scale1.lambda1", (w,)
    yield from _vectors(f"{root}.norm2", w)
    yield from _linear(f"{root}.mlp.fc1", 4 * w, w)
    yield from _linear(f"{root}.mlp.fc2", w, 4 * w)
    yield f"{root}.layer_scale2.lambda1", (w,)


def _projector(root: str, d: int, w: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    half = d // 2
    convolutions = [("0.cv1", d, 4 * w, 1), ("0.cv2", d, 5 * half, 1)]
    convolutions += [(f"0.m.{i}.cv{k}", half, half, 3) for i in range(3) for k in (1, 2)]
    for name, rows, cols, side in convolutions:
        yield f"{root}.{name}.conv.weight", (rows, cols, side, side)
        yield from _vectors(f"{root}.{name}.bn", rows)
    yield from _vectors(f"{root}.1", d)
