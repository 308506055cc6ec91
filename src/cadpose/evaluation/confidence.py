"""What a run says of its own answers, as figures: calibration, review flags, and the spread of the errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.evaluation.calibration import brier_score, expected_calibration_error, unflagged_precision
from cadpose.evaluation.rotation import RotationResult
from cadpose.geometry.frames import FloatArray

#: An answer counts as right within this angle, degrees; it is what probabilities speak of.
RIGHT_DEGREES = 30.0
#: Edges of the error histogram, degrees: fine where answers are good, coarse where they are not.
ERROR_EDGES = (0, 2, 4, 6, 8, 10, 15, 20, 25, 30, 45, 60, 75, 90, 105, 120, 135, 150, 165, 180)
#: Groups of equal size over which the calibration error is taken.
BINS = 10


@dataclass(frozen=True, eq=False)
class Answers:
    """The first hypotheses of a run, of the photos that gave an answer and have one, as arrays.

    Attributes:
        error: (N,) degrees.
        probability: (N,) in [0, 1].
        flagged: (N,) bool, needs review.
        calibrated: Whether every estimator told an expected error, and so a calibrated probability.
    """

    error: FloatArray
    probability: FloatArray
    flagged: NDArray[np.bool_]
    calibrated: bool

    @classmethod
    def of(cls, results: Sequence[RotationResult]) -> Answers:
        """From the outcomes; those that failed or hold no hypothesis are left out."""
        firsts = [(r.error, r.hypotheses[0]) for r in results if r.hypotheses and np.isfinite(r.error)]
        return cls(
            error=np.array([error for error, _ in firsts], float),
            probability=np.array([h.probability for _, h in firsts], float),
            flagged=np.array([h.needs_review for _, h in firsts], bool),
            calibrated=all(h.expected_error is not None for _, h in firsts),
        )

    def __len__(self) -> int:
        return len(self.error)

    @property
    def right(self) -> NDArray[np.bool_]:
        """(N,) bool: within 30 degrees."""
        return self.error <= RIGHT_DEGREES


def confidence_figures(results: Sequence[RotationResult]) -> dict[str, Any]:
    """Figures of the first hypotheses: the four of `calibration`, ``calibrated`` and ``error_histogram``.

    The four are ``ece``, ``brier``, ``precision_unflagged`` and ``coverage_unflagged``; ``calibrated`` says
    whether every answer has an expected error, and so a probability that means a chance. The calibration
    error is over ten groups of equal size. The histogram has N + 1 ``edges`` in degrees and N ``counts``; an
    error on an edge counts above it, 180 degrees in the last group. Where no photo gave a hypothesis all but
    the histogram are None; so is the precision where all need review.
    """
    answers = Answers.of(results)
    counts = np.histogram(answers.error, ERROR_EDGES)[0].tolist()
    histogram = {"edges": list(ERROR_EDGES), "counts": counts}
    names = ("calibrated", "ece", "brier", "precision_unflagged", "coverage_unflagged")
    if not len(answers):
        return dict.fromkeys(names) | {"error_histogram": histogram}
    p, right = answers.probability, answers.right
    figures = (
        answers.calibrated,
        expected_calibration_error(p, right, BINS),
        brier_score(p, right),
        *unflagged_precision(right, answers.flagged),
    )
    return dict(zip(names, figures, strict=True)) | {"error_histogram": histogram}
