"""A part of a data set that stands for the whole."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

_T = TypeVar("_T")


def evenly_spread(everything: Sequence[_T], limit: int | None) -> list[_T]:
    """At most so many, from the first to the last at even steps; all where there is no limit."""
    if limit is None or len(everything) <= limit:
        return list(everything)
    return [everything[int(i)] for i in np.linspace(0, len(everything) - 1, limit).round()]
