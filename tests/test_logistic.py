from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cadpose.logistic import Logistic, threshold_for


def sample(n: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    X = rng.normal([1.0, -20.0, 5.0], [1.0, 10.0, 0.0], (n, 3))
    p = 1.0 / (1.0 + np.exp(-(0.5 + 1.5 * (X[:, 0] - 1.0) - 0.08 * (X[:, 1] + 20.0))))
    return X, p, rng.random(n) < p


def test_the_fit_finds_the_odds() -> None:
    X, p, hit = sample()
    fitted = Logistic.fit(X, hit, ("a", "b", "same"))
    assert np.abs(fitted.probability(X) - p).mean() < 0.03
    assert fitted.weights[2] == pytest.approx(0.0)
    assert fitted.probability(X).mean() == pytest.approx(hit.mean(), abs=0.005)
    again = Logistic.from_json(fitted.to_json())
    np.testing.assert_array_equal(again.probability(X), fitted.probability(X))


def test_nothing_is_certain() -> None:
    X = np.linspace(-1, 1, 20)[:, None]
    for hit in (np.ones(20, bool), np.zeros(20, bool), X[:, 0] > 0):
        p = Logistic.fit(X, hit, ("x",), l2=0.01).probability(np.array([[-1e9], [0.0], [1e9]]))
        assert ((p >= 0.001) & (p <= 0.999)).all()


def test_what_cannot_be() -> None:
    X, _, hit = sample(10)
    for features, hits, l2 in (
        (X[:0], hit[:0], 1.0),
        (X, hit[:3], 1.0),
        (X * np.nan, hit, 1.0),
        (X, hit, 0.0),
    ):
        with pytest.raises(ValueError, match="features"):
            Logistic.fit(features, hits, ("a", "b", "c"), l2=l2)
    fitted = Logistic.fit(X, hit, ("a", "b", "c"))
    with pytest.raises(ValueError, match="features must be"):
        fitted.probability(np.zeros(2))
    for change in (
        {"scale": np.zeros(3)},
        {"bias": np.nan},
        {"names": ("a", "a", "b")},
        {"mean": np.zeros(2)},
    ):
        with pytest.raises(ValueError, match=r"scales|names|shape"):
            replace(fitted, **change)


def test_the_threshold_keeps_the_precision_asked_for() -> None:
    p = np.array([0.9, 0.8, 0.7, 0.6])
    assert threshold_for(p, np.array([True, True, False, True]), 0.99) == 0.8
    assert threshold_for(p, np.array([True, True, False, True]), 0.7) == 0.6
    assert threshold_for(p, np.array([False, True, True, True]), 0.9) == 1.0
