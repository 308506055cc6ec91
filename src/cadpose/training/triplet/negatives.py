"""Which renders a photo must be told apart from: random ones, and those that were nearest last time.

The paper draws ten from all categories, and with "negative mining" uses "the CAD images of the bottom-7
negative images" again. Taken here as: of a photo's ten negatives, the seven with the smallest distance come
back in the next epoch, beside three fresh ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def draw_negatives(
    others: NDArray[np.int64], kept: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """``kept`` and fresh ones, ``count`` different models in all.

    Args:
        others: (M,) numbers of the models that may be drawn; fewer than ``count`` are all taken.
        kept: Some of them that come first.
        count: How many are wanted.
        rng: All randomness comes from here.
    """
    first = list(kept)[:count]
    fresh = rng.permutation(np.setdiff1d(others, first))[: count - len(first)]
    return [*first, *fresh.tolist()]


def nearest(models: Sequence[int], distances: ArrayLike, count: int) -> list[int]:
    """The ``count`` models with the smallest distances, nearest first; of equal ones the earlier."""
    order = np.argsort(np.asarray(distances, np.float64), kind="stable")[:count]
    return [models[i] for i in order]
