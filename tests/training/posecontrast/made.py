"""A set of made-up photos that a tiny network can learn, and checkpoints of real names and shapes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from cadpose.training.posecontrast.network import PoseContrast
from cadpose.training.posecontrast.train import Recipe

#: Everything small; rates high, for it starts from random weights.
TINY = Recipe(epochs=3, batch_size=4, rate=3e-3, blocks=(1, 1, 1, 1), width=4, hidden=(16, 16, 16))


def write_photos(folder: Path, count: int = 8) -> Path:
    """Photos whose colours tell the azimuth, and their label file."""
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for i in range(count):
        azimuth = 360.0 * i / count + 3.0
        turn = np.deg2rad(azimuth)
        image = np.zeros((64, 80, 3), np.uint8)
        image[8:56, 10:70] = 130
        image[8:56, 10:40, 0] = 128 + 120 * np.cos(turn)
        image[8:56, 40:70, 2] = 128 + 120 * np.sin(turn)
        Image.fromarray(image).save(folder / f"{i}.png")
        entries.append(
            {
                "photo": f"{i}.png",
                "category": "car" if i % 2 else "chair",
                "box": [10, 8, 70, 56],
                "azimuth": azimuth,
                "elevation": 10.0 + i,
                "inplane": 2.0,
            }
        )
    path = folder / "labels.jsonl"
    path.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    return path


def moco_content() -> dict[str, object]:
    """As MoCo v2's file: both encoders with their MLP, the queue, the optimiser's settings."""
    rng = torch.Generator().manual_seed(3)
    state: dict[str, Tensor] = {}
    for encoder in ("encoder_q", "encoder_k"):
        for key, value in PoseContrast().net_feat.state_dict().items():
            made = torch.rand(value.shape, generator=rng) if value.is_floating_point() else value
            state[f"module.{encoder}.{key}"] = made
        state[f"module.{encoder}.fc.0.weight"] = torch.zeros(2048, 2048)
        state[f"module.{encoder}.fc.0.bias"] = torch.zeros(2048)
        state[f"module.{encoder}.fc.2.weight"] = torch.zeros(128, 2048)
        state[f"module.{encoder}.fc.2.bias"] = torch.zeros(128)
    state["module.queue"] = torch.zeros(128, 65536)
    state["module.queue_ptr"] = torch.zeros(1, dtype=torch.long)
    return {"epoch": 800, "arch": "resnet50", "state_dict": state, "optimizer": {"state": {}}}


def authors_content(network: PoseContrast) -> dict[str, object]:
    """As the authors' file: the encoder still has its last layer, of 128 outputs."""
    features = network.net_feat.channels
    encoder = dict(network.net_feat.state_dict())
    encoder |= {"fc.weight": torch.zeros(128, features), "fc.bias": torch.zeros(128)}
    return {"epoch": 14, "net_feat": encoder, "net_vp": network.net_vp.state_dict()}
