"""PoseContrast's losses for shapes with symmetries: azimuths that look the same are equally right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from cadpose.rotation.bins import BIN_DEGREES
from cadpose.training.losses import OFFSET_SCALE, pose_aware_nce

#: Turns about the upright axis that are told apart; shapes with more count as bodies of revolution.
MOST_TURNS = 8


@dataclass(frozen=True)
class Targets:
    """What is true of N crops.

    Attributes:
        angles: (N, 3) azimuth, elevation, in-plane rotation in degrees.
        turns: (N,) number of azimuths that look the same, 0 for a body of revolution.
    """

    angles: Tensor
    turns: Tensor

    def azimuths(self) -> tuple[Tensor, Tensor]:
        """(N, 8) azimuths that look the same and their weights: 1/n for n of them, 0 where any is right."""
        count = self.turns.clamp(min=1)[:, None]
        k = torch.arange(MOST_TURNS, device=self.angles.device)[None]
        azimuth = self.angles[:, :1] + 360.0 * k / count
        weight = (k < count).to(azimuth.dtype) / count
        return azimuth, torch.where(self.turns[:, None] > 0, weight, torch.zeros_like(weight))


def pose_loss(logits: Sequence[Tensor], offsets: Sequence[Tensor], targets: Targets) -> Tensor:
    """Mean over crops of the three cross-entropies and the smooth L1 of 5 · offset in the true bins."""
    azimuth, weight = targets.azimuths()
    total = _angle(logits[0], offsets[0], torch.remainder(-azimuth, 360.0), weight)
    one = torch.ones_like(weight[:, :1])
    total = total + _angle(logits[1], offsets[1], targets.angles[:, 1:2] + 90.0, one)
    return total + _angle(logits[2], offsets[2], torch.remainder(targets.angles[:, 2:] + 180.0, 360.0), one)


def _angle(logits: Tensor, offsets: Tensor, labels: Tensor, weight: Tensor) -> Tensor:
    """One angle's part; ``labels`` (N, K) in degrees, ``weight`` (N, K)."""
    place = labels / BIN_DEGREES
    bins = place.long().clamp(0, logits.shape[1] - 1)
    truth = place - bins
    classes = -(functional.log_softmax(logits.float(), dim=1).gather(1, bins) * weight).sum(dim=1)
    told = offsets.float().gather(1, bins)
    error = functional.smooth_l1_loss(OFFSET_SCALE * told, OFFSET_SCALE * truth, reduction="none")
    return (classes + (error * weight).sum(dim=1) / 3.0).mean()


def contrast(q: Tensor, k: Tensor, targets: Targets) -> Tensor:
    """Pose-aware contrast (weighting linear) with distances modulo the symmetry of the first of each pair."""
    azimuth, weight = targets.azimuths()
    full = torch.where((weight.sum(dim=1) > 0)[:, None], azimuth, _circle(azimuth))
    around = torch.cat([full[..., None], targets.angles[:, None, 1:].expand(-1, MOST_TURNS, -1)], dim=2)
    R_same = rotations(around)
    R = rotations(targets.angles)
    cosine = (torch.einsum("iekl,jkl->ije", R_same, R) - 1.0) / 2.0
    shares = torch.acos(cosine.amax(dim=2).clamp(-1.0, 1.0)) / math.pi
    shares = shares * (1.0 - torch.eye(len(q), dtype=shares.dtype, device=shares.device))
    return pose_aware_nce(q.float(), k.float(), shares=shares)


def _circle(azimuth: Tensor) -> Tensor:
    turn = torch.arange(MOST_TURNS, device=azimuth.device, dtype=azimuth.dtype) * (360.0 / MOST_TURNS)
    return azimuth[:, :1] + turn[None]


def rotations(angles: Tensor) -> Tensor:
    """(..., 3) degrees to (..., 3, 3) ``R_cv_from_s``; geometry.angles.rotation_from_angles in torch."""
    az, el, ip = (torch.deg2rad(angles[..., i]) for i in range(3))
    el = el - math.pi / 2
    zero, one = torch.zeros_like(az), torch.ones_like(az)

    def matrix(rows: list[list[Tensor]]) -> Tensor:
        return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)

    def about_z(a: Tensor) -> Tensor:
        return matrix([[a.cos(), -a.sin(), zero], [a.sin(), a.cos(), zero], [zero, zero, one]])

    about_x = matrix([[one, zero, zero], [zero, el.cos(), -el.sin()], [zero, el.sin(), el.cos()]])
    p_from_s = torch.tensor([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]], dtype=az.dtype, device=az.device)
    cv_from_gl = torch.diag(torch.tensor([1.0, -1.0, -1.0], dtype=az.dtype, device=az.device))
    return cv_from_gl @ about_z(ip) @ about_x @ about_z(-az) @ p_from_s
