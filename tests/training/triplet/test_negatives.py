from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cadpose.training.triplet.negatives import draw_negatives, nearest


def test_the_nearest_come_back() -> None:
    models = [40, 30, 20, 10, 50]
    assert nearest(models, [0.9, 0.2, 0.5, 0.2, 0.1], 3) == [50, 30, 10]
    assert nearest(models, [0.9, 0.2, 0.5, 0.2, 0.1], 9) == [50, 30, 10, 20, 40]
    assert nearest(models, np.zeros(5), 0) == []


@given(st.integers(0, 2**32), st.integers(1, 30), st.integers(0, 12), st.integers(1, 12))
def test_kept_ones_first_then_fresh_ones(seed: int, size: int, kept: int, count: int) -> None:
    others = np.arange(100, 100 + size)
    rng = np.random.default_rng(seed)
    again = rng.permutation(others)[: min(kept, size)].tolist()
    drawn = draw_negatives(others, again, count, np.random.default_rng(seed))
    assert drawn[: len(again)] == again[:count]
    assert len(drawn) == len(set(drawn)) == min(count, size) and set(drawn) <= set(others.tolist())
    assert drawn == draw_negatives(others, again, count, np.random.default_rng(seed))


def test_fresh_ones_come_from_everywhere() -> None:
    rng = np.random.default_rng(0)
    counts = np.zeros(20)
    for _ in range(2000):
        counts[draw_negatives(np.arange(20), [3], 5, rng)] += 1
    assert counts[3] == 2000
    assert (np.abs(np.delete(counts, 3) - 2000 * 4 / 19) < 100).all()
