from __future__ import annotations

import json
from pathlib import Path

import pytest

from cadpose.datasets.labels import Label
from cadpose.errors import CadposeError, InputError
from cadpose.evaluation.rotation import (
    RotationResult,
    evaluate_rotation,
    rotation_result,
    rotation_table,
)
from cadpose.geometry.boxes import Box
from cadpose.records import Rotation, RotationHypothesis


def label(
    azimuth: float | None, elevation: float | None = None, inplane: float | None = None, category: str = "car"
) -> Label:
    return Label(Path("a.png"), category, Box(0, 0, 1, 1), None, azimuth, elevation, inplane)


def test_a_whole_label_is_scored_by_the_geodesic_angle() -> None:
    true, estimate = Rotation(10.0, 20.0, 5.0), Rotation(30.0, 10.0, -5.0)
    result = rotation_result(label(10.0, 20.0, 5.0), estimate)
    assert result.error == pytest.approx(true.error_to(estimate))
    assert result.azimuth_error == pytest.approx(20.0)
    assert result.error != pytest.approx(result.azimuth_error, abs=0.1)
    # In-plane rotation alone counts.
    assert rotation_result(label(10.0, 0.0, 0.0), Rotation(10.0, 0.0, 12.0)).error == pytest.approx(12.0)
    # Where only the elevation is labelled beside the azimuth, the photo counts as upright.
    assert rotation_result(label(10.0, 0.0), Rotation(10.0, 0.0, 12.0)).error == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("azimuth", "estimate", "error"), [(350.0, 10.0, 20.0), (0.0, 180.0, 180.0), (95.0, 90.0, 5.0)]
)
def test_a_label_of_azimuth_alone_is_scored_by_it(azimuth: float, estimate: float, error: float) -> None:
    # Elevation and in-plane rotation of the estimate are far away and must not matter.
    for known in (label(azimuth), label(azimuth, inplane=3.0)):
        result = rotation_result(known, Rotation(estimate, 60.0, 40.0))
        assert result.error == pytest.approx(error)
        assert result.azimuth_error == pytest.approx(error)
        assert not result.reason


def test_failures_have_a_reason_and_no_error() -> None:
    failed = rotation_result(label(10.0), None, "a.png: is empty")
    unknown = rotation_result(label(None, 10.0), Rotation(0.0, 0.0))
    assert failed.reason == "a.png: is empty"
    assert unknown.reason == "the label has no azimuth"
    for result in (failed, unknown):
        assert result.error != result.error
        assert result.azimuth_error != result.azimuth_error


def test_recoverable_errors_fail_their_photo_only() -> None:
    labels = [label(0.0), label(90.0), label(180.0)]
    done: list[RotationResult] = []

    def estimate(one: Label) -> list[RotationHypothesis]:
        if one.azimuth == 90.0:
            raise InputError("a.png: cut short")
        assert one.azimuth is not None
        turns = (4.0, 40.0)
        return [RotationHypothesis(Rotation(one.azimuth + turn, 0.0), 1.0, 0.5) for turn in turns]

    results = evaluate_rotation(labels, estimate, CadposeError, done.append)
    assert done == results
    assert [r.label for r in results] == labels
    assert [r.reason for r in results] == ["", "a.png: cut short", ""]
    assert results[1].estimate is None
    assert [len(r.hypotheses) for r in results] == [2, 0, 2]
    assert results[2].hypothesis_errors == pytest.approx((4.0, 40.0))
    table = rotation_table(results)
    assert (table["n"], table["acc30"]) == (2, 1.0)
    assert table["yield"] == pytest.approx(2 / 3)


def test_other_errors_are_not_hidden() -> None:
    def broken(_: Label) -> list[RotationHypothesis]:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        evaluate_rotation([label(0.0)], broken, CadposeError)


def results_with(errors: list[float], category: str = "car") -> list[RotationResult]:
    return [rotation_result(label(0.0, category=category), Rotation(e, 0.0)) for e in errors]


def test_the_table_by_hand() -> None:
    cars = results_with([0.0, 10.0, 10.5, 30.0, 30.5, 149.0, 151.0, 180.0])
    chairs = [*results_with([5.0, 20.0], "chair"), rotation_result(label(0.0, category="chair"), None, "no")]
    table = rotation_table(cars + chairs)
    car, chair = table["classes"]["car"], table["classes"]["chair"]
    assert list(table["classes"]) == ["car", "chair"]
    assert (car["n"], car["yield"], car["acc30"], car["acc10"], car["flips"]) == (8, 1.0, 0.5, 0.25, 0.25)
    assert car["mederr"] == pytest.approx(30.25)
    assert (chair["n"], chair["acc30"], chair["acc10"], chair["flips"]) == (2, 1.0, 0.5, 0.0)
    assert chair["yield"] == pytest.approx(2 / 3)
    assert (table["n"], table["acc30"], table["acc10"], table["flips"]) == (10, 0.6, 0.3, 0.2)
    assert table["yield"] == pytest.approx(10 / 11)
    assert table["mederr"] == pytest.approx(25.0)
    assert table["macro"] == pytest.approx(
        {"acc30": 0.75, "acc30_top5": 0.75, "acc10": 0.375, "mederr": (30.25 + 12.5) / 2, "flips": 0.125}
    )
    # 6 of 10.
    assert table["acc30_interval"] == pytest.approx([0.3127, 0.8318], abs=5e-4)


def test_the_oracle_takes_the_best_of_the_first_five() -> None:
    def answer(*errors: float) -> RotationResult:
        found = [RotationHypothesis(Rotation(e, 0.0), 1.0, 0.1) for e in errors]
        return rotation_result(label(0.0), found[0].rotation, hypotheses=found)

    results = [
        answer(5.0, 90.0),  # right at once
        answer(180.0, 90.0, 60.0, 45.0, 30.0),  # right at the fifth
        answer(180.0, 90.0, 60.0, 45.0, 40.0, 3.0),  # right at the sixth: too late
        rotation_result(label(0.0), None, "no"),
    ]
    table = rotation_table(results)
    assert (table["acc30"], table["acc30_top5"]) == pytest.approx((1 / 3, 2 / 3))
    # A whole label is scored by the geodesic angle for every hypothesis, not by azimuth.
    turned = RotationHypothesis(Rotation(0.0, 60.0, 12.0), 1.0)
    result = rotation_result(label(0.0, 60.0), turned.rotation, hypotheses=[turned])
    assert result.hypothesis_errors == pytest.approx((12.0,))


def test_keys_are_the_published_ones() -> None:
    keys = {"acc30", "acc10", "mederr", "flips", "n", "yield"}
    table = rotation_table(results_with([3.0]))
    assert keys <= set(table)
    assert keys <= set(table["classes"]["car"])
    assert json.loads(json.dumps(table, allow_nan=False)) == table


def test_a_flip_is_told_by_azimuth_even_with_a_whole_label() -> None:
    # Upside down by in-plane rotation: a large error, but no azimuth flip.
    turned = rotation_result(label(0.0, 0.0, 0.0), Rotation(0.0, 0.0, 170.0))
    flipped = rotation_result(label(0.0, 40.0, 0.0), Rotation(175.0, 40.0, 0.0))
    # Both look from above: the flip's geodesic error is no less for it.
    assert rotation_table([turned])["flips"] == 0.0
    assert rotation_table([flipped])["flips"] == 1.0


@pytest.mark.parametrize("results", [[], [rotation_result(label(0.0), None, "no")]])
def test_no_answer_at_all_gives_a_valid_table(results: list[RotationResult]) -> None:
    table = rotation_table(results)
    assert (table["n"], table["yield"]) == (0, 0.0)
    for key in ("acc30", "acc30_interval", "acc30_top5", "acc10", "mederr", "flips"):
        assert table[key] is None
    assert table["macro"] == {}
    json.dumps(table, allow_nan=False)
