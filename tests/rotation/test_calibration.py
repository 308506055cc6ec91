from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.rotation.calibration import Calibration

Array = NDArray[np.float64]


def drawn(n: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """(features, errors, true chances): log odds 1 + 2 a - 0.5 b, where a has mean 3 and b a spread of 10."""
    rng = np.random.default_rng(seed)
    X = np.column_stack([rng.normal(3.0, 1.0, n), rng.normal(0.0, 10.0, n)])
    chance = 1.0 / (1.0 + np.exp(-(1.0 + 2.0 * (X[:, 0] - 3.0) - 0.05 * X[:, 1])))
    right = rng.uniform(size=n) < chance
    errors = np.where(right, rng.uniform(0.0, 30.0, n), rng.uniform(60.0, 180.0, n))
    return X, errors, chance


def test_a_known_logistic_is_recovered() -> None:
    X, errors, chance = drawn(20_000)
    fitted = Calibration.fit(X, errors, ("gap", "spread"))
    # Of standardised features, so divided by their spread.
    assert fitted.weights / fitted.scale == pytest.approx([2.0, -0.05], rel=0.05)
    assert fitted.bias - fitted.weights @ ((fitted.mean - [3.0, 0.0]) / fitted.scale) == pytest.approx(
        1.0, abs=0.07
    )
    assert np.abs(fitted.probability(X) - chance).max() < 0.03
    # Right answers are off by 15° in the mean, wrong ones by 120°.
    told = fitted.expected_error(X)
    assert np.abs(told - (15.0 * chance + 120.0 * (1.0 - chance))).mean() < 4.0
    assert told.mean() == pytest.approx(errors.mean(), abs=2.0)


def test_the_penalty_draws_weights_to_nothing() -> None:
    X, errors, _ = drawn(300)
    weak, strong = (Calibration.fit(X, errors, l2=l2) for l2 in (0.01, 1e6))
    assert np.abs(strong.weights).max() < 0.01 < np.abs(weak.weights).max()
    # The bias is not drawn: the mean chance is still the share of right answers.
    assert strong.probability(X).mean() == pytest.approx((errors <= 30).mean(), abs=0.01)


def test_the_threshold_reaches_its_precision_with_the_largest_coverage() -> None:
    X, errors, _ = drawn(2_000)
    right = errors <= 30.0
    for target in (0.8, 0.9, 0.97):
        fitted = Calibration.fit(X, errors, target_precision=target)
        kept = ~fitted.needs_review(X)
        assert right[kept].mean() >= target
        p = fitted.probability(X)
        looser = p >= np.sort(p[~kept])[-20]
        assert right[looser].mean() < target + 0.005
    assert 0.0 < Calibration.fit(X, errors, target_precision=0.8).threshold < fitted.threshold < 1.0
    # Where all together are right often enough, nothing needs review, also not an answer yet unseen.
    easy = Calibration.fit(X, errors, target_precision=0.3)
    assert easy.threshold == 0.0 and not easy.needs_review(X - 100.0).any()


def test_threshold_by_hand() -> None:
    X = np.array([[4.0], [3.0], [2.0], [1.0]])
    fitted = Calibration.fit(X, [5.0, 170.0, 10.0, 90.0], target_precision=0.6)
    # Precision 1, 1/2, 2/3, 1/2: three of four are kept.
    assert fitted.needs_review(X).tolist() == [False, False, False, True]
    assert fitted.threshold == pytest.approx(fitted.probability(X)[2:].mean())


@settings(deadline=None)
@given(st.integers(0, 1000), st.integers(1, 200), st.integers(1, 4))
def test_a_likelier_answer_never_has_the_larger_expected_error(seed: int, n: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    fitted = Calibration.fit(rng.normal(size=(n, count)), rng.uniform(0.0, 180.0, n))
    X = rng.normal(size=(100, count)) * 5.0
    order = np.argsort(fitted.probability(X))
    told = fitted.expected_error(X)[order]
    assert (np.diff(told) <= 1e-9).all() and told.min() >= 0.0 and told.max() <= 180.0
    # Along each feature the chance goes one way, that of its weight's sign.
    line = np.zeros((50, count))
    line[:, 0] = np.linspace(-4.0, 4.0, 50)
    assert (np.diff(fitted.probability(line)) * np.sign(fitted.weights[0]) >= 0.0).all()


@pytest.mark.parametrize("n", [1, 5, 500])
@pytest.mark.parametrize(("error", "right"), [(3.0, True), (170.0, False)])
def test_all_right_or_all_wrong(n: int, error: float, right: bool) -> None:
    X = np.random.default_rng(0).normal(size=(n, 2))
    fitted = Calibration.fit(X, np.full(n, error))
    assert np.abs(fitted.weights).max() < 1e-6
    expected = (n + 1) / (n + 2) if right else 1 / (n + 2)
    assert fitted.probability(X) == pytest.approx(np.full(n, expected), abs=1e-6)
    assert fitted.expected_error(X) == pytest.approx(np.full(n, error))
    assert fitted.needs_review(X).tolist() == [not right] * n


def test_separable_constant_and_huge_features_stay_finite() -> None:
    n = 100
    X = np.column_stack([np.arange(n) * 1e12, np.full(n, 7.0), np.arange(n) * 1e-12])
    errors = np.where(np.arange(n) < 40, 120.0, 4.0)
    fitted = Calibration.fit(X, errors, l2=1e-6)
    assert np.isfinite(fitted.weights).all() and fitted.weights[1] == 0.0
    p = fitted.probability(X)
    assert p[:39].max() < 0.5 < p[41:].min() and p.min() > 0.0 and p.max() < 1.0
    assert p[:20].max() < 0.05 and p[60:].min() > 0.9 and fitted.weights[2] > 0.1
    assert np.isfinite(fitted.expected_error(X * 1e6)).all()


def test_shapes() -> None:
    X, errors, _ = drawn(50)
    fitted = Calibration.fit(X, errors)
    assert fitted.names == ("feature0", "feature1")
    for function in (fitted.probability, fitted.expected_error, fitted.needs_review):
        whole = function(X)
        assert whole.shape == (50,)
        assert function(X.reshape(5, 10, 2)).tolist() == whole.reshape(5, 10).tolist()
        assert function(X[3]) == pytest.approx(whole[3])
    for bad in (X[:, :1], X * np.nan, X[0, 0]):
        with pytest.raises(ValueError, match="features must be"):
            fitted.probability(bad)


def test_json_gives_the_same_numbers_back() -> None:
    X, errors, _ = drawn(500)
    fitted = Calibration.fit(X, errors, ("gap", "spread"))
    again = Calibration.from_json(fitted.to_json())
    for field in dataclasses.fields(Calibration):
        assert np.array_equal(getattr(again, field.name), getattr(fitted, field.name)), field.name
    assert again.to_json() == fitted.to_json()
    assert np.array_equal(again.probability(X), fitted.probability(X))


def test_arrays_cannot_be_changed_from_outside() -> None:
    fitted = Calibration.fit(*drawn(50)[:2])
    with pytest.raises(ValueError, match="read-only"):
        fitted.weights[0] = 5.0


@pytest.mark.parametrize(
    "edit",
    [
        lambda d: d.update(format="other/1"),
        lambda d: d.update(within_degrees=10),
        lambda d: d.pop("bias"),
        lambda d: d.update(threshold=1.5),
        lambda d: d.update(threshold=float("nan")),
        lambda d: d.update(features=[]),
        lambda d: d["features"].append(d["features"][0]),
        lambda d: d["features"][0].update(scale=0.0),
        lambda d: d["features"][0].update(weight="much"),
        lambda d: d["expected_error"].reverse(),
        lambda d: d.update(expected_error=[]),
        lambda d: d["expected_error"][0].update(degrees=float("nan")),
        lambda d: d.update(features=3),
    ],
)
def test_a_spoilt_file_gives_one_sentence(edit: Any) -> None:
    data = json.loads(Calibration.fit(*drawn(500)[:2]).to_json())
    edit(data)
    with pytest.raises(InputError, match=r"made\.json is not a rotation calibration"):
        Calibration.from_json(json.dumps(data), "made.json")


@pytest.mark.parametrize("text", ["", "[]", "null", "[" * 100_000, "1" * 2_000_000])
def test_what_is_no_calibration_gives_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match="is not a rotation calibration"):
        Calibration.from_json(text)


@pytest.mark.parametrize(
    ("features", "errors", "options"),
    [
        (np.zeros((0, 2)), [], {}),
        (np.zeros((2, 0)), [1.0, 2.0], {}),
        (np.zeros((2, 1)), [1.0], {}),
        (np.zeros((1, 1)), [181.0], {}),
        (np.zeros((1, 1)), [np.nan], {}),
        (np.full((1, 1), np.inf), [1.0], {}),
        (np.zeros((1, 1)), [1.0], {"l2": 0.0}),
        (np.zeros((1, 1)), [1.0], {"target_precision": 1.1}),
        (np.zeros((1, 1)), [1.0], {"names": ("a", "b")}),
        (np.zeros((1, 2)), [1.0], {"names": ("a", "a")}),
    ],
)
def test_what_cannot_be_fitted_is_refused(features: Any, errors: Any, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"features|errors|l2|names|shape"):
        Calibration.fit(features, errors, **options)


def test_only_numpy_is_needed() -> None:
    code = "import sys, cadpose.rotation.calibration; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"scipy", "torch", "cadpose.evaluation", "onnxruntime", "cv2"}.isdisjoint(run.stdout.split())
