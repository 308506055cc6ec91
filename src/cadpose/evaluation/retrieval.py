"""CAD retrieval over labelled photos: each photo's candidates, ranked by everything that competes.

A photo walks the paper's way: read it, find the object, choose the candidates, estimate the rotation, rank.
Where it fails on that way, it is rejected at that stage, and the tables say so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from cadpose.datasets.labels import Label, mask_in_photo, object_in_photo
from cadpose.errors import CadposeError, DependencyError
from cadpose.evaluation.contest import Contest, Ranking
from cadpose.evaluation.retrieval_inputs import Boxes, Candidates, RejectedError, Rotations, shuffled
from cadpose.evaluation.rotation import rotation_error
from cadpose.geometry.boxes import Box
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.pipeline import Annotator
from cadpose.records import Rotation

Stage = Literal["photo", "detection", "gallery", "pose", "review", "ranking"]


@dataclass(frozen=True, slots=True)
class Rejection:
    """Why a photo was not ranked.

    Attributes:
        stage: Where on its way: ``review`` is a rotation that was estimated and flagged.
        reason: Without the photo's name, so that like reasons can be counted.
        measured: Whether it is an outcome that is measured; else something could not be used.
    """

    stage: Stage
    reason: str
    measured: bool = False


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of one photo.

    Attributes:
        label: What is true.
        answers: By name of measure or ranker.
        candidates: Ids of the models to choose among; empty where the photo did not get so far.
        box: The object's box that was used, None as above.
        rotation: What the measures were given, None where there was none.
        rotation_error: Its error in degrees modulo the true model's symmetry, None where not known.
    """

    label: Label
    answers: Mapping[str, Ranking | Rejection]
    candidates: tuple[str, ...] = ()
    box: Box | None = None
    rotation: Rotation | None = None
    rotation_error: float | None = None

    def place(self, name: str) -> int | None:
        """1-based place of the true model in an answer; None where it is not ranked."""
        answer = self.answers[name]
        return answer.place(self.label.cad) if isinstance(answer, Ranking) else None


@dataclass(frozen=True)
class RetrievalRun:
    """Everything that decides an outcome.

    Attributes:
        annotator: Draws, detects, estimates.
        contest: Who ranks.
        candidates: The models to choose among.
        boxes: Where the object is.
        rotations: How it is turned, for the measures.
        symmetry: The group that rotation errors are taken modulo.
        seed: Decides the order in which candidates are shown.
    """

    annotator: Annotator
    contest: Contest
    candidates: Candidates
    boxes: Boxes
    rotations: Rotations
    symmetry: Callable[[Label], SymmetryGroup | None] = lambda label: None
    seed: int = 0

    def outcome(self, label: Label) -> Outcome:
        """Take one photo all the way.

        Raises:
            DependencyError: weights or programs are missing.
        """
        names = self.contest.names
        try:
            with _at("photo", label):
                photo, labelled = object_in_photo(label)
            with _at("detection", label):
                box = self.boxes(label, photo, labelled)
            with _at("gallery", label):
                cads = tuple(self.candidates(label))
        except _StopError as stop:
            return Outcome(label, dict.fromkeys(names, stop.rejection))
        shown = shuffled(cads, label, self.seed)
        answers: dict[str, Ranking | Rejection] = {}
        rotation = None
        if self.contest.measures:
            try:
                with _at("pose", label):
                    rotation = self.rotations(label, photo, box, cads)
                with _at("ranking", label):
                    # A labelled mask would tell of an object that the detector had to find.
                    own = self.contest.uses_masks and box == labelled
                    mask = mask_in_photo(label, photo) if own else None
                    answers.update(
                        self.contest.at_rotation(self.annotator, photo, box, shown, rotation, mask)
                    )
            except _StopError as stop:
                answers.update(dict.fromkeys(self.contest.measures, stop.rejection))
        for name, ranker in self.contest.rankers.items():
            try:
                with _at("ranking", label):
                    answers[name] = ranker.rank(photo, box, label.category, shown)
            except _StopError as stop:
                answers[name] = stop.rejection
        error = None if rotation is None else self._error(label, rotation)
        return Outcome(label, answers, tuple(cad.id for cad in cads), box, rotation, error)

    def _error(self, label: Label, rotation: Rotation) -> float | None:
        if label.rotation is None:
            return None
        try:
            return rotation_error(label, rotation, self.symmetry(label))
        except CadposeError:  # the true model's file is damaged; what is ranked need not be
            return None


def evaluate_retrieval(
    labels: Sequence[Label],
    outcome: Callable[[Label], Outcome],
    known: Mapping[int, Outcome] | None = None,
    on_done: Callable[[int, Outcome], None] = lambda number, outcome: None,
) -> list[Outcome]:
    """One outcome a label, in order.

    Args:
        labels: What is true.
        outcome: Makes an outcome, as `RetrievalRun.outcome`.
        known: Outcomes of an earlier run by the label's number; these photos are left alone.
        on_done: Told each new outcome with its number.
    """
    known = known or {}
    results = []
    for number, label in enumerate(labels):
        if number in known:
            results.append(known[number])
            continue
        results.append(outcome(label))
        on_done(number, results[-1])
    return results


def failures(outcomes: Sequence[Outcome]) -> list[tuple[str, str]]:
    """(photo, reason) where something could not be used, each once; measured rejections are none."""
    found: dict[tuple[str, str], None] = {}
    for outcome in outcomes:
        for answer in outcome.answers.values():
            if isinstance(answer, Rejection) and not answer.measured:
                found[str(outcome.label.photo), answer.reason] = None
    return list(found)


class _StopError(Exception):
    def __init__(self, rejection: Rejection) -> None:
        super().__init__(rejection.reason)
        self.rejection = rejection


@contextmanager
def _at(stage: Stage, label: Label) -> Iterator[None]:
    """Turn what a photo may fail with into its rejection at this stage."""
    try:
        yield
    except DependencyError:
        raise
    except RejectedError as error:
        at: Stage = "review" if stage == "pose" else stage
        raise _StopError(Rejection(at, str(error), measured=True)) from error
    except CadposeError as error:
        reason = str(error)
        for name in (f"{label.photo}: ", f"{label.photo} "):
            reason = reason.removeprefix(name)
        raise _StopError(Rejection(stage, reason.replace(str(label.photo), "…"))) from error
