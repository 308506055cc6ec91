"""Losses of PoseContrast (3DV 2021): bins with offsets, and contrast that knows how far poses are apart.

Read in the authors' published code (repository YoungXIAO13/PoseContrast, src/model/model_utils.py and
src/train.py) and written anew: the four weightings, the terms of the contrastive loss, the factor 5 within
the offset loss, the sum of the classification losses. The authors' fifth weighting, "sinsin", and
their contrast that does not know poses are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import torch
from torch import Tensor
from torch.nn import functional

from cadpose.rotation.bins import BIN_DEGREES

#: Temperature of the contrastive loss.
TEMPERATURE = 0.5
#: What predicted and true offsets are multiplied by within the smooth L1 loss.
OFFSET_SCALE = 5.0
#: Angle between two poses as a share of 180° to the weight of the negative.
WEIGHTINGS: dict[str, Callable[[Tensor], Tensor]] = {
    "linear": lambda share: share,
    "square": lambda share: share**2,
    "sqrt": torch.sqrt,
    # Poses 90° apart repel most, opposite ones not at all.
    "sin": lambda share: torch.sin(share * math.pi).abs(),
}


def geodesic_shares(R: Tensor) -> Tensor:
    """(N, 3, 3) rotations to (N, N) angles between each two, as a share of 180°; 0 on the diagonal."""
    turns = torch.einsum("iab,jac->ijbc", R, R)
    cosine = (turns.diagonal(dim1=-2, dim2=-1).sum(-1) - 1.0) / 2.0
    # From the antisymmetric part too: acos alone is inexact near 0 and 180.
    x = turns[..., 2, 1] - turns[..., 1, 2]
    y = turns[..., 0, 2] - turns[..., 2, 0]
    z = turns[..., 1, 0] - turns[..., 0, 1]
    shares = torch.atan2((x**2 + y**2 + z**2).sqrt() / 2.0, cosine) / math.pi
    return shares * (1.0 - torch.eye(len(R), dtype=shares.dtype, device=shares.device))


def pose_aware_nce(
    q: Tensor,
    k: Tensor,
    R: Tensor | None = None,
    weighting: str = "linear",
    temperature: float = TEMPERATURE,
    *,
    shares: Tensor | None = None,
) -> Tensor:
    """Contrast in which another photo repels by how far its pose is away.

    With q and k normalised, the mean over i of

        -log( e^{q_i·k_i/τ} / ( e^{q_i·k_i/τ} + sum_j d_ij e^{q_i·q_j/τ} ) )

    where d_ij is the angle between R_i and R_j as a share s of 180°, weighted: ``"linear"`` s,
    ``"square"`` s², ``"sqrt"`` √s, ``"sin"`` |sin(π s)|.

    Args:
        q: (N, D) features; any length, normalised here.
        k: (N, D) features of a second crop of the same photos.
        R: (N, 3, 3) rotations; no gradient flows through them.
        shares: (N, N) angles between the poses as a share of 180° in place of ``R``, where they are not
            plain angles between rotations.
        weighting: A key of :data:`WEIGHTINGS`.
        temperature: τ.

    Raises:
        ValueError: no such weighting, or the shapes do not fit.
    """
    if weighting not in WEIGHTINGS:
        raise ValueError(f"unknown weighting {weighting!r}, choose one of: {', '.join(WEIGHTINGS)}")
    if (R is None) == (shares is None):
        raise ValueError("give either rotations or the angles between them")
    if R is not None and R.shape != (len(q), 3, 3):
        raise ValueError(f"expected ({len(q)}, 3, 3) rotations, found {tuple(R.shape)}")
    same, others = _similarities(q, k, temperature)
    with torch.no_grad():
        # The logarithm of a weight of 0 is -inf, which leaves the term out and passes no gradient.
        apart = shares if R is None else geodesic_shares(R.to(q.dtype))
        assert apart is not None
        weights = WEIGHTINGS[weighting](apart).log()
    return (torch.logsumexp(torch.cat([same[:, None], others + weights], dim=1), dim=1) - same).mean()


def _similarities(q: Tensor, k: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
    """(N,) q_i·k_i / τ and (N, N) q_i·q_j / τ of normalised features."""
    if q.ndim != 2 or q.shape != k.shape:
        raise ValueError(f"expected two (N, D) features, found {tuple(q.shape)} and {tuple(k.shape)}")
    q, k = functional.normalize(q, dim=1), functional.normalize(k, dim=1)
    return (q * k).sum(dim=1) / temperature, q @ q.T / temperature


def angle_loss(logits: Sequence[Tensor], offsets: Sequence[Tensor], labels: Tensor) -> Tensor:
    """Cross-entropies of the three bins, and smooth L1 of 5 · offset in the true bin.

    Args:
        logits: Three tensors (N, 24), (N, 12), (N, 24).
        offsets: Three tensors of the same shapes.
        labels: (N, 3) int64 whole-degree labels, see :func:`cadpose.rotation.bins.labels_from_angles`.

    Returns:
        The sum of the three mean cross-entropies and of the mean smooth L1 over all angles.
    """
    bins = labels // BIN_DEGREES
    truth = (labels % BIN_DEGREES).to(offsets[0].dtype) / BIN_DEGREES
    classes = [functional.cross_entropy(logit, bins[:, i]) for i, logit in enumerate(logits)]
    told = torch.cat([o.gather(1, bins[:, i : i + 1]) for i, o in enumerate(offsets)], dim=1)
    return sum(classes, functional.smooth_l1_loss(OFFSET_SCALE * told, OFFSET_SCALE * truth))
