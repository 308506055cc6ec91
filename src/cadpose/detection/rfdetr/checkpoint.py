"""Roboflow's published files of RF-DETR-Seg: tensors read without running what is in them."""

from __future__ import annotations

import argparse
import pickle
import types
from pathlib import Path
from typing import TYPE_CHECKING

from cadpose.detection.rfdetr.sizes import GROUPS
from cadpose.errors import DependencyError

if TYPE_CHECKING:
    from torch import Tensor

#: Largest file that is read; the largest published one has about 155 MB.
MAX_BYTES = 600 * 2**20
#: Buffers that later versions of the package save and that no file needs.
_IGNORED = frozenset(["_kp_active_mask"])
_QUERIES = ("refpoint_embed.weight", "query_feat.weight")


def read_checkpoint(path: Path, queries: int) -> dict[str, Tensor]:
    """The tensors by their published names, with ``queries`` queries a group.

    Beside tensors the files hold the training's settings as ``argparse.Namespace``, which is let through:
    it is made without running anything of the file's. More queries than wanted are cut, the first of each
    group kept, as the package does.

    Args:
        path: The file.
        queries: Queries a group that the network has.

    Raises:
        DependencyError: the file is too large, cannot be read as tensors, or holds no weights.
    """
    import torch

    again = "fetch the published file again"
    if path.stat().st_size > MAX_BYTES:
        raise DependencyError(f"{path} is larger than {MAX_BYTES // 2**20} MB: {again}")
    try:
        with torch.serialization.safe_globals([argparse.Namespace, types.SimpleNamespace]):
            content = torch.load(path, map_location="cpu", weights_only=True)
    except (RuntimeError, pickle.UnpicklingError, EOFError, KeyError, ValueError, TypeError):
        raise DependencyError(
            f"{path} cannot be read safely as weights (it is damaged, or holds more than tensors): {again}"
        ) from None
    table = content.get("model", content) if isinstance(content, dict) else None
    if not isinstance(table, dict) or not table:
        raise DependencyError(f"{path} holds no weights: {again}")
    tensors: dict[str, Tensor] = {}
    for key, value in table.items():
        if not isinstance(key, str) or not isinstance(value, torch.Tensor):
            raise DependencyError(f"{path} holds something else than tensors by name: {again}")
        if key not in _IGNORED:
            tensors[key] = _cut(value, queries) if key in _QUERIES else value
    return tensors


def _cut(table: Tensor, queries: int) -> Tensor:
    """(groups * queries, d) of a table with at least as many queries a group; others are left as they are."""
    if table.ndim != 2 or table.shape[0] % GROUPS or table.shape[0] <= GROUPS * queries:
        return table
    return table.reshape(GROUPS, -1, table.shape[1])[:, :queries].reshape(GROUPS * queries, -1).contiguous()
