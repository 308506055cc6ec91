"""The newest examples of a training, kept in memory and drawn at random."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

import torch
from torch import Tensor


class Examples(Protocol):
    """A dataclass of tensors whose first axis counts examples."""

    def fields(self) -> tuple[Tensor, ...]:
        """All tensors, in the order in which the class takes them."""
        ...


T = TypeVar("T", bound=Examples)


class Ring(Generic[T]):
    """Keeps the newest examples.

    Args:
        capacity: How many.
        device: Where.
    """

    def __init__(self, capacity: int, device: torch.device) -> None:
        self.capacity, self.device, self.entered = capacity, device, 0
        self._kept: T | None = None

    def add(self, chunk: T) -> None:
        """Put a chunk in the place of the oldest examples."""
        new = chunk.fields()
        if self._kept is None:
            self._kept = type(chunk)(*(self._room(t) for t in new))
        at = (torch.arange(self.entered, self.entered + len(new[0])) % self.capacity).to(self.device)
        for kept, values in zip(self._kept.fields(), new, strict=True):
            kept[at] = values.to(self.device, non_blocking=True)
        self.entered += len(new[0])

    def draw(self, count: int, generator: torch.Generator) -> T:
        """``count`` examples at random, one perhaps several times.

        Raises:
            ValueError: there is none yet.
        """
        if self._kept is None:
            raise ValueError("nothing was added yet")
        filled = min(self.entered, self.capacity)
        at = torch.randint(filled, (count,), generator=generator, device=self.device)
        return type(self._kept)(*(t[at] for t in self._kept.fields()))

    def _room(self, like: Tensor) -> Tensor:
        return torch.empty((self.capacity, *like.shape[1:]), dtype=like.dtype, device=self.device)
