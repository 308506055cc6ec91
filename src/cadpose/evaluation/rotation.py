"""Rotation errors over a label file: Acc@30, Acc@10, MedErr and azimuth flips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cadpose.datasets.labels import Label
from cadpose.evaluation.statistics import macro_mean, wilson_interval
from cadpose.geometry.angles import azimuth_error
from cadpose.records import Rotation

#: An azimuth error above this counts as a flip: the object was taken for facing the other way.
FLIP_DEGREES = 150.0


@dataclass(frozen=True, slots=True)
class RotationResult:
    """One photo's outcome.

    Attributes:
        label: What is true.
        estimate: The first hypothesis, None where the photo failed.
        error: Geodesic error in degrees, or the azimuth error where only that is labelled.
        azimuth_error: Azimuth error in degrees.
        reason: Why the photo failed.
    """

    label: Label
    estimate: Rotation | None
    error: float = float("nan")
    azimuth_error: float = float("nan")
    reason: str = ""


def rotation_result(label: Label, estimate: Rotation | None, reason: str = "") -> RotationResult:
    """Score one estimate. A label without elevation is scored by azimuth alone."""
    if estimate is None or label.azimuth is None:
        return RotationResult(label, estimate, reason=reason or "the label has no azimuth")
    turn = float(azimuth_error(estimate.azimuth, label.azimuth))
    error = turn if label.rotation is None else label.rotation.error_to(estimate)
    return RotationResult(label, estimate, error, turn)


def evaluate_rotation(
    labels: Sequence[Label],
    estimate: Callable[[Label], Rotation],
    recoverable: type[Exception],
    on_done: Callable[[RotationResult], None] = lambda _: None,
) -> list[RotationResult]:
    """Run ``estimate`` over the labels; a ``recoverable`` error fails that photo only."""
    results = []
    for label in labels:
        try:
            result = rotation_result(label, estimate(label))
        except recoverable as error:
            result = rotation_result(label, None, str(error))
        results.append(result)
        on_done(result)
    return results


def rotation_table(results: Sequence[RotationResult]) -> dict[str, Any]:
    """Overall figures, a row a class under ``classes``, and their macro mean.

    ``acc30``, ``acc10``, ``flips`` and ``yield`` are fractions of 1, ``mederr`` is in degrees.
    Accuracies are over the photos that gave an answer; ``yield`` says how many did. Where none did, all
    but ``n`` and ``yield`` are None.
    """
    classes = sorted({r.label.category for r in results})
    rows = {c: _row([r for r in results if r.label.category == c]) for c in classes}
    table: dict[str, Any] = _row(results)
    table["classes"] = rows
    answered = [row for row in rows.values() if row["n"] > 0]
    table["macro"] = macro_mean(answered, ("acc30", "acc10", "mederr", "flips")) if answered else {}
    return table


def _row(results: Sequence[RotationResult]) -> dict[str, Any]:
    errors = np.array([r.error for r in results if np.isfinite(r.error)])
    turns = np.array([r.azimuth_error for r in results if np.isfinite(r.error)])
    n = len(errors)
    return {
        "n": n,
        "yield": n / len(results) if results else 0.0,
        "acc30": float((errors <= 30).mean()) if n else None,
        "acc30_interval": list(wilson_interval(int((errors <= 30).sum()), n)) if n else None,
        "acc10": float((errors <= 10).mean()) if n else None,
        "mederr": float(np.median(errors)) if n else None,
        "flips": float((turns > FLIP_DEGREES).mean()) if n else None,
    }
