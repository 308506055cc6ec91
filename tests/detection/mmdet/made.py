"""A DetectoRS without its published weights, whose maps are finite all the same."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.detection.mmdet import packages
from cadpose.errors import DependencyError


def absent() -> str:
    """Why the network cannot be built here, empty where it can."""
    if importlib.util.find_spec("torch") is None:
        return "PyTorch is not installed"
    try:
        packages.require()
    except DependencyError as error:
        return str(error)
    return ""


def settle(module: Any, seed: int = 0) -> None:
    """Random weights under which the network answers: as built, its standardised kernels overflow."""
    import torch

    torch.manual_seed(seed)
    for part in module.modules():
        if hasattr(part, "weight_gamma"):
            part.weight_gamma.fill_(float(part.weight[0].numel()) ** -0.5)
        if hasattr(part, "weight_diff"):  # zero as built, as are the offsets: let both matter
            part.weight_diff.data.normal_(std=0.01)
            part.offset_s.weight.data.normal_(std=0.01)
            part.offset_l.weight.data.normal_(std=0.01)


def hurry(module: Any, proposals: int = 60) -> None:
    """Fewer proposals than the config's 1000: they take most of the time on a small picture."""
    module.rpn_head.test_cfg.nms_pre = proposals
    module.rpn_head.test_cfg.max_per_img = proposals


def published_form(module: Any, path: Path) -> None:
    """Save as OpenMMLab's files are: ``meta`` of plain values, and ``state_dict``."""
    import torch

    meta = {
        "mmdet_version": "2.0.0",
        "epoch": 12,
        "config": "model = dict()",
        "CLASSES": ("person", "bicycle"),
    }
    # Files of 2020 are of PyTorch's older format.
    content = {"meta": meta, "state_dict": module.state_dict()}
    torch.save(content, path, _use_new_zipfile_serialization=False)


def photograph(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    """(height, width, 3) of flat patches."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 256, (-(-height // 16), -(-width // 16), 3), dtype=np.uint8)
    return np.ascontiguousarray(coarse.repeat(16, axis=0).repeat(16, axis=1)[:height, :width])
