"""RF-DETR-Seg in transformers' classes with Roboflow's published weights.

The published names are not transformers'; its own table of conversions for ``RfDetrForInstanceSegmentation``
brings them over, and every name must find its place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cadpose.detection.rfdetr.sizes import BOXES, GROUPS, LOGITS, MASKS, PATCH, Size
from cadpose.errors import DependencyError

if TYPE_CHECKING:
    from torch import Tensor

_MEND = "install it with `pip install 'cadpose[rfdetr]'`"


def require_transformers(device: str) -> None:
    """Nothing, where the packages and the device are there.

    Raises:
        DependencyError: they are not.
    """
    try:
        import torch
        from transformers import RfDetrForInstanceSegmentation  # noqa: F401
    except ImportError as error:
        reason = (str(error).strip().splitlines() or ["ImportError"])[0]
        raise DependencyError(f"RF-DETR is not there ({reason}): {_MEND}") from None
    if device.startswith("cuda") and not torch.cuda.is_available():
        raise DependencyError(
            "RF-DETR on cuda needs a GPU and a build of torch for CUDA; neither is seen here"
        )


def configuration(size: Size) -> Any:
    """transformers' configuration of a published size."""
    from transformers import RfDetrConfig

    return RfDetrConfig(
        backbone_config={
            "model_type": "rf_detr_dinov2",
            "hidden_size": 384,
            "num_hidden_layers": 12,
            "num_attention_heads": 6,
            "image_size": size.side,
            "patch_size": PATCH,
            "num_windows": size.windows,
            "out_features": ["stage3", "stage6", "stage9", "stage12"],
        },
        d_model=256,
        num_queries=size.queries,
        group_detr=GROUPS,
        decoder_layers=size.layers,
        decoder_self_attention_heads=8,
        decoder_cross_attention_heads=16,
        decoder_n_points=2,
        num_labels=91,
        # The published code has this in the projector; transformers' default of 1e-5 moves boxes by 1e-4.
        layer_norm_eps=1e-6,
    )


def build(settings: Any, tensors: Mapping[str, Tensor], device: str = "cpu") -> Any:
    """The network in evaluation mode, every weight taken from ``tensors`` by its published name.

    Args:
        settings: From :func:`configuration`.
        tensors: From :func:`cadpose.detection.rfdetr.checkpoint.read_checkpoint`.
        device: ``"cpu"`` or ``"cuda"``.

    Raises:
        DependencyError: a weight is missing, left over or of another shape.
    """
    from transformers import RfDetrForInstanceSegmentation

    with _quiet():
        try:
            network, told = RfDetrForInstanceSegmentation.from_pretrained(
                None,
                config=settings,
                state_dict=dict(tensors),
                output_loading_info=True,
                local_files_only=True,
                ignore_mismatched_sizes=True,
            )
        except (RuntimeError, ValueError) as error:
            raise DependencyError(
                f"the weights of RF-DETR do not fit ({str(error).splitlines()[0]})"
            ) from None
    for kind, what in (
        ("missing_keys", "lack"),
        ("unexpected_keys", "have in excess"),
        ("mismatched_keys", "have in another shape"),
    ):
        if names := sorted(str(k[0] if isinstance(k, tuple) else k) for k in told[kind]):
            raise DependencyError(
                f"the weights of RF-DETR do not fit the network of that size: they {what} {len(names)} "
                f"tensors, {names[0]} first"
            )
    return network.to(device).eval()


def run(network: Any, x: NDArray[np.float32], device: str = "cpu") -> dict[str, NDArray[np.float32]]:
    """The network's outputs for one photo, by the names that :func:`head_of` describes.

    Args:
        network: From :func:`build`.
        x: (1, 3, side, side) float32.
        device: Where it lies.

    Returns:
        Boxes (1, N, 4), logits (1, N, 91) and masks (1, N, side / 4, side / 4).
    """
    import torch

    with torch.inference_mode():
        out = network(pixel_values=torch.from_numpy(x).to(device))
    return {
        BOXES: out.pred_boxes.float().cpu().numpy(),
        LOGITS: out.logits.float().cpu().numpy(),
        MASKS: out.pred_masks.float().cpu().numpy(),
    }


@contextmanager
def _quiet() -> Iterator[None]:
    """transformers without its progress bar and its table of keys, which are checked here."""
    from transformers.utils import logging

    level, bar = logging.get_verbosity(), logging.is_progress_bar_enabled()
    logging.set_verbosity(logging.CRITICAL)
    logging.disable_progress_bar()
    try:
        yield
    finally:
        logging.set_verbosity(level)
        if bar:
            logging.enable_progress_bar()
