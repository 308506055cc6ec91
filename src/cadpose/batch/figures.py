"""The figures of a run: yields by stage, times by stage, and the worst cases."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cadpose.batch.record import AnnotatedObject, PhotoRecord

#: So many worst cases of each kind are kept.
WORST = 12


@dataclass(frozen=True)
class FailedPhoto:
    """A photo that failed.

    Attributes:
        photo: Its path.
        stage: Where.
        reason: Why, one sentence.
    """

    photo: str
    stage: str
    reason: str


@dataclass(frozen=True)
class StageTime:
    """What one stage took, over the photos that have it.

    Attributes:
        stage: Its name.
        median, p90: Seconds a photo.
        share: Of the time of all stages together.
    """

    stage: str
    median: float
    p90: float
    share: float


@dataclass(frozen=True)
class Case:
    """An object, by the photo's outputs and its place among the photo's objects."""

    stem: str
    record: PhotoRecord
    position: int

    @property
    def found(self) -> AnnotatedObject:
        """What is told of it."""
        return self.record.objects[self.position]


@dataclass(frozen=True)
class RunFigures:
    """A run in numbers.

    Attributes:
        planned: Photos of the run, without copies.
        copies: Photos that hold the bytes of another one and were not annotated for themselves.
        finished: Photos with a document.
        empty: Those of them in which nothing was found.
        failed: The photos that failed.
        annotated: Objects with an annotation.
        left_out: Found objects without one, by stage and reason.
        doubtful: Annotated objects that a person should look at.
        verdicts: Annotated objects by verdict, ``"none"`` where there is none.
        categories: Annotated objects by category, most first.
        times: What the stages took, in the order in which they are met.
        least_sure: Objects of the lowest confidence, lowest first.
        least_iou: Objects of the lowest IoU of the silhouette (of the box where there is no mask).
        confidences, ious: Of all annotated objects that have one.
    """

    planned: int
    copies: int = 0
    finished: int = 0
    empty: int = 0
    failed: tuple[FailedPhoto, ...] = ()
    annotated: int = 0
    left_out: Counter[tuple[str, str]] = field(default_factory=Counter)
    doubtful: int = 0
    verdicts: Counter[str] = field(default_factory=Counter)
    categories: Counter[str] = field(default_factory=Counter)
    times: tuple[StageTime, ...] = ()
    least_sure: tuple[Case, ...] = ()
    least_iou: tuple[Case, ...] = ()
    confidences: tuple[float, ...] = ()
    ious: tuple[float, ...] = ()

    @property
    def pending(self) -> int:
        """Photos that neither finished nor failed yet."""
        return self.planned - self.finished - len(self.failed)

    @property
    def found(self) -> int:
        """Objects that were found or told."""
        return self.annotated + sum(self.left_out.values())


def run_figures(
    finished: Sequence[tuple[str, PhotoRecord]],
    failed: Sequence[FailedPhoto],
    *,
    planned: int,
    copies: int = 0,
) -> RunFigures:
    """The figures of finished photos (stem and record of each) and failed ones."""
    cases = [
        Case(stem, record, position) for stem, record in finished for position in range(len(record.objects))
    ]
    objects = [case.found for case in cases]
    seconds = defaultdict(list)
    for _, record in finished:
        for stage, spent in record.seconds.items():
            seconds[stage].append(spent)
    sure = [case for case in cases if case.found.confidence is not None]
    return RunFigures(
        planned=planned,
        copies=copies,
        finished=len(finished),
        empty=sum(not record.objects and not record.left_out for _, record in finished),
        failed=tuple(failed),
        annotated=len(objects),
        left_out=Counter((lost.stage, lost.reason) for _, record in finished for lost in record.left_out),
        doubtful=sum(one.doubtful for one in objects),
        verdicts=Counter(one.verdict or "none" for one in objects),
        categories=Counter(one.category for one in objects),
        times=_times(seconds),
        least_sure=tuple(sorted(sure, key=lambda c: c.found.confidence or 0.0)[:WORST]),
        least_iou=tuple(sorted(cases, key=lambda c: iou_of(c.found))[:WORST]),
        confidences=tuple(one.confidence for one in objects if one.confidence is not None),
        ious=tuple(iou_of(one) for one in objects),
    )


def iou_of(found: AnnotatedObject) -> float:
    """IoU of the silhouette, of the box where there is no mask."""
    return found.box_iou if found.mask_iou is None else found.mask_iou


def _times(seconds: dict[str, list[float]]) -> tuple[StageTime, ...]:
    whole = sum(sum(values) for values in seconds.values()) or 1.0
    return tuple(
        StageTime(
            stage, float(np.median(values)), float(np.percentile(values, 90)), float(sum(values) / whole)
        )
        for stage, values in seconds.items()
    )
