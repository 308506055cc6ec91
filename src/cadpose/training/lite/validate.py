"""How well the network does on synthetic photos of models that it has never seen."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from cadpose.rotation.bins import BIN_DEGREES
from cadpose.training.lite.objective import Targets, rotations


def decoded(logits: Sequence[Tensor], offsets: Sequence[Tensor]) -> Tensor:
    """(N, 3) azimuth, elevation, in-plane rotation of the most likely bins."""
    labels = []
    for logit, offset in zip(logits, offsets, strict=True):
        best = logit.argmax(dim=1, keepdim=True)
        labels.append((best + offset.gather(1, best).float()) * BIN_DEGREES)
    az, el, ip = (label[:, 0] for label in labels)
    return torch.stack([torch.remainder(-az, 360.0), el - 90.0, ip - 180.0], dim=1)


def modulo(angles: Tensor, targets: Targets) -> Tensor:
    """(N,) degrees from the nearest rotation that looks the same."""
    azimuth, weight = targets.azimuths()
    around = torch.where((weight > 0) | (weight.sum(dim=1, keepdim=True) == 0), azimuth, azimuth[:, :1])
    free = weight.sum(dim=1) == 0
    around = torch.where(free[:, None], angles[:, :1].expand_as(around), around)
    truth = torch.cat([around[..., None], targets.angles[:, None, 1:].expand(-1, around.shape[1], -1)], dim=2)
    cosine = (torch.einsum("iekl,ikl->ie", rotations(truth), rotations(angles)) - 1.0) / 2.0
    return torch.rad2deg(torch.acos(cosine.amax(dim=1).clamp(-1.0, 1.0)))


def summary(found: Tensor, category: Tensor, names: Sequence[str]) -> dict[str, float]:
    """Acc@30 and Acc@10 in all, as the mean of the categories, and Acc@30 of each category."""
    rows = {name: found[category == i] for i, name in enumerate(names)}
    by_name = {name: float((e <= 30).float().mean()) for name, e in rows.items() if len(e)}
    return {
        "acc30": float((found <= 30).float().mean()),
        "acc10": float((found <= 10).float().mean()),
        "mederr": float(found.median()),
        "macro30": sum(by_name.values()) / max(len(by_name), 1),
        **{f"acc30/{name}": value for name, value in by_name.items()},
    }
