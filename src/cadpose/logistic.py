"""A logistic model of named features, fitted with NumPy alone, and how fitted numbers are kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.errors import InputError
from cadpose.geometry.frames import FloatArray

#: No finite sample shows that an answer is certain.
_LEAST = 1e-3
_STEPS = 100
#: Longest kept model that is parsed.
_MAX_CHARACTERS = 1_000_000

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Logistic:
    """Log odds that are linear in standardised features.

    Attributes:
        names: F feature names.
        mean: (F,) features' means on the fitted sample.
        scale: (F,) their standard deviations, above 0.
        weights: (F,) of the standardised features.
        bias: Log odds at the mean.

    Raises:
        ValueError: shapes do not fit together, or a number is not finite or out of its range.
    """

    names: tuple[str, ...]
    mean: FloatArray
    scale: FloatArray
    weights: FloatArray
    bias: float

    def __post_init__(self) -> None:
        shape = (len(self.names),)
        if not self.names or len(set(self.names)) != len(self.names):
            raise ValueError("a logistic model needs features of different names")
        if not self.mean.shape == self.scale.shape == self.weights.shape == shape:
            raise ValueError(f"mean, scale and weights must have the shape {shape}")
        numbers = np.concatenate([self.mean, self.scale, self.weights, [self.bias]])
        if not np.isfinite(numbers).all() or not (self.scale > 0).all():
            raise ValueError("numbers must be finite and scales above 0")

    @classmethod
    def fit(cls, features: ArrayLike, hits: ArrayLike, names: Sequence[str], *, l2: float = 1.0) -> Logistic:
        """Newton's method on the log loss with an L2 penalty on the weights.

        The outcomes are drawn a little towards each other (Platt 1999), so that the model stays finite
        where all are hits or none.

        Args:
            features: (N, F).
            hits: (N,) bool.
            names: F names.
            l2: Strength of the penalty, above 0; the loss is summed over the sample.

        Raises:
            ValueError: the sample is empty, shapes do not fit together, or a feature is not finite.
        """
        X, hit = np.asarray(features, float), np.asarray(hits, bool)
        if X.ndim != 2 or not X.size or hit.shape != (len(X),) or not np.isfinite(X).all() or not l2 > 0:
            raise ValueError(f"features {X.shape} must be finite (N, F), hits {hit.shape} (N,), l2 above 0")
        mean, spread = X.mean(axis=0), X.std(axis=0)
        # A feature that never varies says nothing; rounding must not make it loud.
        scale = np.where(spread > 1e-9 * np.abs(mean), spread, 1.0)
        n = int(hit.sum())
        target = np.where(hit, (n + 1.0) / (n + 2.0), 1.0 / (len(hit) - n + 2.0))
        A = np.column_stack([(X - mean) / scale, np.ones(len(X))])
        penalty = np.append(np.full(X.shape[1], l2), 0.0)

        def loss(w: FloatArray) -> float:
            s = A @ w
            return float(np.sum(np.logaddexp(0.0, s) - target * s) + 0.5 * np.sum(penalty * w * w))

        w = np.zeros(A.shape[1])
        now = loss(w)
        for _ in range(_STEPS):
            p = _sigmoid(A @ w)
            hessian = (A * (p * (1.0 - p))[:, None]).T @ A + np.diag(penalty + 1e-12)
            step = np.linalg.solve(hessian, A.T @ (p - target) + penalty * w)
            # The loss is convex: a step that is halved often enough does not raise it.
            size = 1.0
            while size > 1e-6 and loss(w - size * step) > now:
                size /= 2.0
            if size <= 1e-6:
                break
            w = w - size * step
            now = loss(w)
            if np.abs(size * step).max() < 1e-10:
                break
        return cls(tuple(names), mean, scale, w[:-1], float(w[-1]))

    def probability(self, features: ArrayLike) -> FloatArray:
        """(..., F) features to (...) probabilities in [0.001, 0.999].

        Raises:
            ValueError: the last axis is not as long as ``names``.
        """
        return np.asarray(np.clip(_sigmoid(self.log_odds(features)), _LEAST, 1.0 - _LEAST))

    def log_odds(self, features: ArrayLike) -> FloatArray:
        """(..., F) features to (...) log odds.

        Raises:
            ValueError: the last axis is not as long as ``names``.
        """
        X = np.asarray(features, float)
        if X.shape[-1:] != self.mean.shape:
            raise ValueError(f"features must be (..., {len(self.names)}), got {X.shape}")
        return np.asarray((X - self.mean) / self.scale @ self.weights + self.bias)

    def to_json(self) -> dict[str, Any]:
        """What `from_json` reads."""
        rows = zip(self.names, self.mean, self.scale, self.weights, strict=True)
        return {
            "bias": float(self.bias),
            "features": [
                {"name": name, "mean": float(m), "scale": float(s), "weight": float(w)}
                for name, m, s, w in rows
            ],
        }

    @classmethod
    def from_json(cls, value: Any) -> Logistic:
        """From what `to_json` told.

        Raises:
            KeyError, TypeError, ValueError: it is none.
        """
        features = value["features"]
        return cls(
            tuple(str(f["name"]) for f in features),
            np.array([float(f["mean"]) for f in features]),
            np.array([float(f["scale"]) for f in features]),
            np.array([float(f["weight"]) for f in features]),
            float(value["bias"]),
        )


def threshold_for(p: FloatArray, right: NDArray[np.bool_], share: float) -> float:
    """Lowest of (N,) chances from which on a share of the answers is right; 1 if none does."""
    order = np.argsort(-p, kind="stable")
    precision = np.cumsum(right[order]) / np.arange(1, len(p) + 1)
    good = np.flatnonzero(precision >= share - 1e-12)
    return float(p[order[good[-1]]]) if len(good) else 1.0


def read_fitted(text: str, format_name: str, what: str, name: str, make: Callable[[Any], T]) -> T:
    """What was fitted and kept as JSON.

    Args:
        text: JSON, an object whose ``format`` is ``format_name``.
        format_name: Of the only version that is read.
        what: What another file is, in the error: ``"no CAD confidence"``.
        name: What to call the file.
        make: Makes it of the object.

    Raises:
        InputError: it is none of this format, or ``make`` finds a key or number wrong.
    """
    try:
        if len(text) > _MAX_CHARACTERS:
            raise ValueError(f"longer than {_MAX_CHARACTERS} characters")
        value: Any = json.loads(text)
        if value["format"] != format_name:
            raise ValueError(f"not of the format {format_name}")
        return make(value)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        why = f"it has no {error}" if isinstance(error, KeyError) else error
        raise InputError(f"{name} is {what} ({why}), fit it again") from None


def _sigmoid(log_odds: FloatArray) -> FloatArray:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -35.0, 35.0))))
