"""Files of ``torch.save``: read without unpickling objects, set strictly, written so that one can go on."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from cadpose.errors import InputError
from cadpose.library.storage import write_atomic
from cadpose.torch_files import read_torch_file

#: Largest checkpoint that is read; MoCo's with its optimiser and queue has some 340 MB.
MAX_BYTES = 2 * 2**30
_FORMAT = 1
#: What weights are made of; the counters of batches are whole numbers.
_NUMBERS = frozenset({torch.float16, torch.bfloat16, torch.float32, torch.float64, torch.int64})


def read_checkpoint(path: Path) -> dict[str, Any]:
    """A file of ``torch.save``: tensors, numbers, texts and containers of them, nothing else.

    Raises:
        InputError: it is not there, too large, or holds anything else.
    """
    content = read_torch_file(path, MAX_BYTES)
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds no dictionary of weights")
    return content


def tensors(value: Any, name: str) -> dict[str, Tensor]:
    """The tensors of a dictionary by name.

    Raises:
        InputError: it is none; the message begins with ``name``.
    """
    if not isinstance(value, Mapping):
        raise InputError(f"{name}: holds no dictionary of weights")
    return {str(k): v for k, v in value.items() if isinstance(v, Tensor)}


def set_weights(module: nn.Module, weights: Mapping[str, Tensor], name: str) -> None:
    """Set a module's parameters and buffers, in place.

    Strict, but for counters of batches, which old checkpoints lack, and for what the module has not.

    Raises:
        InputError: one is missing, of another shape or kind, or not finite; the message begins with ``name``.
    """
    wanted = module.state_dict()
    for key, own in wanted.items():
        if key not in weights:
            if key.endswith("num_batches_tracked"):
                continue
            raise InputError(f"{name}: is not a checkpoint of this network, it has no {key}")
        if weights[key].shape != own.shape:
            raise InputError(
                f"{name}: {key} has shape {tuple(weights[key].shape)}, this network's has {tuple(own.shape)}"
            )
        if weights[key].dtype not in _NUMBERS or weights[key].layout != torch.strided:
            raise InputError(f"{name}: {key} holds numbers of another kind, save it as float32")
        if not torch.isfinite(weights[key]).all():
            raise InputError(f"{name}: {key} holds values that are not numbers")
    module.load_state_dict(wanted | {k: v for k, v in weights.items() if k in wanted})


def write_checkpoint(
    path: Path,
    settings: Mapping[str, Any],
    optimiser: torch.optim.Optimizer,
    rows: list[dict[str, float]],
    content: Mapping[str, Any],
) -> None:
    """Write what a training needs to go on after ``len(rows)`` epochs, whole or not at all.

    Args:
        path: File to write.
        settings: What must be the same when the training goes on; plain JSON values.
        optimiser: Its state is kept.
        rows: Curves, one row an epoch.
        content: What else to keep: the weights, by name.
    """
    own = {
        "format": _FORMAT,
        "epoch": len(rows),
        "optimiser": optimiser.state_dict(),
        "settings": dict(settings),
        "rows": rows,
    }
    buffer = io.BytesIO()
    torch.save({**own, **content}, buffer)
    write_atomic(path, buffer.getvalue())


def read_resumable(path: Path, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The content of what :func:`write_checkpoint` wrote, with ``rows`` a list.

    Raises:
        InputError: there is none, it is no such file, or was made with other settings.
    """
    if not path.is_file():
        raise InputError(f"{path.parent}: holds no {path.name} to resume from, leave out --resume")
    content = read_checkpoint(path)
    if content.get("format") != _FORMAT:
        raise InputError(f"{path}: is not a checkpoint that a training can be resumed from")
    was = content.get("settings")
    if not isinstance(was, dict) or not isinstance(content.get("rows"), list):
        raise damaged(path)
    if changed := sorted(key for key in settings if was.get(key) != settings[key]):
        raise InputError(
            f"{path}: was made with other {', '.join(changed)}; resume with the same, or name another folder"
        )
    return content


def set_optimiser(optimiser: torch.optim.Optimizer, content: Mapping[str, Any], path: Path) -> None:
    """Set an optimiser's state from a checkpoint's content.

    Raises:
        InputError: the state does not fit.
    """
    try:
        optimiser.load_state_dict(content["optimiser"])
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(path, str(error)) from error


def damaged(path: Path, reason: str = "") -> InputError:
    """What to raise for a checkpoint whose parts do not fit together."""
    told = f" ({reason})" if reason else ""
    return InputError(f"{path}: is damaged{told}, start the training anew in another folder")
