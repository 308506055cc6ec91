from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cadpose.annotations.store import Author, Selection, Store
from cadpose.errors import CadposeError, InputError
from cadpose.records import Pose4Dof, Rotation
from tests.annotations.database.looking import dump
from tests.annotations.database.test_decisions import rerun
from tests.annotations.factory import make_cad, make_document

ANNA, BEN = Author("Anna"), Author("Ben")
POSE = Pose4Dof(Rotation(45.0, 5.0, 1.0), 150.0, (60.0, 40.0))


@pytest.fixture
def target(url: str) -> Iterator[Store]:
    with Store(url) as store:
        yield store


@pytest.fixture
def source(tmp_path: Path) -> Iterator[Store]:
    with Store(f"sqlite:///{tmp_path / 'other.db'}") as store:
        yield store


def test_everything_comes_along_once(target: Store, source: Store, url: str) -> None:
    target.add(make_document("a.jpg"))
    source.add_many([make_document("b.jpg"), make_document("c.jpg", annotations=1)])
    first = source.queue().items[0]
    source.decide(first.annotation_id, "edit", ANNA, expected_version=None, pose=POSE, cad=make_cad(9))
    source.add(rerun("c.jpg"))
    source.add_failure("broken.jpg", None, "reading", "is no photo")
    report = target.merge(source)
    assert (report.photos, report.annotations, report.conflicts) == (2, 4, [])
    assert [d.photo.name for d in target.iter_documents()] == ["a.jpg", "b.jpg", "c.jpg"]
    for document in source.iter_documents():
        assert target.document(document.photo.sha256) == document
    assert target.history(first.annotation_id) == source.history(first.annotation_id)
    assert [f.name for f in target.photo_failures()] == ["broken.jpg"]
    assert len(target.former(make_document("c.jpg").photo.sha256)) == 1
    assert list(target.check()) == []
    before = dump(url)
    again = target.merge(source)
    assert (again.photos, again.annotations, again.decisions, again.conflicts) == (0, 0, 0, [])
    assert dump(url) == before


def test_people_who_decided_in_both_stores_are_both_kept(target: Store, source: Store) -> None:
    for store in (target, source):
        store.add(make_document("a.jpg", annotations=1))
    annotation = target.queue().items[0].annotation_id
    target.decide(annotation, "accept", ANNA, expected_version=None)
    source.decide(annotation, "reject", BEN, expected_version=None)
    version = target.queue().items[0].version
    report = target.merge(source)
    (conflict,) = report.conflicts
    assert "decided by people in both stores (accept here, reject by Ben there)" in conflict
    assert "reject is the later one and holds" in conflict and "a.jpg" in conflict
    (item,) = target.queue().items
    # Whoever looked at it before the merge is told when he decides.
    assert item.verdict == "reject" and item.version > version
    assert [d.author.name for d in target.history(annotation)] == ["cadpose", "Anna", "Ben"]
    # The other way round it comes to the same.
    source.merge(target)
    assert source.queue().items[0].verdict == "reject"
    assert [d.id for d in source.history(annotation)] == [d.id for d in target.history(annotation)]
    assert target.merge(source).conflicts == []


def test_the_later_document_holds_and_the_other_is_history(target: Store, source: Store) -> None:
    old, new = make_document("a.jpg", annotations=1), rerun()
    target.add(old)
    source.add(new)
    report = target.merge(source)
    assert len(report.conflicts) == 1 and "the other store's answer is the later one" in report.conflicts[0]
    assert target.document(new.photo.sha256) == new
    assert list(target.check()) == []
    source.merge(target)
    assert source.document(new.photo.sha256) == new and len(source.former(new.photo.sha256)) == 1
    assert list(source.check()) == []


def test_what_a_person_settled_holds_against_the_other_store(target: Store, source: Store) -> None:
    target.add(make_document("a.jpg", annotations=1))
    annotation = target.queue().items[0].annotation_id
    target.decide(annotation, "accept", ANNA, expected_version=None)
    source.add(rerun())
    target.merge(source)
    (item,) = target.queue().items
    assert (item.annotation_id, item.verdict) == (annotation, "accept")
    # And so it does where people settled two different answers: the later word holds.
    other = source.queue().items[0].annotation_id
    source.decide(other, "accept", BEN, expected_version=None)
    target.merge(source)
    assert [i.annotation_id for i in target.queue().items] == [other]
    assert {f.item.annotation_id for f in target.former(item.photo_sha256)} == {annotation}
    assert target.count(Selection(decided_by="human")) == 1
    assert list(target.check()) == []


def test_a_photo_that_was_annotated_in_either_store_has_not_failed(target: Store, source: Store) -> None:
    target.add(make_document("a.jpg"))
    source.add_failure("a.jpg", None, "reading", "late disk")
    target.add_failure("b.jpg", None, "reading", "late disk")
    source.add(make_document("b.jpg"))
    target.merge(source)
    assert target.photo_failures() == []


def test_a_failed_merge_changes_nothing(
    target: Store, source: Store, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    target.add(make_document("a.jpg"))
    source.add_many([make_document("b.jpg"), make_document("c.jpg")])
    before = dump(url)
    from cadpose.annotations.database import merging

    def broken(*_: object) -> None:
        raise ValueError("power is gone")

    monkeypatch.setattr(merging, "_failures", broken)
    with pytest.raises(CadposeError, match="power is gone"):
        target.merge(source)
    assert dump(url) == before


def test_a_store_is_not_merged_into_itself(target: Store, url: str) -> None:
    with Store(url) as same, pytest.raises(InputError, match="into itself"):
        target.merge(same)
