from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cadpose.evaluation.calibration import (
    Binning,
    brier_score,
    expected_calibration_error,
    reliability_bins,
    risk_coverage,
    unflagged_precision,
)

KINDS: tuple[Binning, ...] = ("equal-width", "equal-mass")
Answers = tuple[NDArray[np.float64], NDArray[np.bool_]]
answers = st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=60).map(
    lambda pairs: (np.array([p for p, _ in pairs]), np.array([hit for _, hit in pairs]))
)


def test_bins_by_hand() -> None:
    p = [0.05, 0.15, 0.5, 0.55, 0.9, 1.0]
    hit = [False, True, True, False, True, True]
    wide = reliability_bins(p, hit, 2, "equal-width")
    # 0.5 opens the second half; 1.0 belongs to it.
    assert wide.count.tolist() == [2, 4]
    assert wide.confidence == pytest.approx([0.1, 0.7375])
    assert wide.accuracy == pytest.approx([0.5, 0.75])
    assert wide.calibration_error == pytest.approx((2 * 0.4 + 4 * 0.0125) / 6)
    mass = reliability_bins(p, hit, 3, "equal-mass")
    assert mass.count.tolist() == [2, 2, 2]
    assert mass.confidence == pytest.approx([0.1, 0.525, 0.95])
    assert mass.accuracy == pytest.approx([0.5, 0.5, 1.0])
    assert expected_calibration_error(p, hit, 3) == pytest.approx((0.4 + 0.025 + 0.05) / 3)
    # Nothing lies between 0.2 and 0.4, so that bin is left out.
    assert reliability_bins(p, hit, 5, "equal-width").count.tolist() == [2, 2, 2]


def test_equal_probabilities_share_a_bin() -> None:
    p = np.array([0.1, 0.4, 0.4, 0.4, 0.4, 0.9])
    bins = reliability_bins(p, p > 0.3, 3, "equal-mass")
    assert bins.count.tolist() == [1, 4, 1]
    assert reliability_bins(np.full(7, 0.3), np.ones(7), 5).count.tolist() == [7]


def test_brier_by_hand() -> None:
    assert brier_score([0.8, 0.3], [True, False]) == pytest.approx((0.04 + 0.09) / 2)
    assert brier_score([1.0, 0.0], [True, False]) == 0.0
    assert brier_score([1.0, 0.0], [False, True]) == 1.0


def test_risk_by_hand() -> None:
    p, hit = [0.2, 0.9, 0.6, 0.7], [False, True, True, False]
    curve = risk_coverage(p, hit)
    assert curve.coverage.tolist() == [0.25, 0.5, 0.75, 1.0]
    assert curve.risk == pytest.approx([0.0, 1 / 2, 1 / 3, 2 / 4])
    assert curve.area == pytest.approx((0 + 1 / 2 + 1 / 3 + 1 / 2) / 4)
    # Two of four alike are right: whichever half is kept, half of it is right on the average.
    assert risk_coverage([0.5] * 4, [True, True, False, False]).risk[1] == 0.5


def test_the_unflagged_by_hand() -> None:
    assert unflagged_precision([True, False, True, False], [False, False, False, True]) == (2 / 3, 0.75)
    assert unflagged_precision([True, False], [True, True]) == (None, 0.0)


@pytest.mark.parametrize(
    ("p", "hit"),
    [([], []), ([0.5], [True, False]), ([1.1], [True]), ([-0.1], [True]), ([float("nan")], [True])],
)
def test_what_makes_no_sense_is_refused(p: list[float], hit: list[bool]) -> None:
    for function in (reliability_bins, brier_score, risk_coverage):
        with pytest.raises(ValueError, match="probabilit"):
            function(p, hit)
    with pytest.raises(ValueError, match="bins"):
        reliability_bins([0.5], [True], 0)
    with pytest.raises(ValueError, match="hits"):
        unflagged_precision([], [])


@given(answers, st.integers(1, 20), st.sampled_from(KINDS))
def test_bins_hold_every_answer_once(some: Answers, bins: int, kind: Binning) -> None:
    p, hit = some
    found = reliability_bins(p, hit, bins, kind)
    assert found.count.sum() == len(p) and 1 <= len(found.count) <= bins and found.count.min() > 0
    assert (found.count * found.confidence).sum() == pytest.approx(p.sum())
    assert (found.count * found.accuracy).sum() == pytest.approx(hit.sum())
    assert (np.diff(found.confidence) >= -1e-12).all()
    error = found.calibration_error
    assert abs(p.mean() - hit.mean()) - 1e-9 <= error <= 1.0 + 1e-9
    # In one bin the two are the same.
    assert expected_calibration_error(p, hit, 1, kind) == pytest.approx(abs(p.mean() - hit.mean()))


@given(answers)
def test_order_and_the_best_guess(some: Answers) -> None:
    p, hit = some
    order = np.random.default_rng(len(p)).permutation(len(p))
    assert brier_score(p[order], hit[order]) == pytest.approx(brier_score(p, hit))
    assert risk_coverage(p[order], hit[order]).risk == pytest.approx(risk_coverage(p, hit).risk)
    # No constant beats the base rate, and the truth itself is perfect.
    base = hit.mean()
    assert brier_score(np.full(len(p), base), hit) <= brier_score(np.full(len(p), p[0]), hit) + 1e-12
    assert brier_score(hit.astype(float), hit) == expected_calibration_error(hit.astype(float), hit) == 0.0


@given(answers)
def test_risk_ends_at_the_error_rate_and_a_perfect_order_is_best(some: Answers) -> None:
    p, hit = some
    curve = risk_coverage(p, hit)
    assert curve.coverage[-1] == 1.0 and ((curve.risk >= 0) & (curve.risk <= 1)).all()
    assert curve.risk[-1] == pytest.approx(1.0 - hit.mean())
    perfect = risk_coverage(hit.astype(float), hit)
    assert (np.diff(perfect.risk) >= -1e-12).all()
    assert perfect.area <= curve.area + 1e-12


def test_a_calibrated_forecast_has_a_small_error_and_an_overconfident_one_a_large() -> None:
    p = np.random.default_rng(0).uniform(0.0, 1.0, 20_000)
    hit = np.random.default_rng(1).uniform(size=len(p)) < p
    for kind in KINDS:
        assert expected_calibration_error(p, hit, 10, kind) < 0.015
        assert expected_calibration_error(np.sqrt(p), hit, 10, kind) == pytest.approx(1 / 6, abs=0.02)
    assert brier_score(p, hit) == pytest.approx(1 / 6, abs=0.01)
