from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.errors import DependencyError, InputError
from cadpose.records import CadModel, Candidate, Rotation, RotationHypothesis
from cadpose.similarity.joint import confidence as module
from cadpose.similarity.joint.confidence import EVIDENCE, Confidence, Evidence


def candidates(*scores: float, drawn: int = 3) -> list[Candidate]:
    told = []
    for i, score in enumerate(scores):
        measures = {"cached-aligned": score / 4, "cached-inliers": 40.0 * score}
        if i < drawn:
            measures |= {"aligned": score / 3, "inliers": 90.0 * score}
        told.append(Candidate(CadModel(f"m{i}", f"m{i}", "car"), score, Rotation(30 + i, 10), measures))
    return told


GUESSES = [RotationHypothesis(Rotation(36, 10), 1.0, 0.8), RotationHypothesis(Rotation(216, 10), 0.2, 0.1)]


def evidence(*scores: float) -> dict[str, float]:
    return dict(zip(EVIDENCE, Evidence.of(candidates(*scores), GUESSES).values, strict=True))


def test_evidence_compares_the_first_with_the_others() -> None:
    clear, close = evidence(1.5, 0.6, 0.5, 0.4), evidence(1.5, 1.45, 0.5, 0.4)
    # Two others were drawn; a usual spread counts as a third.
    spread = np.sqrt((2 * 0.05**2 + 0.12**2) / 3)
    assert clear["margin"] == 8.0 and evidence(1.0, 0.6, 0.5)["margin"] == pytest.approx(0.4 / spread)
    assert close["margin"] == pytest.approx(0.05 / np.sqrt((2 * 0.475**2 + 0.12**2) / 3))
    for name in ("margin", "aligned", "inliers", "cached_aligned", "cached_inliers"):
        assert clear[name] > close[name] > 0.0
    assert clear["agree"] == 4.0 and clear["rotation"] == 0.8
    assert clear["moved"] == pytest.approx(0.1)


def test_a_measure_may_put_another_first() -> None:
    ranked = candidates(1.5, 1.4, 0.5)
    ranked[1].measures["inliers"] = 500.0
    told = dict(zip(EVIDENCE, Evidence.of(ranked, GUESSES).values, strict=True))
    assert told["inliers"] < 0.0 < told["aligned"] and told["agree"] == 3.0


def test_one_candidate_leads_nobody() -> None:
    alone = evidence(1.5)
    assert [alone[n] for n in EVIDENCE[:5]] == [0.0] * 5


def test_evidence_must_be_finite() -> None:
    with pytest.raises(ValueError, match="finite"):
        Evidence(np.full(len(EVIDENCE), np.nan))
    with pytest.raises(ValueError, match="numbers"):
        Evidence(np.zeros(3))


def fitted() -> Confidence:
    """Rankings whose margin alone tells the truth."""
    rng = np.random.default_rng(1)
    X = rng.random((2000, len(EVIDENCE)))
    among = rng.random(2000) < 0.2 + 0.6 * X[:, 0]
    right = among & (rng.random(2000) < X[:, 0] ** 0.2)
    return Confidence.fit(X, among, right, target_precision=0.95)


def test_larger_margins_give_larger_chances() -> None:
    model = fitted()
    low, high = (np.full(len(EVIDENCE), 0.5) for _ in range(2))
    low[0], high[0] = 0.05, 0.95
    doubtful, sure = (model.chances(Evidence(x), [1.0, 0.8, 0.1]) for x in (low, high))
    assert sure.candidates[0] > doubtful.candidates[0] and sure.none < 0.5 < doubtful.none
    assert (sure.needs_review, doubtful.needs_review) == (False, True)
    assert sure.candidates[1] > sure.candidates[2]


@given(
    st.lists(st.floats(-3, 3), min_size=1, max_size=12),
    st.lists(st.floats(-5, 5), min_size=len(EVIDENCE), max_size=len(EVIDENCE)),
)
def test_candidates_and_none_add_up_to_one(scores: list[float], values: list[float]) -> None:
    chances = fitted_once().chances(Evidence(np.array(values)), sorted(scores, reverse=True))
    assert sum(chances.candidates) + chances.none == pytest.approx(1.0)
    assert min(chances.candidates) >= 0.0 and len(chances.candidates) == len(scores)
    # The better the rank, the better the chance, however little the first one is believed.
    assert list(chances.candidates) == sorted(chances.candidates, reverse=True)
    assert chances.needs_review or chances.none <= 0.5


def test_a_doubted_first_lifts_none_of_these_and_not_the_second() -> None:
    close = Evidence.of(candidates(1.0, 0.99), GUESSES)
    model = fitted_once()
    unlikely = replace(model, first=replace(model.first, bias=model.first.bias - 50.0), threshold=0.0)
    told = unlikely.chances(close, [1.0, 0.99])
    first, second = told.candidates
    assert first == second < 0.01 and told.none > 0.98 and told.needs_review


_KEPT: list[Confidence] = []


def fitted_once() -> Confidence:
    if not _KEPT:
        _KEPT.append(fitted())
    return _KEPT[0]


def test_json_gives_the_same_numbers_back() -> None:
    model = fitted_once()
    again = Confidence.from_json(model.to_json())
    one = Evidence(np.linspace(0, 1, len(EVIDENCE)))
    assert again.chances(one, [2.0, 1.0]) == model.chances(one, [2.0, 1.0])
    assert again.to_json() == model.to_json()


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: d.pop("none"),
        lambda d: d.update(format="cadpose.cad-confidence/0"),
        lambda d: d.update(threshold=1.5),
        lambda d: d["first"]["features"].pop(),
        lambda d: d["first"].update(bias="x"),
        lambda d: d["none"]["features"][0].update(scale=0.0),
    ],
)
def test_what_is_no_confidence_is_refused(damage: Any) -> None:
    told = json.loads(fitted_once().to_json())
    damage(told)
    with pytest.raises(InputError, match=r"x\.json is no CAD confidence"):
        Confidence.from_json(json.dumps(told), "x.json")
    with pytest.raises(InputError, match="longer"):
        Confidence.from_json(" " * 1_000_001)


def test_a_fit_needs_rankings_with_and_without_the_model() -> None:
    X = np.zeros((4, len(EVIDENCE)))
    for among, right in (
        ([True] * 4, [True] * 4),
        ([False] * 4, [False] * 4),
        ([True, False] * 2, [True] * 4),
    ):
        with pytest.raises(ValueError, match="must have the true model"):
            Confidence.fit(X, among, right, target_precision=0.9)
    with pytest.raises(ValueError, match="do not fit"):
        Confidence.fit(X, [True], [True], target_precision=0.9)
    with pytest.raises(ValueError, match="threshold"):
        replace(fitted_once(), threshold=-0.1)
    with pytest.raises(ValueError, match="a candidate"):
        fitted_once().chances(Evidence(X[0]), [])


def test_the_shipped_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clear lead is believed, a close race is not; without the file one is told what to do."""
    shipped = Confidence.shipped()
    clear = shipped.chances(Evidence.of(candidates(1.6, 0.5, 0.4, 0.3), GUESSES), [1.6, 0.5, 0.4, 0.3])
    close = shipped.chances(Evidence.of(candidates(1.0, 0.99, 0.98, 0.9), GUESSES), [1.0, 0.99, 0.98, 0.9])
    assert clear.candidates[0] > 0.8 and not clear.needs_review
    assert close.candidates[0] < 0.6 and close.needs_review and close.none > clear.none
    monkeypatch.setattr(module, "SHIPPED", "nothing.json")
    with pytest.raises(DependencyError, match="reinstall"):
        Confidence.shipped()
