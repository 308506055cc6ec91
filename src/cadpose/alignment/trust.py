"""How far a whole annotation can be trusted, from rotation, retrieval and alignment together.

A logistic model turns what the stages say of themselves into the chance that the annotation is right: the
rotation is within 15 degrees, the placed model covers the object (IoU of at least 0.75 with its true mask),
and no other candidate was the object's own model. It is fitted by scripts/fit_annotation_trust.py on
synthetic photos of models that no network was trained on.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.frames import FloatArray
from cadpose.logistic import Logistic, read_fitted, threshold_for
from cadpose.records import Annotation, Verdict

FORMAT = "cadpose.annotation-trust/1"
SHIPPED = "annotation-trust.json"
#: An annotation is right within these: degrees, and IoU with the object's true mask.
RIGHT_DEGREES, RIGHT_IOU = 15.0, 0.75
#: What the stages say: log odds and expected error of the rotation, chances of the first model and of none,
#: IoU of silhouette and box, how far the pose moved from the first hypothesis, and what refinement expects
#: to be left.
FEATURES = ("rotation", "doubt", "cad", "none", "silhouette", "box", "moved", "left")
_L2 = 5.0
#: Log odds beyond this say no more, nor do degrees.
_MOST_ODDS, _MOST_DEGREES = 5.0, 60.0


@dataclass(frozen=True, eq=False)
class Trust:
    """The model and its two thresholds.

    Attributes:
        model: :data:`FEATURES` to log odds.
        accept: From this confidence an annotation may be used without a look.
        reject: Below this one it is not worth a correction.

    Raises:
        ValueError: the model is of other features, or the thresholds are not 0 <= reject <= accept <= 1.
    """

    model: Logistic
    accept: float
    reject: float

    def __post_init__(self) -> None:
        if self.model.names != FEATURES:
            raise ValueError(f"the model must be of {', '.join(FEATURES)}")
        if not 0.0 <= self.reject <= self.accept <= 1.0:
            raise ValueError(f"thresholds {self.reject} and {self.accept} are not in order within [0, 1]")

    @classmethod
    def fit(cls, features: ArrayLike, right: ArrayLike, *, precision: float, waste: float) -> Trust:
        """Fit to annotations whose truth is known.

        Args:
            features: (N, F).
            right: (N,) bool.
            precision: Share of the accepted that is to be right.
            waste: Share of the rejected that may be right.

        Raises:
            ValueError: shapes do not fit together.
        """
        X, hit = np.asarray(features, float), np.asarray(right, bool)
        model = Logistic.fit(X, hit, FEATURES, l2=_L2)
        p = model.probability(X)
        accept = threshold_for(p, hit, precision)
        return cls(model, accept, min(accept, 1.0 - threshold_for(1.0 - p, ~hit, 1.0 - waste)))

    def of(self, annotation: Annotation) -> tuple[float, Verdict] | None:
        """Confidence and verdict; None where a stage does not tell what is needed.

        An object whose category is a guess, or that is tiny, is never accepted without a look.
        """
        told = features_of(annotation)
        if told is None:
            return None
        confidence = float(self.model.probability(told))
        doubtful = annotation.detection.unsure or annotation.detection.tiny
        if confidence >= self.accept and not doubtful:
            return confidence, "auto_accept"
        return confidence, "reject" if confidence < self.reject else "review"

    @classmethod
    def shipped(cls) -> Trust:
        """The one that comes with cadpose.

        Raises:
            DependencyError: it is missing or of another version.
        """
        return _shipped()

    @cached_property
    def digest(self) -> str:
        """12 hex digits that stand for model and thresholds."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:12]

    def to_json(self) -> str:
        """Indented JSON, newline at the end; `from_json` gives the same numbers back exactly."""
        value = {
            "format": FORMAT,
            "accept": float(self.accept),
            "reject": float(self.reject),
            "model": self.model.to_json(),
        }
        return json.dumps(value, indent=1, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str, name: str = "the file") -> Trust:
        """Read what `to_json` wrote.

        Raises:
            InputError: it is none of this format; ``name`` says what to call it.
        """
        return read_fitted(
            text,
            FORMAT,
            "no annotation trust",
            name,
            lambda value: cls(
                Logistic.from_json(value["model"]), float(value["accept"]), float(value["reject"])
            ),
        )


def features_of(annotation: Annotation) -> FloatArray | None:
    """(F,) by :data:`FEATURES`.

    None without calibrated hypotheses, without the ranking's chances, without a mask or unrefined.
    """
    first, best = annotation.hypotheses[0] if annotation.hypotheses else None, annotation.candidates[0]
    none, overlap, left = annotation.none_probability, annotation.mask_iou, annotation.refinement
    if first is None or first.expected_error is None or best.probability is None or none is None:
        return None
    if overlap is None or left is None or left.expected_error is None:
        return None
    p = float(np.clip(first.probability, 1e-6, 1.0 - 1e-6))
    moved = min(first.rotation.error_to(annotation.pose.rotation), _MOST_DEGREES) / _MOST_DEGREES
    return np.array(
        [
            np.clip(np.log(p / (1.0 - p)), -_MOST_ODDS, _MOST_ODDS),
            np.log1p(first.expected_error),
            min(best.probability, 1.0),
            min(none, 1.0),
            overlap,
            annotation.box_iou,
            moved,
            np.log1p(min(left.expected_error, _MOST_DEGREES)),
        ]
    )


@lru_cache(maxsize=1)
def _shipped() -> Trust:
    kept = Path(str(files("cadpose") / "data" / SHIPPED))
    try:
        return Trust.from_json(kept.read_text(encoding="utf-8"), kept.name)
    except (OSError, UnicodeDecodeError, InputError) as error:
        raise DependencyError(f"{kept} is missing or damaged ({error}): reinstall cadpose") from None
