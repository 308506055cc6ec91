"""Counts of the true model's places, and the shares and intervals that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cadpose.evaluation.statistics import wilson_interval

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class RankCounts:
    """How often the true model stood at each of the first three places.

    Attributes:
        name: Category or measure.
        photos: All photos, also those that were rejected on the way.
        used: Photos whose candidates were ranked.
        first, second, third: Photos with the true model at that place.
        accepted: Of the used photos, those whose first candidate was accepted without a person's look; None
            where the measure states no probability.
        accepted_right: Of the accepted ones, those whose first candidate was the true model.

    Raises:
        ValueError: the numbers contradict one another.
    """

    name: str
    photos: int
    used: int
    first: int
    second: int
    third: int
    accepted: int | None = None
    accepted_right: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.top(3) <= self.used <= self.photos or min(self.first, self.second, self.third) < 0:
            raise ValueError(
                f"{self.name}: {self.top(3)} of {self.used} used of {self.photos} photos cannot be"
            )
        if (self.accepted is None) != (self.accepted_right is None):
            raise ValueError(f"{self.name}: accepted photos need their number of right ones, and vice versa")
        if self.accepted is not None and self.accepted_right is not None:
            right, most = self.accepted_right, min(self.accepted, self.first)
            if not (0 <= right <= most and self.accepted <= self.used):
                raise ValueError(f"{self.name}: {right} of {self.accepted} accepted photos cannot be right")

    def top(self, k: int) -> int:
        """Photos with the true model among the first ``k``, 1 to 3."""
        return sum((self.first, self.second, self.third)[:k])

    def rate(self, k: int) -> float | None:
        """Share of the used photos with the true model among the first ``k``; None where none was used."""
        return self.top(k) / self.used if self.used else None

    def interval(self, k: int) -> Interval | None:
        """Wilson 95 % interval of `rate`."""
        return wilson_interval(self.top(k), self.used) if self.used else None

    def end_to_end(self, k: int) -> float | None:
        """Share of all photos with the true model among the first ``k``; a rejected one counts as missed."""
        return self.top(k) / self.photos if self.photos else None

    def end_to_end_interval(self, k: int) -> Interval | None:
        """Wilson 95 % interval of `end_to_end`."""
        return wilson_interval(self.top(k), self.photos) if self.photos else None

    @property
    def rates(self) -> Rates | None:
        """Shares of the used photos at each place."""
        if not self.used:
            return None
        return Rates("success rate", *(n / self.used for n in (self.first, self.second, self.third)))

    @property
    def precision(self) -> float | None:
        """Share of the accepted photos that are right; None where none was accepted or none can be."""
        return (
            self.accepted_right / self.accepted if self.accepted and self.accepted_right is not None else None
        )

    def to_json(self) -> dict[str, Any]:
        """Plain numbers: counts, ``top1`` to ``top3`` with intervals, the same over all photos."""
        told: dict[str, Any] = {
            "n": self.used,
            "photos": self.photos,
            "yield": self.used / self.photos if self.photos else 0.0,
            "ranks": [self.first, self.second, self.third],
        }
        for k in (1, 2, 3):
            told[f"top{k}"] = self.rate(k)
            told[f"top{k}_interval"] = _listed(self.interval(k))
        told["end_to_end"] = {
            key: value
            for k in (1, 3)
            for key, value in (
                (f"top{k}", self.end_to_end(k)),
                (f"top{k}_interval", _listed(self.end_to_end_interval(k))),
            )
        }
        if self.accepted is not None and self.accepted_right is not None:
            told["accepted"] = {
                "n": self.accepted,
                "coverage": self.accepted / self.used if self.used else None,
                "precision": self.precision,
                "precision_interval": _listed(wilson_interval(self.accepted_right, self.accepted))
                if self.accepted
                else None,
            }
        return told


@dataclass(frozen=True, slots=True)
class Rates:
    """Shares of photos, fractions of 1, with the true model at the first, second and third place.

    Attributes:
        name: What is told: a mean, or a baseline.
        first, second, third: The shares.
    """

    name: str
    first: float
    second: float
    third: float

    @property
    def top3(self) -> float:
        """Among the first three."""
        return self.first + self.second + self.third

    def to_json(self) -> dict[str, float]:
        """``top1``, ``top2`` and ``top3``."""
        return {"top1": self.first, "top2": self.first + self.second, "top3": self.top3}


def _listed(interval: Interval | None) -> list[float] | None:
    return None if interval is None else list(interval)
