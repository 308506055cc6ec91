"""The trained refinement network as an ONNX file."""

from __future__ import annotations

from pathlib import Path

import torch

from cadpose.encoder import CHANNELS16
from cadpose.training.checkpoints import read_checkpoint, set_weights, tensors
from cadpose.training.lite.export import write_network
from cadpose.training.refinement.network import CELLS, OfMaps, StepNetwork


def export(weights: Path, path: Path) -> None:
    """Write the network of a checkpoint to ``path``.

    ``photo`` and ``view`` (N, 112, 14, 14), the encoder's maps, and ``cover`` (N, 1, 14, 14) to ``step``
    (N, 6) as :func:`cadpose.alignment.refinement.steps.stepped` takes it and ``error`` (N,) in degrees.

    Raises:
        InputError: the file is no checkpoint of this network.
        DependencyError: ``onnx`` is not installed.
        ValueError: the ONNX file answers differently from the network.
    """
    maps = torch.rand((2, CHANNELS16, CELLS, CELLS))
    inputs = {"photo": maps, "view": maps.flip(0), "cover": torch.rand((2, 1, CELLS, CELLS))}
    write_network(OfMaps(trained_network(weights)).eval(), inputs, ("step", "error"), path, {})


def trained_network(path: Path) -> StepNetwork:
    """The averaged network of a checkpoint.

    Raises:
        InputError: the file is no checkpoint of this kind.
    """
    content = read_checkpoint(path)
    model = StepNetwork()
    set_weights(model, tensors(content.get("average"), str(path)), str(path))
    return model.eval()
