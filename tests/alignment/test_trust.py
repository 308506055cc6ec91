from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cadpose.alignment.trust import FEATURES, Trust, features_of
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import Annotation, CadModel, Candidate, Detection, Refinement, RotationHypothesis

R = Rotation(30.0, 10.0)
POSE = Pose4Dof(R, 500.0, (50.0, 40.0))


def annotation(**changes: Any) -> Annotation:
    values: dict[str, Any] = {
        "photo_name": "a.jpg",
        "photo_sha256": "",
        "photo_size": (100, 80),
        "detection": Detection(Box(10, 10, 90, 70), "car"),
        "pose": POSE,
        "candidates": (Candidate(CadModel("a", "a", "car"), 1.0, R, probability=0.75),),
        "hypotheses": (RotationHypothesis(Rotation(36.0, 10.0), 1.0, 0.9, 7.0),),
        "box_iou": 0.9,
        "mask_iou": 0.8,
        "none_probability": 0.125,
        "refinement": Refinement("fast", POSE, 0.5, 0.6, 4, 3.0),
    }
    return Annotation(**(values | changes))


@pytest.fixture(scope="module")
def trust() -> Trust:
    """Right where the silhouette fits and the rotation is sure, in nine of ten."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(2000, len(FEATURES)))
    odds = 3.0 * X[:, FEATURES.index("silhouette")] + 2.0 * X[:, FEATURES.index("rotation")]
    return Trust.fit(X, rng.random(2000) < 1.0 / (1.0 + np.exp(-odds)), precision=0.95, waste=0.05)


def test_the_features_are_what_the_stages_say() -> None:
    told = features_of(annotation())
    assert told is not None
    by = dict(zip(FEATURES, told, strict=True))
    assert by["rotation"] == pytest.approx(np.log(9.0))
    assert by["doubt"] == pytest.approx(np.log(8.0))
    assert (by["cad"], by["none"], by["silhouette"], by["box"]) == (0.75, 0.125, 0.8, 0.9)
    assert by["moved"] == pytest.approx(Rotation(36.0, 10.0).error_to(R) / 60.0)
    assert by["left"] == pytest.approx(np.log(4.0))


@pytest.mark.parametrize(
    "lacking",
    [
        {"hypotheses": ()},
        {"hypotheses": (RotationHypothesis(R, 1.0, 0.9),)},
        {"candidates": (Candidate(CadModel("a", "a", "car"), 1.0, R),)},
        {"none_probability": None},
        {"mask_iou": None},
        {"refinement": None},
        {"refinement": Refinement("fast", POSE, 0.5, 0.6, 4)},
    ],
)
def test_where_a_stage_tells_nothing_no_confidence_is_made_up(trust: Trust, lacking: dict[str, Any]) -> None:
    assert features_of(annotation(**lacking)) is None
    assert trust.of(annotation(**lacking)) is None


def test_the_thresholds_keep_their_promises_on_the_sample(trust: Trust) -> None:
    rng = np.random.default_rng(1)
    X = rng.normal(size=(4000, len(FEATURES)))
    odds = 3.0 * X[:, FEATURES.index("silhouette")] + 2.0 * X[:, FEATURES.index("rotation")]
    right = rng.random(4000) < 1.0 / (1.0 + np.exp(-odds))
    p = trust.model.probability(X)
    assert trust.reject < trust.accept
    assert right[p >= trust.accept].mean() > 0.92
    assert right[p < trust.reject].mean() < 0.08
    assert abs(p.mean() - right.mean()) < 0.03


def test_verdicts_follow_the_confidence(trust: Trust) -> None:
    base = features_of(annotation())
    assert base is not None
    confidence = trust.of(annotation())
    assert confidence is not None
    p = confidence[0]
    assert p == pytest.approx(float(trust.model.probability(base)))
    assert replace(trust, accept=p, reject=0.0).of(annotation()) == (p, "auto_accept")
    assert replace(trust, accept=1.0, reject=0.0).of(annotation()) == (p, "review")
    assert replace(trust, accept=1.0, reject=1.0).of(annotation()) == (p, "reject")


@pytest.mark.parametrize("flag", ["unsure", "tiny"])
def test_a_doubtful_object_is_never_accepted_without_a_look(trust: Trust, flag: str) -> None:
    sure = replace(trust, accept=0.0, reject=0.0)
    plain = annotation()
    changes: dict[str, Any] = {flag: True}
    doubtful = replace(plain, detection=replace(plain.detection, **changes))
    found, other = sure.of(plain), sure.of(doubtful)
    assert found is not None
    assert other is not None
    assert (found[1], other[1]) == ("auto_accept", "review")


def test_it_comes_back_from_json_exactly(trust: Trust) -> None:
    again = Trust.from_json(trust.to_json())
    assert (again.accept, again.reject) == (trust.accept, trust.reject)
    np.testing.assert_array_equal(again.model.weights, trust.model.weights)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"format": "other"}', "[" * 50_000, '{"format": 1}'])
def test_another_file_is_refused_by_name(text: str) -> None:
    with pytest.raises(InputError, match=r"trust\.json is no annotation trust"):
        Trust.from_json(text, "trust.json")


def test_thresholds_out_of_order_are_refused(trust: Trust) -> None:
    with pytest.raises(ValueError, match="not in order"):
        replace(trust, accept=0.2, reject=0.5)


def test_the_shipped_one_was_fitted() -> None:
    shipped = Trust.shipped()
    assert np.abs(shipped.model.weights).max() > 0.3
    assert 0.1 < shipped.reject < shipped.accept < 0.99
    good, poor = annotation(mask_iou=0.97), annotation(mask_iou=0.4)
    told = [shipped.of(one) for one in (good, poor)]
    assert told[0] is not None
    assert told[1] is not None
    assert told[0][0] > 0.7 > 0.3 > told[1][0]
