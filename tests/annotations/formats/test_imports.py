"""Imports into a store: whose word they are, and what they say of people's decisions."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.imports import add_imported
from cadpose.annotations.store import Author, Store
from cadpose.records import Pose4Dof, Rotation
from tests.annotations.factory import make_document

TOOL = Author("cadpose", "program", "cadpose import label-studio", "9")
BEN = Author("Ben", "human", "cadpose import label-studio", "9")
ANNA = Author("Anna")


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(f"sqlite:///{tmp_path / 'a.db'}") as store:
        store.add(make_document("a.jpg", annotations=1))
        yield store


def said(document: AnnotationDocument, verdict: str) -> AnnotationDocument:
    """With another verdict."""
    (part,) = document.annotations
    return document.model_copy(update={"annotations": (part.model_copy(update={"verdict": verdict}),)})


def given(store: Store) -> AnnotationDocument:
    document = store.document(store.photos()[0].sha256)
    assert document is not None
    return document


def decide(store: Store, verdict: str, pose: Pose4Dof | None = None) -> None:
    key = store.queue().items[0].annotation_id
    store.decide(key, verdict, ANNA, expected_version=None, pose=pose)  # type: ignore[arg-type]


def test_a_program_that_imports_says_so(store: Store) -> None:
    assert add_imported(store, said(given(store), "auto_accept"), TOOL) == []
    (item,) = store.queue().items
    (decision,) = store.history(item.annotation_id)
    assert (decision.author.tool, decision.author.tool_version) == ("cadpose import label-studio", "9")
    assert (item.verdict, item.decided_by) == ("auto_accept", "program") and list(store.check()) == []


def test_a_person_who_is_named_has_decided(store: Store) -> None:
    assert add_imported(store, said(given(store), "auto_accept"), BEN) == []
    (item,) = store.queue().items
    (decision,) = store.history(item.annotation_id)
    assert decision.author == BEN and decision.verdict == "accept"
    assert (item.verdict, item.decided_by) == ("accept", "human") and list(store.check()) == []
    with Store("sqlite://") as other:  # a photo that was not there
        assert add_imported(other, said(given(store), "reject"), BEN) == []
        (item,) = other.queue().items
        assert (item.verdict, item.decided_by) == ("reject", "human") and list(other.check()) == []


def test_what_a_person_decided_before_is_told(store: Store) -> None:
    told = given(store)
    decide(store, "accept")
    sentences = add_imported(store, said(told, "reject"), TOOL)
    assert sentences == ["a.jpg, car 1: the file says otherwise, but what a person decided goes on holding"]
    assert store.queue().items[0].verdict == "accept"
    sentences = add_imported(store, said(told, "auto_accept"), BEN)
    assert sentences == ["a.jpg, car 1: a person's accept no longer holds, since the file says otherwise"]
    (item,) = store.queue().items
    assert store.history(item.annotation_id)[0].author == BEN and list(store.check()) == []


def test_what_was_left_out_overrules_nobody(store: Store) -> None:
    told = given(store)
    decide(store, "reject")
    assert add_imported(store, told.model_copy(update={"annotations": ()}), TOOL) == []
    assert store.queue().items == ()


def test_an_edited_annotation_that_comes_back_changes_nothing(store: Store) -> None:
    decide(store, "edit", Pose4Dof(Rotation(45.0, 5.0, 1.0), 150.0, (60.0, 40.0)))
    before = store.queue()
    assert add_imported(store, given(store), TOOL) is None
    assert store.queue() == before and store.former(before.items[0].photo_sha256) == []
