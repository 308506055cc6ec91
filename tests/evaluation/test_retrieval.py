"""A photo's way through a retrieval evaluation, and where it may end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.datasets.labels import Label
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.evaluation.contest import Contest, Ranking
from cadpose.evaluation.retrieval import Outcome, Rejection, RetrievalRun, evaluate_retrieval, failures
from cadpose.evaluation.retrieval_inputs import (
    RejectedError,
    labelled_box,
    library_candidates,
    predicted_rotation,
    true_rotation,
)
from cadpose.geometry.boxes import Box
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import CadModel, Candidate, Mask, Photo, Rotation
from tests.batch.fakes import FakeSimilarity, fake_annotator
from tests.evaluation.retrieving import label, outcome, rejected
from tests.small_library import save

HATCH = "made/car/hatch.obj"


class Joint:
    """Finds the hatch, wherever it stands."""

    name = "joint"

    def __init__(self, error: Exception | None = None) -> None:
        self.error = error
        self.shown: list[list[str]] = []

    def rank(self, photo: Photo, box: Box, category: str, candidates: Sequence[CadModel]) -> Ranking:
        self.shown.append([cad.id for cad in candidates])
        if self.error:
            raise self.error
        ordered = sorted(candidates, key=lambda cad: cad.id != HATCH)
        return Ranking(tuple(Candidate(cad, -float(i), Rotation(5, 5)) for i, cad in enumerate(ordered)), 0.8)


@pytest.fixture
def annotator(small_library: Library) -> Annotator:
    return fake_annotator(small_library)


@pytest.fixture
def one(tmp_path: Path) -> Label:
    path = save(tmp_path / "a.png", np.full((60, 80, 3), 90, np.uint8))
    return Label(path, "car", Box(10, 10, 60, 50), HATCH, azimuth=80.0, elevation=5.0)


def run_of(annotator: Annotator, contest: Contest, **changes: Any) -> RetrievalRun:
    stages: dict[str, Any] = {
        "candidates": library_candidates(annotator.library, 10),
        "boxes": labelled_box,
        "rotations": true_rotation,
    }
    return RetrievalRun(annotator, contest, **(stages | changes))


def raising(error: Exception) -> Any:
    def raise_it(*_: object) -> Any:
        raise error

    return raise_it


def test_measures_and_rankers_answer_for_one_photo(annotator: Annotator, one: Label) -> None:
    joint = Joint()
    run = run_of(annotator, Contest({"fake": FakeSimilarity()}, {"joint": joint}))
    found = run.outcome(one)
    assert set(found.answers) == {"fake", "joint"} and found.place("joint") == 1
    assert sorted(found.candidates) == sorted(c.id for c in annotator.library.models("car"))
    assert (found.box, found.rotation, found.rotation_error) == (one.box, Rotation(80, 5), 0.0)
    # The measure ranks the last one first: the order shown decides.
    answer = found.answers["fake"]
    assert isinstance(answer, Ranking) and answer.candidates[0].cad.id == joint.shown[0][-1]
    assert answer.candidates[0].rotation == Rotation(80, 5)


def test_equal_scores_favour_nobody(annotator: Annotator, one: Label, tmp_path: Path) -> None:
    class Indifferent(FakeSimilarity):
        def score(self, *args: Any, **kwargs: Any) -> Any:
            return np.zeros(len(args[2]))

    run = run_of(annotator, Contest({"none": Indifferent()}))
    rgb = np.full((60, 80, 3), 90, np.uint8)
    places = [
        run.outcome(Label(save(tmp_path / f"{i}.png", rgb), "car", None, HATCH, 1.0, 1.0)).place("none")
        for i in range(24)
    ]
    assert {places.count(k) > 1 for k in (1, 2, 3)} == {True}


def test_the_rotation_error_is_modulo_the_true_models_symmetry(annotator: Annotator, one: Label) -> None:
    contest = Contest({"fake": FakeSimilarity()})
    run = run_of(annotator, contest, rotations=predicted_rotation(annotator))
    plain = run.outcome(one).rotation_error
    assert plain == pytest.approx(one.rotation.error_to(Rotation(35, 12)) if one.rotation else 0)
    half = run_of(
        annotator,
        contest,
        rotations=lambda *_: Rotation(260, 5),
        symmetry=lambda _: SymmetryGroup.cyclic(2),
    )
    assert half.outcome(one).rotation_error == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    ("changes", "stage", "reason"),
    [
        ({"boxes": raising(RejectedError("nothing there"))}, "detection", "nothing there"),
        ({"candidates": raising(InputError("no model"))}, "gallery", "no model"),
        ({"rotations": raising(InputError("no rotation"))}, "pose", "no rotation"),
        ({"rotations": raising(RejectedError("flagged"))}, "review", "flagged"),
    ],
)
def test_where_a_photo_may_end(
    annotator: Annotator, one: Label, changes: dict[str, Any], stage: str, reason: str
) -> None:
    joint = Joint()
    found = run_of(annotator, Contest({"fake": FakeSimilarity()}, {"joint": joint}), **changes).outcome(one)
    answer = found.answers["fake"]
    assert isinstance(answer, Rejection) and (answer.stage, answer.reason) == (stage, reason)
    assert found.place("fake") is None
    # A ranker that sees to the rotation itself does not mind that none was estimated.
    assert isinstance(found.answers["joint"], Ranking) == (stage in ("pose", "review"))


def test_a_photo_that_is_not_there_and_a_ranker_that_fails(annotator: Annotator, one: Label) -> None:
    run = run_of(
        annotator, Contest({"fake": FakeSimilarity()}, {"joint": Joint(InputError(f"{one.photo}: dark"))})
    )
    found = run.outcome(one)
    assert found.answers["joint"] == Rejection("ranking", "dark") and found.place("fake") is not None
    gone = run.outcome(Label(one.photo.parent / "gone.png", "car", None, HATCH))
    (answer,) = set(gone.answers.values())
    assert isinstance(answer, Rejection) and answer.stage == "photo" and "gone.png" not in answer.reason
    assert failures([found, gone]) == [
        (str(one.photo), "dark"), (str(one.photo.parent / "gone.png"), answer.reason),
    ]  # fmt: skip


def test_missing_weights_and_bugs_are_not_a_photos_failure(annotator: Annotator, one: Label) -> None:
    for error in (DependencyError("no weights"), ZeroDivisionError()):
        with pytest.raises(type(error)):
            run_of(annotator, Contest(rankers={"joint": Joint(error)})).outcome(one)


def test_measured_rejections_are_no_failures() -> None:
    outcomes = [rejected("detection"), rejected("review"), rejected("pose", "no rotation"), outcome(1)]
    assert failures(outcomes) == [(str(Path("photos") / "a.png"), "no rotation")]


def test_a_labelled_mask_goes_with_the_labelled_box(annotator: Annotator, one: Label) -> None:
    seen: list[Mask] = []

    class Watching(FakeSimilarity):
        def score(self, crop: Any, mask: Any, views: Any, **more: Any) -> Any:
            seen.append(mask)
            return super().score(crop, mask, views)

    white = np.zeros((60, 80, 3), np.uint8)
    white[30:, :] = 255
    masked = replace(one, mask=save(one.photo.with_name("mask.png"), white))
    contest = Contest({"watching": Watching()})
    run_of(annotator, contest).outcome(masked)
    run_of(annotator, contest).outcome(one)
    run_of(annotator, contest, boxes=lambda *_: Box(11, 10, 60, 50)).outcome(masked)
    # Half of the box, and twice what is found there: all of it.
    assert [bool(mask[60].any()) for mask in seen] == [False, True, True]
    assert all(mask[150].any() for mask in seen)


def test_a_detector_that_fails_is_a_failure(annotator: Annotator, one: Label) -> None:
    contest = Contest({"fake": FakeSimilarity()})
    broken = run_of(annotator, contest, boxes=raising(CadposeError("the network is broken"))).outcome(one)
    missed = run_of(annotator, contest, boxes=raising(RejectedError("nothing there"))).outcome(one)
    assert broken.answers["fake"] == Rejection("detection", "the network is broken", measured=False)
    assert missed.answers["fake"] == Rejection("detection", "nothing there", measured=True)
    assert failures([missed, broken]) == [(str(one.photo), "the network is broken")]


def test_known_outcomes_are_not_made_again() -> None:
    labels = [label("a"), label("b"), label("c")]
    made: list[str | None] = []
    told: list[int] = []

    def make(one: Label) -> Outcome:
        made.append(one.cad)
        return outcome(1, cad=str(one.cad))

    kept = outcome(2, cad="b")
    found = evaluate_retrieval(labels, make, {1: kept}, lambda number, _: told.append(number))
    assert made == ["a", "c"] and told == [0, 2]
    assert found[1] is kept and [one.label.cad for one in found] == ["a", "b", "c"]
