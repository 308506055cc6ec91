from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.evaluation.rank_counts import RankCounts, Rates


def test_shares_and_intervals_by_hand() -> None:
    row = RankCounts("car", 10, 8, 3, 2, 1)
    assert [row.top(k) for k in (1, 2, 3)] == [3, 5, 6]
    assert [row.rate(k) for k in (1, 2, 3)] == pytest.approx([3 / 8, 5 / 8, 6 / 8])
    assert (row.end_to_end(1), row.end_to_end(3)) == (0.3, 0.6)
    # Newcombe's method 3 for 3 of 8.
    assert row.interval(1) == pytest.approx((0.1368, 0.6943), abs=5e-4)
    assert row.end_to_end_interval(1) == pytest.approx((0.1078, 0.6032), abs=5e-4)
    assert row.rates == Rates("success rate", 3 / 8, 2 / 8, 1 / 8)
    assert row.rates.top3 == pytest.approx(6 / 8)
    assert row.rates.to_json() == pytest.approx({"top1": 3 / 8, "top2": 5 / 8, "top3": 6 / 8})


def test_without_a_photo_there_is_no_share() -> None:
    for row in (RankCounts("car", 0, 0, 0, 0, 0), RankCounts("car", 3, 0, 0, 0, 0)):
        assert row.rate(1) is None and row.interval(3) is None and row.rates is None
        told = row.to_json()
        assert (told["n"], told["yield"], told["top1"], told["top3_interval"]) == (0, 0.0, None, None)
        json.dumps(told, allow_nan=False)
    assert RankCounts("car", 3, 0, 0, 0, 0).end_to_end(1) == 0.0


def test_accepted_photos() -> None:
    row = RankCounts("car", 10, 8, 5, 1, 1, 4, 3)
    assert row.precision == 0.75
    told = row.to_json()["accepted"]
    assert (told["n"], told["coverage"], told["precision"]) == (4, 0.5, 0.75)
    assert told["precision_interval"] == pytest.approx([0.3006, 0.9544], abs=5e-4)
    none = RankCounts("car", 10, 8, 5, 1, 1, 0, 0)
    assert none.precision is None and none.to_json()["accepted"]["precision_interval"] is None
    assert "accepted" not in RankCounts("car", 10, 8, 5, 1, 1).to_json()


@pytest.mark.parametrize(
    "numbers",
    [
        (3, 4, 1, 0, 0), (9, 4, 3, 1, 1), (9, 4, -1, 1, 1),
        (9, 4, 2, 1, 1, 3), (9, 4, 2, 1, 1, 3, 3), (9, 4, 2, 1, 1, 5, 2),
    ],
)  # fmt: skip
def test_numbers_that_contradict_one_another(numbers: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="car"):
        RankCounts("car", *numbers)


@given(st.lists(st.integers(0, 50), min_size=5, max_size=5))
def test_shares_grow_with_the_places_and_lie_in_their_intervals(numbers: list[int]) -> None:
    first, second, third, missed, lost = numbers
    used = first + second + third + missed
    row = RankCounts("car", used + lost, used, first, second, third)
    for rate, interval in ((row.rate, row.interval), (row.end_to_end, row.end_to_end_interval)):
        values = [value for k in (1, 2, 3) if (value := rate(k)) is not None]
        assert values == sorted(values)
        for k, value in enumerate(values, 1):
            span = interval(k)
            assert span is not None and 0.0 <= span[0] <= value <= span[1] <= 1.0
