from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from cadpose.annotations.document import document_from
from cadpose.annotations.store import Store
from cadpose.errors import CadposeError
from cadpose.records import Candidate, Detection, Rotation
from tests.annotations.factory import make_annotation, make_cad, make_document, make_photo

ROOT = Path(__file__).parents[2]


def url(folder: Path) -> str:
    return f"sqlite:///{folder / 'runs' / 'photos.db'}"


def counts(path: Path) -> dict[str, int]:
    with sqlite3.connect(path) as connection:
        tables = ("photos", "annotations", "candidates", "hypotheses", "failures")
        return {t: connection.execute(f"SELECT count(*) FROM {t}").fetchone()[0] for t in tables}


def test_documents_come_back_exactly(tmp_path: Path) -> None:
    first, second = make_document("b.jpg"), make_document("a.jpg", annotations=0)
    with Store(url(tmp_path)) as store:
        assert store.add(first)
        assert store.add(second)
    with Store(url(tmp_path)) as store:
        assert [photo.name for photo in store.photos()] == ["a.jpg", "b.jpg"]
        assert store.photos()[1].width == 120
        for document in (first, second):
            again = store.document(document.photo.sha256)
            assert again == document
            assert again is not None
            assert again.to_json() == document.to_json()
        assert store.document("00" * 32) is None


def test_columns_can_be_queried(tmp_path: Path) -> None:
    document = make_document()
    with Store(url(tmp_path)) as store:
        store.add(document)
    path = tmp_path / "runs" / "photos.db"
    assert counts(path) == {"photos": 1, "annotations": 2, "candidates": 6, "hypotheses": 4, "failures": 1}
    with sqlite3.connect(path) as connection:
        row = connection.execute(
            "SELECT category, azimuth, focal_px, box_x1, mask_iou, cad_id FROM annotations ORDER BY position"
        ).fetchone()
        part = document.annotations[0]
        assert row == (
            "car", part.pose.azimuth, part.pose.focal_px, part.detection.box[2], 0.81, "Set/cad-0.obj",
        )  # fmt: skip
        ranks = connection.execute("SELECT rank, score FROM candidates ORDER BY annotation_id, rank LIMIT 3")
        assert ranks.fetchall() == [(c.rank, c.score) for c in part.candidates]
        assert connection.execute("SELECT reason FROM failures").fetchall() == [("the library has no zebra",)]
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_a_store_of_an_earlier_version_gets_the_columns_it_lacks(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "photos.db"
    with Store(url(tmp_path)) as store:
        store.add(make_document("old.jpg"))
    added = ("expected_error", "needs_review")
    chances = ("cad_probability", "none_probability", "cad_needs_review")
    with sqlite3.connect(path) as connection:
        # As it was made before: neither columns nor keys.
        for name in added:
            connection.execute(f"ALTER TABLE hypotheses DROP COLUMN {name}")
        for name in chances:
            connection.execute(f"ALTER TABLE annotations DROP COLUMN {name}")
        connection.execute("ALTER TABLE candidates DROP COLUMN probability")
        flags = ("truncated", "tiny", "unsure")
        for name in flags:
            connection.execute(f"ALTER TABLE annotations DROP COLUMN {name}")
            connection.execute(f"ALTER TABLE failures DROP COLUMN {name}")
        keys = [f"hypotheses[{i}].{name}" for i in range(2) for name in added]
        keys += [f"detection.{name}" for name in flags]
        keys += [*chances[1:], *(f"candidates[{i}].probability" for i in range(3))]
        gone = ", ".join(f"'$.{key}'" for key in keys)
        connection.execute(f"UPDATE annotations SET document = json_remove(document, {gone})")
        connection.execute("UPDATE photos SET content_sha256 = 'of the document without them'")
    with Store(url(tmp_path)) as store:
        (old,) = store.photos()
        document = store.document(old.sha256)
        assert document is not None
        assert {h.expected_error for a in document.annotations for h in a.hypotheses} == {None}
        new = make_document("new.jpg", annotations=1)
        assert store.add(new)
        assert store.document(new.photo.sha256) == new
    with sqlite3.connect(path) as connection:
        rows = connection.execute(
            "SELECT expected_error, needs_review, count(*) FROM hypotheses GROUP BY 1, 2 ORDER BY 1"
        ).fetchall()
        assert rows == [(None, 0, 5), (24.5, 1, 1)]
        rows = connection.execute(
            f"SELECT {', '.join(chances)} FROM annotations ORDER BY 1, position"
        ).fetchall()
        assert rows == [(None, None, 0)] * 2 + [(0.5, 0.3125, 1)]
        rows = [
            connection.execute(
                f"SELECT {', '.join(flags)} FROM {table} JOIN photos ON sha256 = photo_sha256 "
                "ORDER BY name DESC"
            ).fetchall()
            for table in ("annotations", "failures")
        ]
        assert rows == [[(0, 0, 0)] * 2 + [(1, 0, 1)], [(0, 0, 0), (0, 1, 0)]]
        before = "\n".join(connection.iterdump())
    # Once is enough: opening it again changes nothing, and the same photo's new answer replaces the old one.
    with Store(url(tmp_path)) as store, sqlite3.connect(path) as connection:
        assert "\n".join(connection.iterdump()) == before
        assert store.add(make_document("old.jpg"))
        assert connection.execute("SELECT sum(needs_review) FROM hypotheses").fetchone() == (3,)


def test_the_same_run_again_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "photos.db"
    photo = make_photo()
    slow, fast = (
        document_from(photo, [make_annotation(photo, seconds={"rotation": seconds})])
        for seconds in (2.0, 1.0)
    )
    with Store(url(tmp_path)) as store:
        assert store.add(slow)
        with sqlite3.connect(path) as connection:
            before = "\n".join(connection.iterdump())
        assert not store.add(fast)
        with sqlite3.connect(path) as connection:
            assert "\n".join(connection.iterdump()) == before


def test_a_new_answer_replaces_the_old_one_wholly(tmp_path: Path) -> None:
    with Store(url(tmp_path)) as store:
        store.add(make_document("a.jpg"))
        store.add(make_document("b.jpg"))
        shorter = make_document("a.jpg", annotations=1)
        assert store.add(shorter)
        assert store.document(shorter.photo.sha256) == shorter
    assert counts(tmp_path / "runs" / "photos.db") == {
        "photos": 2, "annotations": 3, "candidates": 9, "hypotheses": 6, "failures": 2,
    }  # fmt: skip


def test_annotations_are_found_by_category_and_cad() -> None:
    store = Store("sqlite://")
    photo = make_photo()
    detection = make_annotation(photo).detection
    annotations = [
        make_annotation(photo),
        make_annotation(photo, detection=Detection(detection.box, "bus")),
        make_annotation(photo, candidates=(Candidate(make_cad(7), 1.0, Rotation(0.0, 0.0)),)),
    ]
    store.add(document_from(photo, annotations))
    assert [a.detection.category for a in store.annotations()] == ["car", "bus", "car"]
    assert [a.cad.id for a in store.annotations(category="car")] == ["Set/cad-0.obj", "Set/cad-7.obj"]
    assert len(store.annotations(category="car", cad_id="Set/cad-7.obj")) == 1
    assert store.annotations(category="x' OR '1'='1") == []
    assert store.annotations()[0].photo_name == photo.name


def test_a_failed_write_keeps_the_former_document(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "photos.db"
    with Store(url(tmp_path)) as store:
        before = make_document(annotations=1)
        store.add(before)
        with sqlite3.connect(path) as connection:
            connection.execute(
                "CREATE TRIGGER full BEFORE INSERT ON failures BEGIN SELECT RAISE(ABORT, 'disk is full'); END"
            )
        with pytest.raises(CadposeError, match=r"cannot write the store .*photos\.db: disk is full"):
            store.add(make_document(annotations=3))
        assert store.document(before.photo.sha256) == before


WRITER = """
import os, signal, sys
import sqlalchemy as sa
from cadpose.annotations.store import Store
from tests.annotations.factory import make_document

url, table, photo = sys.argv[1], sys.argv[2], int(sys.argv[3])
store = Store(url)
writing = 0

@sa.event.listens_for(sa.Engine, "after_cursor_execute")
def die(connection, cursor, statement, *rest):
    if writing == photo and statement.startswith((f"INSERT INTO {table} ", f"DELETE FROM {table} ")):
        os.kill(os.getpid(), signal.SIGKILL)

for writing in range(5):
    store.add(make_document(f"{writing}.jpg", annotations=3))
"""


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.parametrize("table", ["photos", "candidates", "failures"])
def test_a_killed_writer_leaves_only_whole_photos(tmp_path: Path, table: str) -> None:
    # Photo 1 is there before, with another answer: its replacement dies half-way.
    old = make_document("1.jpg", annotations=1)
    with Store(url(tmp_path)) as store:
        store.add(old)
    killed = subprocess.run(
        [sys.executable, "-c", WRITER, url(tmp_path), table, "1"],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}, check=False,
    )  # fmt: skip
    assert killed.returncode == -signal.SIGKILL
    with sqlite3.connect(tmp_path / "runs" / "photos.db") as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
    with Store(url(tmp_path)) as store:
        assert [photo.name for photo in store.photos()] == ["0.jpg", "1.jpg"]
        whole = make_document("0.jpg", annotations=3)
        assert store.document(whole.photo.sha256) == whole
        assert store.document(old.photo.sha256) == old


def test_several_writers_take_turns(tmp_path: Path) -> None:
    errors: list[Exception] = []

    def write(worker: int) -> None:
        try:
            with Store(url(tmp_path)) as store:
                for i in range(8):
                    store.add(make_document(f"{i % 4}.jpg", annotations=1 + worker))
        except Exception as error:
            errors.append(error)

    workers = [threading.Thread(target=write, args=(worker,)) for worker in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert errors == []
    with Store(url(tmp_path)) as store:
        assert len(store.photos()) == 4


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ("photos.db", "is not a database URL"),
        ("", "is not a database URL"),
        ("postgresql://host/db", "cannot be a postgresql database"),
        ("sqlite+aiosqlite:///x.db", "cannot be a sqlite"),
        ("nonsense://x", "cannot be a nonsense database"),
    ],
)
def test_a_bad_url_gives_one_sentence(bad: str, message: str) -> None:
    with pytest.raises(CadposeError, match=message) as caught:
        Store(bad)
    assert "sqlite:///file.db" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_database_gives_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    path.write_bytes(b"not a database, but long enough to be looked at" * 30)
    with pytest.raises(CadposeError, match=r"cannot open the store .*x\.db: file is not a database; choose"):
        Store(f"sqlite:///{path}")


def test_a_place_that_cannot_be_written_gives_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.db").mkdir()
    for place, what in (("file/x.db", "make the folder"), ("folder.db", "open the store")):
        with pytest.raises(CadposeError, match=f"cannot {what}") as caught:
            Store(f"sqlite:///{tmp_path / place}")
        assert "\n" not in str(caught.value)


def test_a_tampered_document_gives_one_sentence(tmp_path: Path) -> None:
    document = make_document()
    with Store(url(tmp_path)) as store:
        store.add(document)
        with sqlite3.connect(tmp_path / "runs" / "photos.db") as connection:
            connection.execute("UPDATE annotations SET document = '{}'")
        for read in (lambda: store.document(document.photo.sha256), store.annotations):
            with pytest.raises(CadposeError, match="cannot read the store"):
                read()
