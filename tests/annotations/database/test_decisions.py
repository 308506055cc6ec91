from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cadpose.annotations.database import deciding
from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.store import TRUSTED, Author, ConflictError, Region, Selection, Store
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Pose4Dof, Rotation
from tests.annotations.database.looking import dump
from tests.annotations.factory import make_annotation, make_cad, make_document, make_photo

ANNA, BEN = Author("Anna", tool="cadpose review", tool_version="0.1.0"), Author("Ben")
PROGRAM = Author("sorter", "program")
POSE = Pose4Dof(Rotation(45.0, 5.0, 1.0), 150.0, (60.0, 40.0))


def key(store: Store, position: int = 0) -> str:
    return store.queue().items[position].annotation_id


def one(store: Store) -> tuple[str, int]:
    item = store.queue().items[0]
    return item.annotation_id, item.version


def rerun(name: str = "a.jpg", azimuth: float = 200.0, box: Box | None = None) -> AnnotationDocument:
    """Another run of the same photo, with another rotation."""
    photo = make_photo(name)
    box = box or Box(6.0, 4.0, 61.0, 50.5)
    pose = Pose4Dof(Rotation(azimuth, 8.0), 100.0, box.centre)
    return document_from(photo, [make_annotation(photo, box=box, pose=pose, verdict=None)])


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    with Store(url) as store:
        store.add(make_document("a.jpg", annotations=1))
        yield store


def test_a_decision_is_kept_with_who_when_and_why(store: Store) -> None:
    annotation, version = one(store)
    now = datetime.now(UTC)
    after = store.decide(
        annotation, "reject", ANNA, expected_version=version, reason="wrong front", note="it is a van"
    )
    assert after == version + 1
    machine, decision = store.history(annotation)
    assert (machine.author.kind, machine.author.name, machine.verdict) == ("program", "cadpose", "review")
    assert machine.author.tool_version == "0.1.0"
    assert decision.author == ANNA and decision.verdict == "reject" and decision.annotation_id == annotation
    assert (decision.reason, decision.note) == ("wrong front", "it is a van")
    assert abs(decision.decided_at - now) < timedelta(minutes=5)
    assert decision.pose_before == store.annotations()[0].pose and decision.pose_after is None
    assert decision.cad_before == make_cad(0) and decision.cad_after is None
    (item,) = store.queue(Selection(verdicts=("reject",))).items
    assert (item.verdict, item.machine_verdict, item.decided_by, item.version) == (
        "reject", "review", "human", after,
    )  # fmt: skip
    assert store.count(Selection(verdicts=TRUSTED)) == 0
    assert list(store.check()) == []


def test_an_edit_is_what_lists_and_exports_give(store: Store) -> None:
    annotation, version = one(store)
    machine = store.annotations()[0]
    store.decide(
        annotation, "edit", ANNA, expected_version=version, pose=POSE, cad=make_cad(7),
        measures={"box_iou": 0.5, "mask_iou": 0.25},
    )  # fmt: skip
    (now,) = store.annotations(cad_id="Set/cad-7.obj")
    assert now.pose == POSE and now.cad == make_cad(7) and (now.box_iou, now.mask_iou) == (0.5, 0.25)
    assert [c.cad.id for c in now.candidates][1:] == [c.cad.id for c in machine.candidates]
    assert now.confidence is None and now.verdict is None and now.refinement is None and not now.needs_review
    assert now.provenance["edited"]["by"] == "Anna" and now.provenance["edited"]["kind"] == "human"
    # The real camera's pose follows, in the new model's own metres.
    assert now.pose_6dof is not None and machine.pose_6dof is not None
    assert now.pose_6dof.camera == machine.pose_6dof.camera
    assert np.isclose(now.pose_6dof.to_4dof().rotation.azimuth, 45.0)
    assert np.isclose(now.pose_6dof.diagonal_m or 0.0, np.linalg.norm((1.705, 4.2, 1.5025)))
    # The machine's answer is still there.
    (original,) = store.annotations(original=True)
    assert original.pose == machine.pose and original.cad == machine.cad
    document = store.document(machine.photo_sha256)
    assert document is not None and document.annotations[0].pose.pose() == POSE
    assert store.document(machine.photo_sha256, original=True) == make_document("a.jpg", annotations=1)
    # A second person accepts the edit, a third one edits the pose alone.
    store.decide(annotation, "accept", BEN, expected_version=None)
    assert store.annotations()[0].pose == POSE and store.queue().items[0].verdict == "accept"
    turned = replace(POSE, rotation=Rotation(50.0, 5.0, 1.0))
    store.decide(annotation, "edit", ANNA, expected_version=None, pose=turned)
    (last,) = store.annotations()
    assert last.pose == turned and last.cad == make_cad(7) and last.mask_iou is None
    edit = store.history(annotation)[1]
    assert edit.pose_before == machine.pose and edit.pose_after == POSE
    assert edit.cad_before == machine.cad and edit.cad_after == make_cad(7)
    assert edit.measures == {"box_iou": 0.5, "mask_iou": 0.25}
    assert store.stats()["totals"]["edited annotations"] == 1
    assert store.stats()["decisions_by"] == {"human Anna": 2, "human Ben": 1, "program cadpose": 1}
    assert list(store.check()) == []


def test_a_candidate_that_is_chosen_keeps_its_measures(store: Store) -> None:
    annotation, version = one(store)
    store.decide(annotation, "edit", ANNA, expected_version=version, cad=make_cad(2))
    (now,) = store.annotations()
    assert [c.cad.id for c in now.candidates] == [f"Set/cad-{i}.obj" for i in (2, 0, 1)]
    assert now.candidates[0].measures["sm2"] == pytest.approx(1 / 3)
    assert now.pose == store.annotations(original=True)[0].pose


def test_a_box_and_mask_that_a_person_drew_hold(store: Store) -> None:
    annotation, version = one(store)
    machine = store.annotations()[0]
    width, height = machine.photo_size
    mask = np.zeros((height, width), bool)
    mask[3:9, 2:12] = True
    region = Region(Box(2.0, 3.0, 12.0, 9.0), mask)
    store.decide(annotation, "edit", ANNA, expected_version=version, region=region, measures={"box_iou": 0.4})
    (now,) = store.annotations()
    assert now.detection.box == region.box and now.detection.mask is not None
    assert np.array_equal(now.detection.mask, mask)
    # A small box is told as such, whatever the machine's was.
    assert now.detection.tiny and not machine.detection.tiny
    assert now.pose == machine.pose and now.cad == machine.cad and now.mask_iou is None
    assert store.history(annotation)[1].region_after is not None
    document = store.document(machine.photo_sha256)
    assert document is not None and document.annotations[0].detection.box == (2.0, 3.0, 12.0, 9.0)
    # Without a mask there is none, not the machine's.
    store.decide(annotation, "edit", BEN, expected_version=None, region=Region(Box(1.0, 1.0, 50.0, 40.0)))
    assert store.annotations()[0].detection.mask is None
    (original,) = store.annotations(original=True)
    assert original.detection.box == machine.detection.box
    assert list(store.check()) == []


def test_a_region_that_does_not_fit_is_refused(store: Store) -> None:
    annotation, version = one(store)
    for region, word in (
        (Region(Box(900.0, 900.0, 950.0, 950.0)), "outside"),
        (Region(Box(1.0, 1.0, 9.0, 9.0), np.ones((3, 5), bool)), "5 x 3"),
    ):
        with pytest.raises(InputError, match=word):
            store.decide(annotation, "edit", ANNA, expected_version=version, region=region)
    with pytest.raises(InputError, match="no other verdict takes one"):
        store.decide(annotation, "accept", ANNA, expected_version=version, region=Region(Box(1, 1, 9, 9)))
    with pytest.raises(ValueError, match="no pixel"):
        Region(Box(1, 1, 9, 9), np.zeros((3, 5), bool))
    assert len(store.history(annotation)) == 1


def test_two_reviewers_do_not_overwrite_each_other(store: Store) -> None:
    annotation, version = one(store)
    store.decide(annotation, "accept", ANNA, expected_version=version)
    with pytest.raises(
        ConflictError, match=r"changed meanwhile, last by Anna \(accept\): load it again"
    ) as told:
        store.decide(annotation, "reject", BEN, expected_version=version)
    assert "\n" not in str(told.value)
    assert store.queue().items[0].verdict == "accept" and len(store.history(annotation)) == 2
    assert store.decide(annotation, "reject", BEN, expected_version=version + 1) == version + 2


def test_a_program_does_not_overrule_a_person(store: Store) -> None:
    annotation, version = one(store)
    store.decide(annotation, "auto_accept", PROGRAM, expected_version=version)
    assert store.queue().items[0].verdict == "auto_accept"
    store.decide(annotation, "reject", ANNA, expected_version=None)
    with pytest.raises(ConflictError, match=r"a person has decided on annotation .* sorter leaves it"):
        store.decide(annotation, "auto_accept", PROGRAM, expected_version=None)
    assert store.queue().items[0].verdict == "reject"


def test_a_skip_says_nothing_against_what_was_decided(store: Store) -> None:
    annotation, _ = one(store)
    store.decide(annotation, "skip", ANNA, expected_version=None)
    (item,) = store.queue().items
    assert (item.verdict, item.decided_by) == ("review", "program")
    # A skip locks nobody out.
    store.decide(annotation, "auto_accept", PROGRAM, expected_version=None)
    assert store.queue().items[0].verdict == "auto_accept"
    store.decide(annotation, "accept", BEN, expected_version=None)
    store.decide(annotation, "skip", ANNA, expected_version=None)
    assert store.queue().items[0].verdict == "accept" and len(store.history(annotation)) == 5


def test_a_skip_alone_decides_nothing(store: Store) -> None:
    store.add(rerun())  # the program gave no verdict
    annotation, _ = one(store)
    for author in (ANNA, PROGRAM):
        store.decide(annotation, "skip", author, expected_version=None)
    (item,) = store.queue(Selection(verdicts=("undecided",))).items
    assert (item.verdict, item.decided_by) == (None, None) and list(store.check()) == []


def test_what_is_said_later_counts_later_whatever_the_clock(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    annotation, _ = one(store)
    store.decide(annotation, "accept", ANNA, expected_version=None)

    class Slow:
        @staticmethod
        def now(_: object) -> datetime:
            return datetime(2020, 1, 1, tzinfo=UTC)

    monkeypatch.setattr(deciding, "datetime", Slow)
    store.decide(annotation, "reject", BEN, expected_version=None)
    assert [d.verdict for d in store.history(annotation)] == ["review", "accept", "reject"]
    assert store.queue().items[0].verdict == "reject"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"verdict": "perfect"}, "a verdict is one of"),
        ({"verdict": "edit"}, "needs a pose, a CAD model or a region"),
        ({"verdict": "accept", "pose": POSE}, "no other verdict takes one"),
        ({"annotation_id": "ff" * 32}, "holds no annotation ffff"),
    ],
)
def test_decisions_that_make_no_sense(store: Store, change: dict[str, object], message: str) -> None:
    annotation, version = one(store)
    told = {"annotation_id": annotation, "verdict": "accept", "author": ANNA, "expected_version": version}
    with pytest.raises(InputError, match=message):
        store.decide(**(told | change))  # type: ignore[arg-type]
    assert store.queue().items[0].version == version


def test_an_author_needs_a_name() -> None:
    with pytest.raises(ValueError, match="name"):
        Author(" ")
    with pytest.raises(ValueError, match="human or program"):
        Author("x", "robot")  # type: ignore[arg-type]


# -- a person's work outlives another run ----------------------------------------------------------


@pytest.mark.parametrize("verdict", ["accept", "edit"])
def test_what_a_person_settled_holds_after_another_run(store: Store, url: str, verdict: str) -> None:
    annotation, version = one(store)
    pose = POSE if verdict == "edit" else None
    store.decide(annotation, verdict, ANNA, expected_version=version, pose=pose)  # type: ignore[arg-type]
    settled = store.annotations()[0]
    document = rerun()
    assert store.add(document)
    # The person's answer holds, the machine's new one is there and stands back.
    (item,) = store.queue().items
    assert (item.annotation_id, item.verdict, item.decided_by) == (annotation, verdict, "human")
    assert store.annotations()[0].pose == settled.pose
    (behind,) = store.former(document.photo.sha256)
    assert behind.annotation.pose == document.annotations[0].pose.pose()
    assert store.document(document.photo.sha256, original=True) == document
    assert len(store.history(annotation)) == 2
    before = dump(url)
    assert not store.add(document)
    assert dump(url) == before
    # Nobody decides on an answer that does not hold.
    with pytest.raises(ConflictError, match="is history"):
        store.decide(behind.item.annotation_id, "accept", BEN, expected_version=None)
    # Sent back to review, it stands back itself.
    store.decide(annotation, "review", BEN, expected_version=None)
    (item,) = store.queue().items
    assert item.annotation_id == behind.item.annotation_id
    assert list(store.check()) == []


def test_what_a_person_accepted_holds_where_another_run_finds_nothing(store: Store) -> None:
    annotation, version = one(store)
    store.decide(annotation, "accept", ANNA, expected_version=version)
    store.add(rerun(box=Box(90.0, 60.0, 118.0, 78.0)))
    assert store.count() == 2 and store.count(Selection(decided_by="human")) == 1
    store.add(document_from(make_photo("a.jpg"), []))
    assert [item.annotation_id for item in store.queue().items] == [annotation]
    assert list(store.check()) == []


def test_a_rejected_answer_is_rejected_again_and_another_one_is_not(store: Store) -> None:
    annotation, version = one(store)
    store.decide(annotation, "reject", ANNA, expected_version=version)
    store.add(rerun(azimuth=312.4 + 4.0))
    (item,) = store.queue().items
    assert (item.annotation_id, item.verdict) == (annotation, "reject")
    store.add(rerun(azimuth=120.0))
    (item,) = store.queue().items
    assert item.annotation_id != annotation and item.verdict is None
    assert len(store.history(annotation)) == 2
    assert list(store.check()) == []


def test_what_nobody_settled_gives_way(store: Store) -> None:
    annotation, version = one(store)
    store.decide(annotation, "auto_accept", PROGRAM, expected_version=version)
    store.decide(annotation, "skip", ANNA, expected_version=None)
    store.add(rerun())
    (item,) = store.queue().items
    assert item.annotation_id != annotation
    assert [f.item.annotation_id for f in store.former(item.photo_sha256)] == [annotation]
    with pytest.raises(ConflictError):
        store.decide(annotation, "accept", BEN, expected_version=3)


def test_a_reviewer_who_looks_while_another_run_is_written_is_told(store: Store) -> None:
    annotation, version = one(store)
    store.add(rerun())
    with pytest.raises(ConflictError, match="another answer holds in its place"):
        store.decide(annotation, "accept", ANNA, expected_version=version)
