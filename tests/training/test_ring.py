from __future__ import annotations

from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from cadpose.training.ring import Ring


@dataclass(frozen=True)
class Numbers:
    """Numbers and their squares."""

    number: Tensor
    square: Tensor

    def fields(self) -> tuple[Tensor, ...]:
        return self.number, self.square


def numbers(low: int, high: int) -> Numbers:
    values = torch.arange(low, high)
    return Numbers(values, (values**2).float())


def test_the_newest_are_kept_and_drawn_together() -> None:
    ring: Ring[Numbers] = Ring(5, torch.device("cpu"))
    generator = torch.Generator().manual_seed(0)
    with pytest.raises(ValueError, match="nothing"):
        ring.draw(1, generator)
    ring.add(numbers(0, 3))
    assert set(ring.draw(200, generator).number.tolist()) == {0, 1, 2}
    ring.add(numbers(3, 7))
    drawn = ring.draw(500, generator)
    assert set(drawn.number.tolist()) == {2, 3, 4, 5, 6}
    assert torch.equal(drawn.square, (drawn.number**2).float())
    assert ring.entered == 7
