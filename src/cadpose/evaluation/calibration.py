"""How far stated probabilities can be trusted: reliability, Brier score, and risk against coverage.

Every function takes ``probabilities`` (N,) in [0, 1] and ``hits`` (N,) bool, whether the answer was right.
Answers of equal probability cannot be told apart, so they count as kept or left out in equal shares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.geometry.frames import FloatArray

Binning = Literal["equal-width", "equal-mass"]


@dataclass(frozen=True, eq=False)
class ReliabilityBins:
    """A reliability diagram's points; empty bins are left out.

    Attributes:
        count: (B,) answers a bin.
        confidence: (B,) mean probability a bin.
        accuracy: (B,) share of right answers a bin.
    """

    count: NDArray[np.int64]
    confidence: FloatArray
    accuracy: FloatArray

    @property
    def calibration_error(self) -> float:
        """Expected calibration error: mean gap between confidence and accuracy, weighted by count."""
        gaps = np.abs(self.confidence - self.accuracy)
        return float((self.count * gaps).sum() / self.count.sum())


def reliability_bins(
    probabilities: ArrayLike, hits: ArrayLike, bins: int = 10, kind: Binning = "equal-mass"
) -> ReliabilityBins:
    """Group the answers by probability (Naeini et al. 2015; equal mass: Nguyen and O'Connor 2015).

    Args:
        probabilities: (N,) in [0, 1].
        hits: (N,) bool.
        bins: ``"equal-width"``: parts of [0, 1], the last one closed; ``"equal-mass"``: groups of equal
            size, by rank, as far as N allows. Equal probabilities stay in one group.
        kind: Which of the two.

    Raises:
        ValueError: there is no answer or no bin, a probability is outside [0, 1], or lengths differ.
    """
    p, hit = _checked(probabilities, hits)
    if bins < 1:
        raise ValueError(f"{bins} bins: at least one is needed")
    if kind == "equal-width":
        group = np.minimum((p * bins).astype(np.int64), bins - 1)
    else:
        # By the middle rank of equal probabilities, so that they fall together.
        ordered = np.sort(p)
        rank = (np.searchsorted(ordered, p, "left") + np.searchsorted(ordered, p, "right")) / 2.0
        group = np.minimum((rank * bins / len(p)).astype(np.int64), bins - 1)
    count = np.bincount(group, minlength=bins)
    used = count > 0
    return ReliabilityBins(
        count=count[used].astype(np.int64),
        confidence=np.bincount(group, p, bins)[used] / count[used],
        accuracy=np.bincount(group, hit, bins)[used] / count[used],
    )


def expected_calibration_error(
    probabilities: ArrayLike, hits: ArrayLike, bins: int = 10, kind: Binning = "equal-mass"
) -> float:
    """Mean gap between stated and reached accuracy over the bins, in [0, 1]; see `reliability_bins`."""
    return reliability_bins(probabilities, hits, bins, kind).calibration_error


def brier_score(probabilities: ArrayLike, hits: ArrayLike) -> float:
    """Mean squared gap between probability and outcome, in [0, 1]; lower is better (Brier 1950).

    Raises:
        ValueError: as `reliability_bins`.
    """
    p, hit = _checked(probabilities, hits)
    return float(np.mean((p - hit) ** 2))


@dataclass(frozen=True, eq=False)
class RiskCoverage:
    """What share of answers is wrong when only the most probable ones are kept.

    Attributes:
        coverage: (N,) shares of answers kept, 1/N to 1.
        risk: (N,) share of wrong answers among those kept.
    """

    coverage: FloatArray
    risk: FloatArray

    @property
    def area(self) -> float:
        """Mean risk over all coverages; lower is better (AURC, Geifman et al. 2019)."""
        return float(self.risk.mean())


def risk_coverage(probabilities: ArrayLike, hits: ArrayLike) -> RiskCoverage:
    """Risk at every coverage, most probable answers first.

    Raises:
        ValueError: as `reliability_bins`.
    """
    p, hit = _checked(probabilities, hits)
    order = np.argsort(-p, kind="stable")
    _, group, count = np.unique(-p[order], return_inverse=True, return_counts=True)
    # Each of several equals stands for their mean.
    share = np.bincount(group, hit[order]) / count
    kept = np.arange(1, len(p) + 1)
    return RiskCoverage(kept / len(p), np.clip(1.0 - np.cumsum(share[group]) / kept, 0.0, 1.0))


def unflagged_precision(hits: ArrayLike, flagged: ArrayLike) -> tuple[float | None, float]:
    """Share of right answers among those not flagged for review (None if all are), and their share of all.

    Raises:
        ValueError: there is no answer, or lengths differ.
    """
    hit, flag = np.asarray(hits, bool), np.asarray(flagged, bool)
    if hit.shape != flag.shape or hit.ndim != 1 or not len(hit):
        raise ValueError(f"hits {hit.shape} and flags {flag.shape} must be (N,) each, N at least 1")
    kept = hit[~flag]
    return (float(kept.mean()) if len(kept) else None), len(kept) / len(hit)


def _checked(probabilities: ArrayLike, hits: ArrayLike) -> tuple[FloatArray, FloatArray]:
    p, hit = np.asarray(probabilities, float), np.asarray(hits, bool)
    if p.ndim != 1 or p.shape != hit.shape or not len(p):
        raise ValueError(f"probabilities {p.shape} and hits {hit.shape} must be (N,) each, N at least 1")
    # Sums to 1 may exceed it by rounding, as the records allow.
    if not ((p >= 0.0) & (p <= 1.0 + 1e-9)).all():
        raise ValueError("a probability is outside [0, 1]")
    return np.minimum(p, 1.0), hit.astype(float)
