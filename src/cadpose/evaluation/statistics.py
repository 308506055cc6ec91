"""The few statistics that the tables need."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def wilson_interval(successes: int, n: int, z: float = 1.959964) -> tuple[float, float]:
    """Wilson score interval of a proportion (95 % by default), as fractions of 1.

    Raises:
        ValueError: ``successes`` is not in [0, n].
    """
    if not 0 <= successes <= n:
        raise ValueError(f"{successes} successes of {n}")
    if n == 0:
        return 0.0, 1.0
    p = successes / n
    centre = p + z * z / (2 * n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    scale = 1 + z * z / n
    # Rounding must not leave the proportion itself outside.
    return max(0.0, min(p, (centre - half) / scale)), min(1.0, max(p, (centre + half) / scale))


def macro_mean(rows: Sequence[dict[str, float]], keys: Sequence[str]) -> dict[str, float]:
    """Mean over classes of each key, every class counting the same."""
    return {key: float(np.mean([row[key] for row in rows])) for key in keys}
