"""Objects found, missed and made up in one photo: detections beside labels, as COCO matches them.

Detections of a category take, the surest first, the free object of that category which they overlap most,
from an IoU of 0.5 on. Objects that are not counted (crowds, difficult ones, those smaller than asked for)
are taken only where no other is left, a crowd by any number of detections that lie in it; a detection that
takes one counts neither as right nor as false, and neither does one of nothing that is smaller than what is
asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cadpose.datasets.label import RunLengths
from cadpose.evaluation.statistics import wilson_interval
from cadpose.geometry.boxes import Box, box_iou

#: A detection shows an object from this IoU on.
SAME_OBJECT = 0.5
#: COCO's sizes: name, and the area in pixels² from which on and up to which.
SIZES: tuple[tuple[str, float, float], ...] = (
    ("small", 0.0, 32.0**2), ("medium", 32.0**2, 96.0**2), ("large", 96.0**2, 1e10),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Truth:
    """A labelled object of a category that counts.

    Attributes:
        box: Around what is seen of it.
        category: Library category.
        area: Pixels².
        crowd: Many objects: not to be counted, whatever their size, and takes all detections that lie in it.
        ignored: One that is not to be counted, whatever its size; takes one detection.
        mask: What is seen of it, if labelled.
    """

    box: Box
    category: str
    area: float
    crowd: bool = False
    ignored: bool = False
    mask: RunLengths | None = None


@dataclass(frozen=True, eq=False)
class Found:
    """A detection.

    Attributes:
        box: Within the photo.
        category: Library category.
        score: In [0, 1].
        mask: Its pixels, if the detector or a mask estimator told them.
    """

    box: Box
    category: str
    score: float
    mask: RunLengths | None = None


@dataclass(frozen=True, eq=False)
class Answer:
    """What one detector said of one photo.

    Attributes:
        found: At its own threshold, of categories that count, best first.
        faint: Down to the score from which average precision is taken; holds ``found`` or its like.
        foreign: Detections of categories that do not count, at its own threshold.
        seconds: How long it took at its own threshold.
    """

    found: tuple[Found, ...]
    faint: tuple[Found, ...]
    foreign: tuple[Found, ...]
    seconds: float


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """What all detectors said of one photo.

    Attributes:
        photo: Its path.
        size: (width, height) in pixels.
        truth: Labelled objects of categories that count.
        answers: By detector.
    """

    photo: Path
    size: tuple[int, int]
    truth: tuple[Truth, ...]
    answers: dict[str, Answer]


@dataclass(frozen=True)
class Matching:
    """Who shows whom in one photo, by number.

    Attributes:
        hits: Detection to the counted object that it shows.
        false: Detections of nothing.
        missed: Counted objects that no detection shows.
        aside: Detections that count neither way.
        placed: Counted objects that some detection of any category lies on.
    """

    hits: dict[int, int]
    false: tuple[int, ...]
    missed: tuple[int, ...]
    aside: tuple[int, ...]
    placed: frozenset[int]


def counts(truth: Truth, smallest: float) -> bool:
    """Whether an object is to be found: no crowd, not ignored, and of that many pixels² at least."""
    return not (truth.crowd or truth.ignored) and truth.area >= smallest


def match(
    truth: Sequence[Truth], found: Sequence[Found], smallest: float = 0.0, foreign: Sequence[Found] = ()
) -> Matching:
    """Match the detections of one photo with its objects.

    Args:
        truth: Labelled objects.
        found: Detections.
        smallest: Objects of fewer pixels² are not counted.
        foreign: Further detections, which are looked at for ``placed`` alone.
    """
    iou = _overlaps(found, truth)
    real = [counts(one, smallest) for one in truth]
    taken: set[int] = set()
    hits: dict[int, int] = {}
    false: list[int] = []
    aside: list[int] = []
    for i in sorted(range(len(found)), key=lambda i: -found[i].score):
        free = [
            j
            for j, one in enumerate(truth)
            if one.category == found[i].category
            and iou[i, j] >= SAME_OBJECT
            and (one.crowd or j not in taken)
        ]
        best = max(free, key=lambda j: (real[j], iou[i, j]), default=None)
        if best is None:
            (aside if found[i].box.area < smallest else false).append(i)
            continue
        taken.add(best)
        if real[best]:
            hits[i] = best
        else:
            aside.append(i)
    near = np.concatenate([iou, _overlaps(foreign, truth)]) >= SAME_OBJECT
    shown = set(hits.values())
    wanted = [j for j in range(len(truth)) if real[j]]
    return Matching(
        hits=hits,
        false=tuple(sorted(false)),
        missed=tuple(j for j in wanted if j not in shown),
        aside=tuple(sorted(aside)),
        placed=frozenset(j for j in wanted if near[:, j].any()),
    )


def _overlaps(
    found: Sequence[Found], truth: Sequence[Truth]
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(N, M) IoU of the boxes; with a crowd the share of the detection that lies in it, as in COCO."""
    if not found or not truth:
        return np.zeros((len(found), len(truth)))
    a = np.array([one.box.to_tuple() for one in found])[:, None]
    b = np.array([one.box.to_tuple() for one in truth])[None]
    sides = np.clip(np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2]), 0.0, None)
    inside = sides.prod(axis=-1) / (a[..., 2:] - a[..., :2]).prod(axis=-1)
    return np.where([one.crowd for one in truth], inside, box_iou(a, b))


@dataclass(frozen=True, slots=True)
class Counts:
    """Over many photos.

    Attributes:
        objects: Those to be found.
        hits: Those that were.
        false: Detections of nothing.
        placed: Objects that some detection of any category lies on.
    """

    objects: int = 0
    hits: int = 0
    false: int = 0
    placed: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.objects + other.objects,
            self.hits + other.hits,
            self.false + other.false,
            self.placed + other.placed,
        )

    @property
    def recall(self) -> float | None:
        """Share of the objects that were found; None where there was none."""
        return self.hits / self.objects if self.objects else None

    @property
    def precision(self) -> float | None:
        """Share of the detections that are right; None where there was none."""
        return self.hits / (self.hits + self.false) if self.hits + self.false else None

    @property
    def recall_interval(self) -> tuple[float, float]:
        """Wilson interval of 95 %."""
        return wilson_interval(self.hits, self.objects)

    @property
    def precision_interval(self) -> tuple[float, float]:
        """Wilson interval of 95 %."""
        return wilson_interval(self.hits, self.hits + self.false)


def size_of(area: float) -> str:
    """The name of a size among ``SIZES``."""
    return next(name for name, low, high in SIZES if low <= area < high or name == SIZES[-1][0])


def count(outcome: PhotoOutcome, detector: str, smallest: float) -> dict[tuple[str, str], Counts]:
    """Counts of one photo by (category, size); a false detection has the size of its box."""
    answer = outcome.answers[detector]
    matching = match(outcome.truth, answer.found, smallest, answer.foreign)
    told: dict[tuple[str, str], Counts] = {}

    def add(category: str, area: float, more: Counts) -> None:
        key = category, size_of(area)
        told[key] = told.get(key, Counts()) + more

    for j in (*matching.hits.values(), *matching.missed):
        one = outcome.truth[j]
        add(one.category, one.area, Counts(objects=1, placed=int(j in matching.placed)))
    for j in matching.hits.values():
        add(outcome.truth[j].category, outcome.truth[j].area, Counts(hits=1))
    for i in matching.false:
        add(answer.found[i].category, answer.found[i].box.area, Counts(false=1))
    return told
