from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from cadpose.library import sampling
from cadpose.library.sampling import farthest_points


def plainly(rows: NDArray[np.float32], count: int, least: float) -> list[int]:
    """`farthest_points` by its definition, on a full table of distances."""
    table = np.linalg.norm(rows[:, None].astype(np.float64) - rows[None], axis=2)
    mean = table.mean(axis=1)
    chosen = [int(np.argmax(mean <= mean.min() + 1e-6))]
    while len(chosen) < min(count, len(rows)):
        nearest = table[chosen].min(axis=0)
        if nearest.max() <= least:
            break
        chosen.append(int(nearest.argmax()))
    return chosen


@settings(max_examples=100, deadline=None)
@given(
    arrays(np.float32, st.tuples(st.integers(1, 12), st.just(3)), elements=st.integers(0, 3).map(float)),
    st.integers(1, 12),
    st.sampled_from([0.0, 1.0]),
)
def test_farthest_points_follow_their_definition(rows: NDArray[np.float32], count: int, least: float) -> None:
    assert farthest_points(rows, count, least) == plainly(rows, count, least)


def test_blocks_give_the_distances_of_a_full_table() -> None:
    rows = np.random.default_rng(0).random((2 * sampling._BLOCK + 17, 5))
    table = np.linalg.norm(rows[:, None] - rows[None], axis=2)
    assert np.allclose(sampling._mean_distances(rows), table.mean(axis=1), atol=1e-7)


def test_equal_rows_are_chosen_once_and_the_first_of_them() -> None:
    rows = np.repeat(np.random.default_rng(1).random((1, 1003)), 6, axis=0).astype(np.float32)
    assert farthest_points(rows, 4) == [0]


def test_nothing_to_choose_from() -> None:
    assert farthest_points(np.zeros((0, 3), np.float32), 4) == []
