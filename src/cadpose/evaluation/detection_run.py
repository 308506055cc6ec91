"""Detectors over a labelled data set, photo by photo, side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from cadpose.datasets.label import RunLengths
from cadpose.datasets.scenes import Scene, SceneSet, TrueObject
from cadpose.detection import Detector
from cadpose.detection.coco import COCO_NAMES, is_living
from cadpose.detection.masks import MaskEstimator
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.evaluation.detection import Answer, Found, PhotoOutcome, Truth
from cadpose.library.class_map import CATEGORIES, category_from_coco
from cadpose.photos import read_photo
from cadpose.records import Detection, Mask, Photo
from cadpose.rle import encode_mask, text_from_runs

#: Library categories of people and animals: counted only where they are asked for.
LIVING = frozenset(
    category for name in COCO_NAMES.values() if is_living(name) and (category := category_from_coco(name))
)
#: Score down to which detections are taken for average precision.
FLOOR = 0.05


@dataclass(frozen=True, eq=False)
class Contestant:
    """A detector in a table.

    Attributes:
        name: In the table.
        detector: It.
        floor: Lowest score that counts for average precision; the detector is asked a second time for what
            lies between it and its own threshold. Not where it has no ``min_score`` that can be set.
        masks: Makes the masks of detections that have none; None leaves them without.
    """

    name: str
    detector: Detector
    floor: float = FLOOR
    masks: MaskEstimator | None = None

    @property
    def threshold(self) -> float | None:
        """The detector's own lowest score, None where it does not tell."""
        own = getattr(self.detector, "min_score", None)
        return float(own) if isinstance(own, int | float) else None

    def answer(self, photo: Photo, categories: Collection[str]) -> Answer:
        """What it finds.

        Args:
            photo: The photo.
            categories: Those that count.

        Raises:
            CadposeError: as the detector does.
        """
        start = time.perf_counter()
        detections = self.detector.detect(photo)
        seconds = time.perf_counter() - start
        faint = detections
        if self.threshold is not None and self.threshold > self.floor:
            with _lowered(self.detector, self.floor) as lowered:
                if lowered:
                    faint = self.detector.detect(photo)
        known: dict[tuple[float, ...], RunLengths | None] = {}

        def found(some: Sequence[Detection], wanted: bool) -> tuple[Found, ...]:
            made = [
                self._found(d, photo, known if wanted else None)
                for d in sorted(some, key=lambda d: -d.score)
                if (d.category in categories) == wanted
            ]
            return tuple(one for one in made if one is not None)

        return Answer(found(detections, True), found(faint, True), found(detections, False), seconds)

    def _found(
        self, detection: Detection, photo: Photo, known: dict[tuple[float, ...], RunLengths | None] | None
    ) -> Found | None:
        """The detection as it is compared; ``known`` keeps masks by box, and None wants none."""
        box = detection.box.clipped(photo.width, photo.height)
        if box is None:
            return None
        mask = None
        if known is not None:
            if detection.mask is not None:
                mask = runs_of(detection.mask)
            elif self.masks is not None:
                if box.to_tuple() not in known:
                    known[box.to_tuple()] = runs_of(self.masks.mask(photo, box))
                mask = known[box.to_tuple()]
        return Found(box, detection.category, detection.score, mask)


def runs_of(mask: Mask) -> RunLengths:
    """A (H, W) mask in a form that takes little room."""
    return RunLengths((mask.shape[0], mask.shape[1]), text_from_runs(encode_mask(mask)))


def counted_categories(dataset: SceneSet, asked_for: Collection[str] | None = None) -> tuple[str, ...]:
    """Categories of the data set in which detectors are compared, in alphabetical order.

    Args:
        dataset: What it labels is known by its ``categories``.
        asked_for: Only these; None means all of the library's but people and animals.

    Raises:
        InputError: none is left.
    """
    ours = sorted(dataset.categories & CATEGORIES.keys())
    wanted = [c for c in ours if (c not in LIVING if asked_for is None else c in asked_for)]
    if not wanted:
        told = ", ".join(sorted(dataset.categories)[:20])
        raise InputError(f"{dataset.name}: labels no category that was asked for; it labels {told}")
    return tuple(wanted)


def evaluate_detection(
    scenes: Sequence[Scene],
    contestants: Sequence[Contestant],
    categories: Collection[str],
    on_done: Callable[[], None] = lambda: None,
) -> tuple[list[PhotoOutcome], list[tuple[str, str]]]:
    """Ask every detector about every photo; a photo that one cannot take is left out for all.

    The first photo is shown once before, so that what is loaded at the first use does not count as time.

    Args:
        scenes: Photos with labels.
        contestants: Who detects.
        categories: Those that count.
        on_done: Told of each photo.

    Returns:
        The outcomes, and (photo, reason) of what was left out.

    Raises:
        DependencyError: weights or programs are missing.
    """
    outcomes: list[PhotoOutcome] = []
    failures: list[tuple[str, str]] = []
    warm = False
    for scene in scenes:
        try:
            photo = read_photo(scene.photo)
            truth = tuple(truth_of(one, photo) for one in scene.objects(photo) if one.category in categories)
            if not warm:
                for contestant in contestants:
                    contestant.detector.detect(photo)
                warm = True
            answers = {c.name: c.answer(photo, categories) for c in contestants}
            outcomes.append(PhotoOutcome(scene.photo, (photo.width, photo.height), truth, answers))
        except DependencyError:
            raise
        except CadposeError as error:
            failures.append((str(scene.photo), str(error)))
        on_done()
    return outcomes, failures


def truth_of(one: TrueObject, photo: Photo) -> Truth:
    """A labelled object with its mask in a form that takes little room.

    Raises:
        InputError: its mask cannot be used.
    """
    mask = None if one.mask is None else one.mask(photo)
    runs = None if mask is None or not mask.any() else runs_of(mask)
    return Truth(one.box, one.category, one.area, one.crowd, one.ignored, runs)


@contextmanager
def _lowered(detector: Any, floor: float) -> Iterator[bool]:
    """A lower threshold for a while; False where the detector does not let itself be set."""
    own = detector.min_score
    try:
        detector.min_score = floor
    except AttributeError:
        yield False
        return
    try:
        yield True
    finally:
        detector.min_score = own
