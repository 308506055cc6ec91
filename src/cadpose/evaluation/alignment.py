"""How well the model lies on the object, before and after refinement, beside the best it could do."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cadpose.alignment.placement import Placement, rectangle
from cadpose.alignment.refinement.likeness import Weights
from cadpose.alignment.refinement.refine import Refiner
from cadpose.datasets.label import Label, RunLengths, mask_in_photo, object_in_photo
from cadpose.encoder import lite0
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.evaluation.alignment_truth import TrueModel, true_pixels
from cadpose.evaluation.detection_run import runs_of
from cadpose.evaluation.mask_quality import boundary_f
from cadpose.evaluation.rotation import rotation_error
from cadpose.geometry.boxes import Box, box_iou, mask_iou
from cadpose.pipeline import Annotator
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import CadModel, Mask, Photo

#: The row of the true model at the true rotation, its focal length and offset fitted to the true mask.
CEILING = "ceiling"


@dataclass(frozen=True, eq=False)
class AlignmentScore:
    """One way's pose of one object.

    Attributes:
        pose: It.
        rotation_error: Degrees, modulo the model's symmetry.
        silhouette_iou: With the true mask, or the estimated one where none is labelled.
        boundary: Boundary F of the same, see :func:`cadpose.evaluation.mask_quality.boundary_f`.
        box_iou: IoU of the projected rectangle and the labelled box.
        add: Mean distance of the model's projected vertices from where they truly appear, over the box's
            diagonal (ADD in the picture); None where the label tells no full pose.
        seconds: How long placing took.
    """

    pose: Pose4Dof
    rotation_error: float
    silhouette_iou: float
    boundary: float
    box_iou: float
    add: float | None
    seconds: float


@dataclass(frozen=True, eq=False)
class AlignmentOutcome:
    """One object.

    Attributes:
        label: What is true.
        box: What was looked at.
        cad: Id of the placed model.
        truth: The mask that silhouettes are compared with.
        labelled_mask: Whether that is the labelled one; else it was estimated.
        scores: By way of refining, and :data:`CEILING` where rotation and model are labelled.
        outlines: The silhouettes, by the same names.
    """

    label: Label
    box: Box
    cad: str
    truth: RunLengths
    labelled_mask: bool
    scores: Mapping[str, AlignmentScore]
    outlines: Mapping[str, RunLengths]


@dataclass(frozen=True)
class Ways:
    """What is compared.

    Attributes:
        placements: By name: how the model is placed.
        chosen: Place the model that the ranking chooses; the true one otherwise.
        true_rotation: Begin at the labelled rotation; at the estimated one otherwise.
        true_masks: Give the labelled mask to the placement where there is one.
        candidates: Models to choose among; None for the category's representatives.
    """

    placements: Mapping[str, Placement]
    chosen: bool = False
    true_rotation: bool = False
    true_masks: bool = False
    candidates: Callable[[Label], Sequence[CadModel]] | None = None


def evaluate_alignment(
    labels: Sequence[Label],
    annotator: Annotator,
    ways: Ways,
    on_done: Callable[[], None] = lambda: None,
) -> tuple[list[AlignmentOutcome], list[tuple[str, str]]]:
    """Place the model in every labelled photo in all ways.

    Args:
        labels: What is true; each names its model.
        annotator: Estimates masks and rotations, and ranks.
        ways: What is compared.
        on_done: Told of each label.

    Returns:
        The outcomes, and (photo, reason) of what failed.

    Raises:
        DependencyError: weights or programs are missing.
    """
    outcomes: list[AlignmentOutcome] = []
    failures: list[tuple[str, str]] = []
    # The ceiling is a fit of silhouettes; features and network have no part in it.
    silhouettes = Refiner(lite0(), weights=Weights(features=0.0))
    fit = Placement(annotator.renderer, refiner=silhouettes, refine="fast")
    for label in labels:
        try:
            outcomes.append(_placed(label, annotator, ways, fit))
        except DependencyError:
            raise
        except (CadposeError, ValueError) as error:
            failures.append((str(label.photo), str(error)))
        on_done()
    return outcomes, failures


def _placed(label: Label, annotator: Annotator, ways: Ways, fit: Placement) -> AlignmentOutcome:
    photo, box = object_in_photo(label)
    true = TrueModel.of(label, annotator.library)
    labelled = mask_in_photo(label, photo)
    mask = labelled if ways.true_masks and labelled is not None else annotator.masks.mask(photo, box)
    placed, rotation = _start(label, photo, box, annotator, ways, true)
    truth = mask if labelled is None else labelled
    scores: dict[str, AlignmentScore] = {}
    outlines: dict[str, RunLengths] = {}

    def add(name: str, pose: Pose4Dof, model: TrueModel, seconds: float) -> None:
        drawn = annotator.renderer.render(model.mesh, pose.to_cameras(photo.width, photo.height)).mask[0]
        scores[name] = _score(label, pose, model, drawn, truth, box, seconds)
        outlines[name] = runs_of(drawn)

    for name, placement in ways.placements.items():
        begun = time.perf_counter()
        found = placement.place(photo, box, mask, placed.mesh, rotation, symmetry=placed.symmetry)
        add(name, found.pose, placed, time.perf_counter() - begun)
    if label.rotation is not None:
        begun = time.perf_counter()
        best = fit.place(photo, box, truth, true.mesh, label.rotation, turn=False)
        add(CEILING, best.pose, true, time.perf_counter() - begun)
    return AlignmentOutcome(label, box, placed.id, runs_of(truth), labelled is not None, scores, outlines)


def _start(
    label: Label, photo: Photo, box: Box, annotator: Annotator, ways: Ways, true: TrueModel
) -> tuple[TrueModel, Rotation]:
    """The model to place, and the rotation to begin with."""
    if ways.true_rotation:
        if label.rotation is None:
            raise InputError(f"{label.photo}: the label has no rotation, leave --rotation true out")
        hypotheses = None
        rotations = [label.rotation]
    else:
        hypotheses = annotator.estimate_rotation(photo, box, label.category)
        rotations = [hypotheses[0].rotation]
    if ways.chosen:
        named = None if ways.candidates is None else ways.candidates(label)
        cads = annotator.candidates(label.category) if named is None else named
    elif true.cad is not None:
        cads = [true.cad]
    else:
        # The data set's own model is in no library: it is placed at the category's best guess.
        return true, rotations[0]
    if hypotheses is None:
        best = annotator.rank(photo, box, cads, rotations)[0]
    else:
        best = annotator.rank_jointly(photo, box, cads, hypotheses).candidates[0]
    return TrueModel.of_library(best.cad, annotator.library), best.rotation


def _score(
    label: Label,
    pose: Pose4Dof,
    model: TrueModel,
    drawn: Mask,
    truth: Mask,
    box: Box,
    seconds: float,
) -> AlignmentScore:
    there = true_pixels(label, model)
    distance = None
    if there is not None:
        apart = np.linalg.norm(pose.project(model.points) - there, axis=1)
        distance = float(apart.mean() / np.hypot(box.width, box.height))
    rect = np.array(rectangle(pose, model.mesh).to_tuple())
    return AlignmentScore(
        pose,
        rotation_error(label, pose.rotation, model.symmetry),
        mask_iou(drawn, truth),
        boundary_f(drawn, truth),
        float(box_iou(rect, np.array(box.to_tuple()))),
        distance,
        seconds,
    )
