"""Chances: is the first candidate the object's model, and may none of them be?

Two logistic models turn what a ranking saw into the chance that none of the candidates is the object's
model, and into the chance that the first one is if any is. Both are fitted by
scripts/fit_cad_confidence.py on synthetic photos of models that no network was trained on, with the true
model among the candidates and without it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.frames import FloatArray
from cadpose.logistic import Logistic, read_fitted, threshold_for
from cadpose.records import Candidate, RotationHypothesis

FORMAT = "cadpose.cad-confidence/1"
#: The shipped one.
SHIPPED = "cad-confidence.json"
#: Strength of the penalty: the evidence is much alike, and weights shall not play it off against itself.
_L2 = 10.0
#: Candidates after the first share what is left by exp(score / temperature), up to the first's chance.
_TEMPERATURE = 0.25

#: A measure's usual spread among candidates that are not the object's model. Few candidates say little about
#: it, so that it counts as if one more had been there.
_SPREADS = {"score": 0.12, "aligned": 0.07, "cached-aligned": 0.06, "inliers": 5.0, "cached-inliers": 3.5}
#: Leads of so many spreads behind or ahead say all that they can.
_LEAST_LEAD, _MOST_LEAD = -4.0, 8.0

#: Names of the evidence. The first five tell by how many spreads of the others the first candidate is ahead
#: of the best of them: how alike a render and a photo are at all, and how far apart candidates lie, depends
#: on the photo and on what drew it. Then how many of the four measures put it first, the rotation's
#: probability, and how far it is from the estimator's first, in sixty degrees.
EVIDENCE = (
    "margin",
    "aligned",
    "cached_aligned",
    "inliers",
    "cached_inliers",
    "agree",
    "rotation",
    "moved",
)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What one ranking saw.

    Attributes:
        values: (F,) by :data:`EVIDENCE`.

    Raises:
        ValueError: the shape is another, or a value is not finite.
    """

    values: FloatArray

    def __post_init__(self) -> None:
        if self.values.shape != (len(EVIDENCE),) or not np.isfinite(self.values).all():
            raise ValueError(f"evidence must be {len(EVIDENCE)} finite numbers")

    @classmethod
    def of(cls, ranked: Sequence[Candidate], hypotheses: Sequence[RotationHypothesis]) -> Evidence:
        """From candidates with the measures of a joint ranking, best first, and the rotation hypotheses."""
        leads = [_lead(ranked, measure) for measure in _SPREADS]
        agree = sum(lead >= 0.0 for lead in leads[1:])
        away = hypotheses[0].rotation.error_to(ranked[0].rotation)
        probability = min(float(hypotheses[0].probability), 1.0)
        return cls(np.array([*leads, float(agree), probability, min(away, 60.0) / 60.0]))


@dataclass(frozen=True, slots=True)
class Chances:
    """What is told of one ranking; candidates and none add up to 1.

    Attributes:
        candidates: One a candidate, in their order; none is above the first's.
        none: That none of them is the object's model.
        needs_review: Whether a person should look before the first one is used.
    """

    candidates: tuple[float, ...]
    none: float
    needs_review: bool


@dataclass(frozen=True, eq=False)
class Confidence:
    """Both models and the threshold of the review flag.

    Attributes:
        none: Evidence to the chance that no candidate is the object's model.
        first: Evidence to the chance that the first one is, if any is.
        threshold: Answers whose first candidate has a lower chance, if any is the model, need review.

    Raises:
        ValueError: a model is not of :data:`EVIDENCE`, or the threshold is outside [0, 1].
    """

    none: Logistic
    first: Logistic
    threshold: float

    def __post_init__(self) -> None:
        if not self.none.names == self.first.names == EVIDENCE:
            raise ValueError(f"the models must be of {', '.join(EVIDENCE)}")
        if not 0.0 <= self.threshold <= 1.0:
            raise ValueError(f"the threshold must lie in [0, 1], got {self.threshold}")

    @classmethod
    def fit(
        cls, evidence: ArrayLike, among: ArrayLike, right: ArrayLike, *, target_precision: float
    ) -> Confidence:
        """Fit to rankings whose truth is known.

        Args:
            evidence: (N, F).
            among: (N,) bool, whether the true model was a candidate.
            right: (N,) bool, whether the first candidate was the true model.
            target_precision: The threshold keeps as many of the rankings with the true model among the
                candidates as it can while this share of the kept ones is right.

        Raises:
            ValueError: shapes do not fit together, or no ranking had the true model, or none lacked it.
        """
        X, had, hit = np.asarray(evidence, float), np.asarray(among, bool), np.asarray(right, bool)
        if X.ndim != 2 or had.shape != (len(X),) or hit.shape != (len(X),):
            raise ValueError(f"evidence {X.shape}, among {had.shape} and right {hit.shape} do not fit")
        if not had.any() or had.all() or (hit & ~had).any():
            raise ValueError("some rankings must have the true model, some not, and those cannot be right")
        none = Logistic.fit(X, ~had, EVIDENCE, l2=_L2)
        first = Logistic.fit(X[had], hit[had], EVIDENCE, l2=_L2)
        return cls(none, first, threshold_for(first.probability(X[had]), hit[had], target_precision))

    @classmethod
    def shipped(cls) -> Confidence:
        """The one that comes with cadpose.

        Raises:
            DependencyError: it is missing or of another version.
        """
        kept = Path(str(files("cadpose") / "data" / SHIPPED))
        try:
            return cls.from_json(kept.read_text(encoding="utf-8"), kept.name)
        except (OSError, UnicodeDecodeError, InputError) as error:
            raise DependencyError(f"{kept} is missing or damaged ({error}): reinstall cadpose") from None

    def chances(self, evidence: Evidence, scores: Sequence[float]) -> Chances:
        """The chances of candidates with these scores, best first.

        What says that the first one is wrong does not say that another is right: none of the others gets
        more than the first, and what they cannot take goes to "none of these".

        Raises:
            ValueError: there is no candidate.
        """
        if not scores:
            raise ValueError("chances need a candidate")
        none = float(self.none.probability(evidence.values))
        first = float(self.first.probability(evidence.values)) if len(scores) > 1 else 1.0
        lag = (np.array(scores[1:], float) - max(scores[1:], default=0.0)) / _TEMPERATURE
        shares = np.exp(lag)
        rest = (1.0 - none) * (1.0 - first) * shares / shares.sum() if len(shares) else shares
        best = (1.0 - none) * first
        told = np.minimum(rest, best)
        none += float((rest - told).sum())
        review = first < self.threshold or none > 0.5
        return Chances((best, *(float(p) for p in told)), none, review)

    def to_json(self) -> str:
        """Indented JSON, newline at the end; `from_json` gives the same numbers back exactly."""
        value = {
            "format": FORMAT,
            "threshold": float(self.threshold),
            "none": self.none.to_json(),
            "first": self.first.to_json(),
        }
        return json.dumps(value, indent=1, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str, name: str = "the file") -> Confidence:
        """Read what `to_json` wrote.

        Raises:
            InputError: it is none of this format; ``name`` says what to call it.
        """
        return read_fitted(
            text,
            FORMAT,
            "no CAD confidence",
            name,
            lambda value: cls(
                Logistic.from_json(value["none"]),
                Logistic.from_json(value["first"]),
                float(value["threshold"]),
            ),
        )


def _lead(ranked: Sequence[Candidate], measure: str) -> float:
    """By how many spreads of the others the first is ahead of the best of them; 0 where there is no other.

    Only those that were drawn have a score that compares.
    """
    told = [c for c in ranked if (measure if measure != "score" else "aligned") in c.measures]
    values = np.array([c.score if measure == "score" else c.measures[measure] for c in told])
    first, others = values[0], values[1:]
    if not len(others):
        return 0.0
    usual = _SPREADS[measure]
    spread = np.sqrt((np.sum((others - others.mean()) ** 2) + usual**2) / (len(others) + 1.0))
    return float(np.clip((first - others.max()) / spread, _LEAST_LEAD, _MOST_LEAD))
