"""Masks from true boxes, beside true masks: every estimator on the same boxes."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cadpose.datasets.label import Label, RunLengths
from cadpose.datasets.scenes import Scene
from cadpose.detection.masks import MaskEstimator
from cadpose.errors import CadposeError, DependencyError
from cadpose.evaluation.detection_run import runs_of
from cadpose.evaluation.mask_quality import boundary_f
from cadpose.evaluation.perturbations import Perturbation
from cadpose.geometry.boxes import Box, mask_iou
from cadpose.photos import read_photo
from cadpose.records import Mask, Photo

#: A mask of this IoU or more counts as good.
GOOD = 0.9


@dataclass(frozen=True, eq=False)
class MaskScore:
    """One estimator's mask of one object.

    Attributes:
        iou: With the true mask.
        boundary: Boundary F, see `boundary_f`.
        seconds: How long it took.
        mask: It.
    """

    iou: float
    boundary: float
    seconds: float
    mask: RunLengths


@dataclass(frozen=True, eq=False)
class MaskOutcome:
    """One object.

    Attributes:
        photo: Path of its photo.
        category: Library category, or the data set's own word.
        box: What the estimators were given.
        truth: The true mask.
        scores: By estimator.
    """

    photo: Path
    category: str
    box: Box
    truth: RunLengths
    scores: Mapping[str, MaskScore]


def evaluate_masks(
    scenes: Sequence[Scene],
    estimators: Mapping[str, MaskEstimator],
    categories: Collection[str],
    *,
    smallest: float = 32.0**2,
    perturbation: Perturbation | None = None,
    on_done: Callable[[], None] = lambda: None,
) -> tuple[list[MaskOutcome], list[tuple[str, str]]]:
    """Every estimator on every object that has a mask.

    The first object is shown to each once before, so that what is loaded at the first use is no time.

    Args:
        scenes: Photos with labels.
        estimators: Name to estimator.
        categories: Those that count.
        smallest: Objects of fewer pixels² are left out, as are crowds and difficult ones.
        perturbation: Moves the boxes' sides, as in the evaluation of rotations.
        on_done: Told of each photo.

    Returns:
        The outcomes, and (photo, reason) of what was left out.

    Raises:
        DependencyError: weights or programs are missing.
    """
    outcomes: list[MaskOutcome] = []
    failures: list[tuple[str, str]] = []
    for scene in scenes:
        try:
            photo = read_photo(scene.photo)
            for category, given, truth in _objects(scene, photo, categories, smallest):
                box = given
                if perturbation is not None:
                    box = perturbation.object_in_photo(Label(scene.photo, category, given))[1]
                if not outcomes:
                    for estimator in estimators.values():
                        estimator.mask(photo, box)
                scores = {name: _score(e, photo, box, truth) for name, e in estimators.items()}
                outcomes.append(MaskOutcome(scene.photo, category, box, runs_of(truth), scores))
        except DependencyError:
            raise
        except CadposeError as error:
            failures.append((str(scene.photo), str(error)))
        on_done()
    return outcomes, failures


def _objects(
    scene: Scene, photo: Photo, categories: Collection[str], smallest: float
) -> Iterator[tuple[str, Box, Mask]]:
    for one in scene.objects(photo):
        left_out = one.ignored or one.crowd or one.area < smallest
        if one.mask is None or left_out or one.category not in categories:
            continue
        truth = one.mask(photo)
        if truth.any():
            yield one.category, one.box, truth


def _score(
    estimator: MaskEstimator,
    photo: Photo,
    box: Box,
    truth: Mask,
) -> MaskScore:
    start = time.perf_counter()
    mask = estimator.mask(photo, box)
    seconds = time.perf_counter() - start
    return MaskScore(mask_iou(mask, truth), boundary_f(mask, truth), seconds, runs_of(mask))
