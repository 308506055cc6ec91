"""A moving average of a network's weights that forgets where it began."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel


def moving_average(model: nn.Module, decay: float) -> AveragedModel:
    """Follows ``model``; call ``update_parameters(model)`` after every step.

    The decay grows with the steps, (1 + n) / (10 + n), until it reaches ``decay``: with a constant one the
    weights that training began with would still count after hundreds of steps.
    """
    return AveragedModel(model, multi_avg_fn=_growing(decay), use_buffers=True)


def _growing(decay: float) -> Callable[[Sequence[Tensor], Sequence[Tensor], Tensor | int], None]:
    @torch.no_grad()
    def update(averages: Sequence[Tensor], current: Sequence[Tensor], seen: Tensor | int) -> None:
        n = float(seen)
        share = 1.0 - min(decay, (1.0 + n) / (10.0 + n))
        for average, value in zip(averages, current, strict=True):
            if average.is_floating_point():
                average.lerp_(value, share)
            else:
                average.copy_(value)

    return update
