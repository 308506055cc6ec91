"""Whatever is changed behind the store's back is told."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from cadpose.annotations.store import Author, Store
from cadpose.records import Pose4Dof, Rotation
from tests.annotations.database.looking import ask, dump
from tests.annotations.factory import make_cad, make_document


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    """Two photos, a former answer, an edit."""
    with Store(url) as store:
        store.add_many([make_document("a.jpg"), make_document("b.jpg", annotations=1)])
        item = store.queue().items[0]
        pose = Pose4Dof(Rotation(10.0, 0.0), 90.0, (50.0, 40.0))
        store.decide(
            item.annotation_id, "edit", Author("Anna"), expected_version=None, pose=pose, cad=make_cad(9)
        )
        store.add_failure("c.jpg", None, "reading", "is no photo")
        yield store


def test_a_sound_store_has_no_problem_and_is_not_changed(store: Store, url: str) -> None:
    before = dump(url)
    assert list(store.check()) == []
    assert dump(url) == before


@pytest.mark.parametrize(
    ("statement", "where", "what"),
    [
        (
            "UPDATE photos SET name = 'z.jpg' WHERE name = 'b.jpg'",
            "photo z.jpg",
            "not the one that was written",
        ),
        ("UPDATE photos SET width = 99", "photo a.jpg", "not the one that was written"),
        ("UPDATE annotations SET document = '{}'", "photo a.jpg", "cannot be read"),
        (
            "UPDATE annotations SET azimuth = 1.5 WHERE edit IS NULL",
            "annotation",
            "azimuth is 1.5, documents",
        ),
        (
            "UPDATE annotations SET verdict = 'accept'",
            "annotation",
            "verdict is 'accept', documents and decisions",
        ),
        ("UPDATE annotations SET edit = NULL", "annotation", "edit is None"),
        ("UPDATE annotations SET in_force = false", "annotation", "in_force is False"),
        (
            "UPDATE annotations SET priority = 0.25",
            "annotation",
            "priority is 0.25, its document says 0.5625",
        ),
        ("UPDATE candidates SET score = 0.125 WHERE rank = 2", "candidates", "score is 0.125"),
        ("DELETE FROM candidates WHERE rank = 3", "candidates", "is missing"),
        ("DELETE FROM hypotheses", "hypotheses", "is missing"),
        ("UPDATE hypotheses SET needs_review = false", "hypotheses", "needs_review is False"),
        ("UPDATE detections SET box_x0 = 0", "detection", "box_x0 is 0.0"),
        ("UPDATE failures SET reason = 'another'", "failure 0 of a.jpg", "reason is 'another'"),
        ("DELETE FROM failures", "photo a.jpg", "not the one that was written"),
        ("UPDATE cads SET licence = 'CC0-1.0'", "CAD model Set/cad-0.obj", "not the one that was written"),
        ("UPDATE provenances SET document = '{}'", "provenance", "not the one that was written"),
        (
            "UPDATE decisions SET author = 'Eve' WHERE kind = 'human'",
            "decision",
            "not the one that was written",
        ),
        ("DELETE FROM decisions WHERE kind = 'human'", "annotation", "documents and decisions say"),
        (
            "UPDATE decisions SET cad_after = cad_before",
            "CAD model Set/cad-9.obj",
            "no annotation speaks of it",
        ),
        (
            "INSERT INTO provenances VALUES ('x', '1', '', '{}')",
            "provenance x",
            "no annotation speaks of it",
        ),
    ],
)
def test_damage_is_told(store: Store, url: str, statement: str, where: str, what: str) -> None:
    if "cad_after = cad_before" in statement:
        ask(url, "UPDATE annotations SET cad_key = (SELECT min(cad_key) FROM candidates)")
    ask(url, statement)
    told = list(store.check())
    assert any(problem.where.startswith(where) and what in problem.what for problem in told), told
    assert not any("\n" in str(problem) for problem in told)


def test_a_page_of_the_file_that_is_damaged_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with Store(f"sqlite:///{path}") as store:
        store.add(make_document())
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        (page,) = connection.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'ix_annotations_queue'"
        ).fetchone()
    connection.close()
    data = bytearray(path.read_bytes())
    data[(page - 1) * 4096 + 3000 : page * 4096] = bytes(1096)
    path.write_bytes(data)
    with Store(f"sqlite:///{path}") as store:
        told = list(store.check())
    assert told and told[0].where == "the file"


def test_rows_that_point_to_nothing_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with Store(f"sqlite:///{path}") as store:
        store.add(make_document())
        with sqlite3.connect(path) as connection:  # foreign keys are off unless asked for
            connection.execute("DELETE FROM detections")
        connection.close()
        told = list(store.check())
    assert told and "points to a row of detections that is not there" in told[0].what
