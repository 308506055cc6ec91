from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cadpose.datasets.labels import Label
from cadpose.evaluation.confidence import ERROR_EDGES, Answers, confidence_figures
from cadpose.evaluation.rotation import RotationResult, rotation_result
from cadpose.records import Rotation, RotationHypothesis


def answer(
    error: float, probability: float, flagged: bool = False, told: float | None = 9.0
) -> RotationResult:
    first = RotationHypothesis(Rotation(error, 0.0), 1.0, probability, told, flagged)
    second = RotationHypothesis(Rotation(0.0, 0.0), 0.5, 0.01, told, True)
    return rotation_result(
        Label(Path("a.png"), "car", azimuth=0.0), first.rotation, hypotheses=[first, second]
    )


FAILED = rotation_result(Label(Path("b.png"), "car", azimuth=0.0), None, "cut short")


def test_figures_by_hand() -> None:
    results = [answer(3.0, 0.9), answer(30.0, 0.8), FAILED, answer(170.0, 0.4, True), answer(40.0, 0.5)]
    figures = confidence_figures(results)
    assert figures["calibrated"] is True
    assert confidence_figures([*results, answer(3.0, 0.9, told=None)])["calibrated"] is False
    # Four answers in groups of one each.
    assert figures["ece"] == pytest.approx((0.1 + 0.2 + 0.4 + 0.5) / 4)
    assert figures["brier"] == pytest.approx((0.01 + 0.04 + 0.16 + 0.25) / 4)
    assert figures["precision_unflagged"] == pytest.approx(2 / 3)
    assert figures["coverage_unflagged"] == pytest.approx(3 / 4)
    histogram = figures["error_histogram"]
    assert histogram["edges"] == list(ERROR_EDGES) and len(histogram["counts"]) == len(ERROR_EDGES) - 1
    counted = {e: n for e, n in zip(ERROR_EDGES, histogram["counts"], strict=False) if n}
    assert counted == {2: 1, 30: 2, 165: 1}
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures


def test_half_a_turn_is_in_the_last_bin() -> None:
    assert confidence_figures([answer(180.0, 0.5)])["error_histogram"]["counts"][-1] == 1


@pytest.mark.parametrize("results", [[], [FAILED]])
def test_no_answer_has_no_figures(results: list[RotationResult]) -> None:
    figures = confidence_figures(results)
    assert {
        figures[key] for key in ("calibrated", "ece", "brier", "precision_unflagged", "coverage_unflagged")
    } == {None}
    assert sum(figures["error_histogram"]["counts"]) == 0


def test_all_flagged_has_no_precision() -> None:
    figures = confidence_figures([answer(3.0, 0.2, True)])
    assert (figures["precision_unflagged"], figures["coverage_unflagged"]) == (None, 0.0)


def test_answers_are_calibrated_where_all_tell_an_expected_error() -> None:
    sure, unsure = answer(3.0, 0.9), answer(3.0, 0.9, told=None)
    assert Answers.of([sure, FAILED]).calibrated
    assert not Answers.of([sure, unsure]).calibrated
    # An outcome of an azimuth that was never labelled has no error.
    unlabelled = rotation_result(Label(Path("a.png"), "car"), Rotation(0, 0), hypotheses=sure.hypotheses)
    assert len(Answers.of([sure, unlabelled])) == 1
    assert np.array_equal(Answers.of([sure]).right, [True])
