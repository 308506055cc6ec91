"""The triplet loss, photo by photo."""

from __future__ import annotations

from torch import Tensor
from torch.nn import functional


def distances(photo: Tensor, renders: Tensor) -> Tensor:
    """(1, D) and (N, D) features to (N,) Euclidean distances.

    A millionth is added to each difference, as torch's own triplet loss does, for the root has no slope at 0.
    """
    return functional.pairwise_distance(photo, renders)


def triplet_losses(apart: Tensor, margin: float) -> Tensor:
    """Every negative must be farther than the positive by the margin: max(0, d⁺ - d⁻ + margin).

    Args:
        apart: (1 + N,) distances of a photo to its positive and to N negatives.
        margin: See above.

    Returns:
        (N,) losses, one a negative.

    Raises:
        ValueError: there is no negative.
    """
    if apart.ndim != 1 or len(apart) < 2:
        raise ValueError(f"expected the distances of a positive and of negatives, found {tuple(apart.shape)}")
    return functional.relu(apart[0] - apart[1:] + margin)
