"""RF-DETR-Seg as an ONNX file with its description, for machines without torch."""

from __future__ import annotations

import hashlib
import tempfile
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cadpose.detection.rfdetr.checkpoint import read_checkpoint
from cadpose.detection.rfdetr.network import build, configuration, require_transformers
from cadpose.detection.rfdetr.sizes import BOXES, LOGITS, MASKS, SIZES, head_of
from cadpose.errors import DependencyError, InputError
from cadpose.library.storage import write_atomic
from cadpose.weights import UNPUBLISHED, placed

if TYPE_CHECKING:
    from torch import Tensor

#: The first version of ONNX's operators with all that the network needs is 16; 17 has its layer norm.
OPSET = 17


def export_rfdetr(size: str, folder: Path) -> Path:
    """Write ``rf-detr-seg-SIZE.onnx`` and the description beside it, for ``--detector onnx:FILE.json``.

    Returns:
        The description.

    Raises:
        InputError: there is no such size.
        DependencyError: the packages or the weights are not there.
    """
    if size not in SIZES:
        raise InputError(f"RF-DETR has no size {size}: choose one of {', '.join(SIZES)}.")
    chosen = SIZES[size]
    require_transformers("cpu")
    if find_spec("onnx") is None:
        raise DependencyError("the export needs onnx: install it with `pip install 'cadpose[rfdetr]'`")
    tensors = read_checkpoint(placed(UNPUBLISHED[chosen.weights]), chosen.queries)
    return export_network(build(configuration(chosen), tensors), chosen.side, folder, chosen.weights)


def export_network(network: Any, side: int, folder: Path, name: str) -> Path:
    """Write a network that is built as NAME.onnx, and its description as NAME.json.

    Args:
        network: From :func:`cadpose.detection.rfdetr.network.build`.
        side: Side of its input in pixels.
        folder: Where to, made where it is not there.
        name: What to call both files.

    Returns:
        The description.
    """
    data = _onnx(network, side)
    head = head_of(side, f"{name}.onnx", hashlib.sha256(data).hexdigest())
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / head.network, data)
    description = folder / f"{name}.json"
    write_atomic(description, head.model_dump_json(indent=2, exclude_defaults=True).encode() + b"\n")
    return description


def _onnx(network: Any, side: int) -> bytes:
    import torch

    class Flat(torch.nn.Module):
        """The three outputs that are read, as a tuple."""

        def __init__(self) -> None:
            super().__init__()
            self.network = network

        def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
            out = self.network(pixel_values=x)
            return out.pred_boxes, out.logits, out.pred_masks

    embeddings = network.model.model.backbone.backbone.embeddings
    # While tracing it would resize the positions, which have the right size, by an operator that ONNX lacks.
    embeddings.interpolate_pos_encoding = lambda *_: embeddings.position_embeddings
    try:
        with tempfile.TemporaryDirectory() as folder, torch.no_grad(), warnings.catch_warnings():
            # Sizes are constants here, and meant to be; and the older exporter is taken on purpose.
            warnings.simplefilter("ignore")
            written = Path(folder) / "network.onnx"
            torch.onnx.export(
                Flat().eval(),
                (torch.zeros(1, 3, side, side),),
                written,
                input_names=["input"],
                output_names=[BOXES, LOGITS, MASKS],
                opset_version=OPSET,
                dynamo=False,
            )
            return written.read_bytes()
    finally:
        del embeddings.interpolate_pos_encoding
