"""Rotation errors over a label file: Acc@30, Acc@10, MedErr and azimuth flips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cadpose.datasets.labels import Label
from cadpose.evaluation.retrieval_inputs import RejectedError
from cadpose.evaluation.statistics import macro_mean, wilson_interval
from cadpose.geometry.angles import azimuth_error, rotation_from_angles
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.records import Rotation, RotationHypothesis

#: An azimuth error above this counts as a flip: the object was taken for facing the other way.
FLIP_DEGREES = 150.0
#: Hypotheses among which the best one is looked for, were it known which.
TOP = 5


@dataclass(frozen=True, slots=True)
class RotationResult:
    """One photo's outcome.

    Attributes:
        label: What is true.
        estimate: The first hypothesis, None where the photo failed.
        error: Geodesic error in degrees, or the azimuth error where only that is labelled.
        azimuth_error: Azimuth error in degrees.
        reason: Why the photo failed.
        hypotheses: All that was answered, best first.
        hypothesis_errors: Error of each hypothesis in degrees, measured as ``error`` is.
        symmetry: The group that the errors are taken modulo, None for plain errors.
        lost: The detector did not find the object: a measured outcome, told in ``reason``.
    """

    label: Label
    estimate: Rotation | None
    error: float = float("nan")
    azimuth_error: float = float("nan")
    reason: str = ""
    hypotheses: tuple[RotationHypothesis, ...] = ()
    hypothesis_errors: tuple[float, ...] = ()
    symmetry: SymmetryGroup | None = None
    lost: bool = False


def rotation_error(label: Label, estimate: Rotation, symmetry: SymmetryGroup | None = None) -> float:
    """Geodesic error in degrees; the azimuth error where the label has no elevation, NaN without azimuth.

    With ``symmetry`` the smallest error to any rotation at which the object looks as labelled.
    """
    if label.azimuth is None:
        return float("nan")
    if label.rotation is None:
        return _azimuth_error(label.azimuth, estimate.azimuth, symmetry)
    if symmetry is None:
        return label.rotation.error_to(estimate)
    return float(symmetry.geodesic_degrees(label.rotation.to_matrix(), estimate.to_matrix()))


def _azimuth_error(true: float, estimate: float, symmetry: SymmetryGroup | None) -> float:
    """Of turns about the vertical alone."""
    if symmetry is None:
        return float(azimuth_error(estimate, true))
    upright = symmetry.about((0.0, 1.0, 0.0))
    return float(
        upright.geodesic_degrees(rotation_from_angles(true, 0.0), rotation_from_angles(estimate, 0.0))
    )


def rotation_result(
    label: Label,
    estimate: Rotation | None,
    reason: str = "",
    hypotheses: Sequence[RotationHypothesis] = (),
    symmetry: SymmetryGroup | None = None,
) -> RotationResult:
    """Score one estimate, modulo a symmetry if given; by azimuth alone where no elevation is labelled."""
    if estimate is None or label.azimuth is None:
        return RotationResult(label, estimate, reason=reason or "the label has no azimuth")
    return RotationResult(
        label,
        estimate,
        rotation_error(label, estimate, symmetry),
        _azimuth_error(label.azimuth, estimate.azimuth, symmetry),
        hypotheses=tuple(hypotheses),
        hypothesis_errors=tuple(rotation_error(label, h.rotation, symmetry) for h in hypotheses),
        symmetry=symmetry,
    )


def evaluate_rotation(
    labels: Sequence[Label],
    estimate: Callable[[Label], Sequence[RotationHypothesis]],
    recoverable: type[Exception],
    on_done: Callable[[RotationResult], None] = lambda _: None,
    symmetry: Callable[[Label], SymmetryGroup | None] = lambda _: None,
) -> list[RotationResult]:
    """Run ``estimate`` over the labels; a ``recoverable`` error fails that photo only.

    A photo that ``estimate`` rejects (RejectedError) was lost by the detector.

    Args:
        labels: What is true.
        estimate: Hypotheses of a label's object, best first, at least one; the first one is scored.
        recoverable: What a photo may fail with.
        on_done: Told each outcome.
        symmetry: Gives the group that a label's errors are taken modulo, None for plain errors.
    """
    results = []
    for label in labels:
        try:
            hypotheses = estimate(label)
            result = rotation_result(
                label, hypotheses[0].rotation, hypotheses=hypotheses, symmetry=symmetry(label)
            )
        except RejectedError as error:
            result = replace(rotation_result(label, None, str(error)), lost=True)
        except recoverable as error:
            result = rotation_result(label, None, str(error))
        results.append(result)
        on_done(result)
    return results


def rotation_table(results: Sequence[RotationResult]) -> dict[str, Any]:
    """Overall figures, a row a class under ``classes``, and their macro mean.

    ``acc30``, ``acc10``, ``flips`` and ``yield`` are fractions of 1, ``mederr`` is in degrees.
    ``acc30_top5`` counts a photo as right where any of its first five hypotheses is.
    ``symmetric`` counts the answers whose errors were taken modulo a symmetry that is not trivial.
    Accuracies are over the photos that gave an answer; ``yield`` says how many did. Where none did, they,
    ``mederr`` and ``flips`` are None. ``acc30_all`` and ``acc10_all`` are over all photos, one without an
    answer counting as wrong; ``lost`` counts those whose object the detector did not find.
    """
    classes = sorted({r.label.category for r in results})
    rows = {c: _row([r for r in results if r.label.category == c]) for c in classes}
    table: dict[str, Any] = _row(results)
    table["classes"] = rows
    answered = [row for row in rows.values() if row["n"] > 0]
    keys = ("acc30", "acc30_top5", "acc10", "mederr", "flips")
    table["macro"] = macro_mean(answered, keys) if answered else {}
    return table


def _row(results: Sequence[RotationResult]) -> dict[str, Any]:
    errors = np.array([r.error for r in results if np.isfinite(r.error)])
    oracle = np.array([min((r.error, *r.hypothesis_errors[:TOP])) for r in results if np.isfinite(r.error)])
    turns = np.array([r.azimuth_error for r in results if np.isfinite(r.error)])
    n = len(errors)
    modulo = [r.symmetry for r in results if np.isfinite(r.error) and r.symmetry is not None]
    return {
        "n": n,
        "symmetric": sum(not group.is_trivial for group in modulo),
        "yield": n / len(results) if results else 0.0,
        "lost": sum(r.lost for r in results),
        "acc30": float((errors <= 30).mean()) if n else None,
        "acc30_interval": list(wilson_interval(int((errors <= 30).sum()), n)) if n else None,
        "acc30_top5": float((oracle <= 30).mean()) if n else None,
        "acc10": float((errors <= 10).mean()) if n else None,
        "acc30_all": float((errors <= 30).sum() / len(results)) if results else None,
        "acc30_all_interval": list(wilson_interval(int((errors <= 30).sum()), len(results))),
        "acc10_all": float((errors <= 10).sum() / len(results)) if results else None,
        "mederr": float(np.median(errors)) if n else None,
        "flips": float((turns > FLIP_DEGREES).mean()) if n else None,
    }
