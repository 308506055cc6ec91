"""From what an estimator sees of its own answer to a probability and an expected error.

A logistic model turns named features into the chance that a rotation is within 30° of the true one; a
monotone map turns that chance into an expected error in degrees. Both are fitted on labelled photos once
and kept as JSON, so inference needs NumPy alone.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.logistic import Logistic, read_fitted

FORMAT = "cadpose.rotation-calibration/1"
#: An answer is right within this angle, degrees.
WITHIN = 30.0
#: No finite sample shows that an answer is certain.
_LEAST = 1e-4
#: Answers that a point of the error map averages at least, and the most points.
_MEMBERS, _KNOTS = 20, 16


@dataclass(frozen=True, eq=False)
class Calibration:
    """A logistic model of the chance to be right, and the expected error that goes with each chance.

    Attributes:
        names: F feature names, in the order of the arrays.
        mean: (F,) features' means on the fitted photos.
        scale: (F,) their standard deviations, above 0.
        weights: (F,) of the standardised features.
        bias: Log odds at the mean.
        knots: (K,) increasing probabilities in [0, 1] of the error map.
        errors: (K,) expected error at each, degrees in [0, 180], not increasing; linear in between.
        threshold: Answers of a lower probability need review.

    Raises:
        ValueError: shapes do not fit together, or a number is not finite or out of its range.
    """

    names: tuple[str, ...]
    mean: FloatArray
    scale: FloatArray
    weights: FloatArray
    bias: float
    knots: FloatArray
    errors: FloatArray
    threshold: float

    def __post_init__(self) -> None:
        for field in ("mean", "scale", "weights", "knots", "errors"):
            array = np.array(getattr(self, field), float)
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        features = (len(self.names),)
        if not self.names or len(set(self.names)) != len(self.names):
            raise ValueError("a calibration needs features of different names")
        if not self.mean.shape == self.scale.shape == self.weights.shape == features:
            raise ValueError(f"mean, scale and weights must have the shape {features}")
        if self.knots.ndim != 1 or self.knots.shape != self.errors.shape or not len(self.knots):
            raise ValueError("knots and errors must be (K,) each, K at least 1")
        numbers = np.concatenate([self.mean, self.scale, self.weights, [self.bias, self.threshold]])
        if not (np.isfinite(numbers).all() and (self.scale > 0).all() and 0.0 <= self.threshold <= 1.0):
            raise ValueError("numbers must be finite, scales above 0 and the threshold in [0, 1]")
        # Written so that NaN fails.
        if not ((self.knots >= 0) & (self.knots <= 1)).all() or not (np.diff(self.knots) > 0).all():
            raise ValueError("knots must increase within [0, 1]")
        if not ((self.errors >= 0) & (self.errors <= 180)).all() or not (np.diff(self.errors) <= 0).all():
            raise ValueError("expected errors must not increase and lie in [0, 180] degrees")

    @classmethod
    def fit(
        cls,
        features: ArrayLike,
        errors: ArrayLike,
        names: Sequence[str] = (),
        *,
        l2: float = 1.0,
        target_precision: float = 0.9,
    ) -> Calibration:
        """Fit to answers whose errors are known.

        The chance is fitted by :meth:`cadpose.logistic.Logistic.fit`. The expected error is the mean over
        groups of like probability, made monotone by pooling adjacent violators.

        Args:
            features: (N, F).
            errors: (N,) degrees in [0, 180].
            names: F names; ``feature0`` ... unless told.
            l2: Strength of the penalty, above 0; the loss is summed over the answers.
            target_precision: The threshold keeps as many of these answers as it can while at least this
                share of the kept ones is right. Where no threshold reaches it, all need review.

        Raises:
            ValueError: there is no answer, shapes do not fit together, or a number is out of its range.
        """
        X, error = np.asarray(features, float), np.asarray(errors, float)
        if X.ndim != 2 or not X.size or error.shape != (len(X),):
            raise ValueError(f"features {X.shape} and errors {error.shape} must be (N, F) and (N,)")
        if not np.isfinite(X).all() or not ((error >= 0) & (error <= 180)).all():
            raise ValueError("features must be finite and errors in [0, 180] degrees")
        if not l2 > 0.0 or not 0.0 < target_precision <= 1.0:
            raise ValueError("l2 must be above 0 and the target precision in (0, 1]")
        right = error <= WITHIN
        told = tuple(names) or tuple(f"feature{i}" for i in range(X.shape[1]))
        fitted = Logistic.fit(X, right, told, l2=l2)
        p = _probability(fitted.log_odds(X))
        knots, expected = _error_map(p, error)
        return cls(
            names=told,
            mean=fitted.mean,
            scale=fitted.scale,
            weights=fitted.weights,
            bias=fitted.bias,
            knots=knots,
            errors=expected,
            threshold=_threshold(p, right, target_precision),
        )

    def probability(self, features: ArrayLike) -> FloatArray:
        """(..., F) features to (...) chances of being within 30°, in [0.0001, 0.9999].

        Raises:
            ValueError: the last axis is not as long as ``names``, or a feature is not finite.
        """
        X = np.asarray(features, float)
        if X.shape[-1:] != self.mean.shape or not np.isfinite(X).all():
            raise ValueError(f"features must be finite and (..., {len(self.names)}), got {X.shape}")
        return _probability((X - self.mean) / self.scale @ self.weights + self.bias)

    def expected_error(self, features: ArrayLike) -> FloatArray:
        """(..., F) features to (...) expected angles to the true rotation, degrees in [0, 180]."""
        return np.interp(self.probability(features), self.knots, self.errors)

    def needs_review(self, features: ArrayLike) -> NDArray[np.bool_]:
        """(..., F) features to (...) bool: the probability is below the threshold."""
        return np.asarray(self.probability(features) < self.threshold)

    def to_json(self) -> str:
        """Indented JSON, newline at the end; `from_json` gives the same numbers back exactly."""
        value = {
            "format": FORMAT,
            "within_degrees": WITHIN,
            "threshold": float(self.threshold),
            "bias": float(self.bias),
            "features": [
                {"name": name, "mean": float(m), "scale": float(s), "weight": float(w)}
                for name, m, s, w in zip(self.names, self.mean, self.scale, self.weights, strict=True)
            ],
            "expected_error": [
                {"probability": float(p), "degrees": float(e)}
                for p, e in zip(self.knots, self.errors, strict=True)
            ],
        }
        return json.dumps(value, indent=1, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str, name: str = "the calibration") -> Calibration:
        """Read what `to_json` wrote.

        Args:
            text: JSON.
            name: What to call it in the error, usually its path.

        Raises:
            InputError: it is not a calibration of this format.
        """

        def make(value: Any) -> Calibration:
            if value["within_degrees"] != WITHIN:
                raise ValueError(f"not of the format {FORMAT}")
            features, table = value["features"], value["expected_error"]
            return cls(
                names=tuple(str(f["name"]) for f in features),
                mean=np.array([float(f["mean"]) for f in features]),
                scale=np.array([float(f["scale"]) for f in features]),
                weights=np.array([float(f["weight"]) for f in features]),
                bias=float(value["bias"]),
                knots=np.array([float(row["probability"]) for row in table]),
                errors=np.array([float(row["degrees"]) for row in table]),
                threshold=float(value["threshold"]),
            )

        return read_fitted(text, FORMAT, "not a rotation calibration", name, make)


def _probability(log_odds: FloatArray) -> FloatArray:
    # Beyond 35 the exponential says no more, and it must not overflow.
    return np.clip(1.0 / (1.0 + np.exp(-np.clip(log_odds, -35.0, 35.0))), _LEAST, 1.0 - _LEAST)


def _error_map(p: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Increasing probabilities (K,) and the mean error around each (K,), not increasing."""
    order = np.argsort(p, kind="stable")
    groups = np.array_split(order, int(np.clip(len(p) // _MEMBERS, 1, _KNOTS)))
    # Pool adjacent violators (Ayer et al. 1955), for errors that fall as the probability grows.
    blocks: list[tuple[float, float, int]] = []
    for group in groups:
        at, mean, n = float(p[group].mean()), float(error[group].mean()), len(group)
        while blocks and (mean >= blocks[-1][1] or at <= blocks[-1][0]):
            before_at, before, m = blocks.pop()
            at, mean = (at * n + before_at * m) / (n + m), (mean * n + before * m) / (n + m)
            n += m
        blocks.append((at, mean, n))
    return np.array([b[0] for b in blocks]), np.array([b[1] for b in blocks])


def _threshold(p: FloatArray, right: NDArray[np.bool_], target: float) -> float:
    """Lowest probability that keeps a share ``target`` of right answers above it; 1 if none does."""
    order = np.argsort(-p, kind="stable")
    ordered = p[order]
    precision = np.cumsum(right[order]) / np.arange(1, len(p) + 1)
    # Equal probabilities are kept or left out together.
    last = np.append(ordered[:-1] > ordered[1:], True)
    good = np.flatnonzero(last & (precision >= target - 1e-12))
    if not len(good):
        return 1.0
    k = int(good[-1])
    return 0.0 if k == len(p) - 1 else float((ordered[k] + ordered[k + 1]) / 2.0)
