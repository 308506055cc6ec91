from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cadpose.annotations.database import tables as t
from cadpose.annotations.document import document_from
from cadpose.annotations.store import Selection, Store
from cadpose.errors import CadposeError, DependencyError
from cadpose.geometry.boxes import Box
from cadpose.records import Candidate, Detection, Rotation
from tests.annotations.database.looking import ask, counts, dump
from tests.annotations.factory import make_annotation, make_cad, make_document, make_photo


def test_documents_come_back_exactly(url: str) -> None:
    first, second = make_document("b.jpg"), make_document("a.jpg", annotations=0)
    with Store(url) as store:
        assert store.add(first)
        assert store.add(second)
    with Store(url) as store:
        assert [photo.name for photo in store.photos()] == ["a.jpg", "b.jpg"]
        assert store.photos()[1].width == 120
        photo = store.photos()[0]
        assert store.photos(1) == [photo] and store.photo(photo.sha256) == photo
        assert store.photo("0" * 64) is None
        for document in (first, second):
            for original in (True, False):
                again = store.document(document.photo.sha256, original=original)
                assert again == document
                assert again is not None
                assert again.to_json() == document.to_json()
        assert store.document("00" * 32) is None
        assert list(store.iter_documents()) == [second, first]
        assert list(store.check()) == []


def test_columns_can_be_queried(url: str) -> None:
    document = make_document()
    with Store(url) as store:
        store.add(document)
    held = counts(url)
    assert held == {
        "photos": 1, "annotations": 2, "candidates": 6, "hypotheses": 4, "failures": 1, "detections": 3,
        "cads": 3, "provenances": 1, "decisions": 2, "photo_failures": 0,
    }  # fmt: skip
    (row, _) = ask(
        url,
        "SELECT a.category, azimuth, focal_px, box_x1, mask_iou, cad_id, confidence, verdict, truncated, "
        "masked "
        "FROM annotations a JOIN detections d ON d.id = detection_id ORDER BY position",
    )
    part = document.annotations[0]
    assert row == (
        "car", part.pose.azimuth, part.pose.focal_px, part.detection.box[2], 0.81, "Set/cad-0.obj", 0.5625,
        "review", True, True,
    )  # fmt: skip
    ranks = ask(url, "SELECT rank, score FROM candidates ORDER BY annotation_id, rank LIMIT 3")
    assert ranks == [(c.rank, c.score) for c in part.candidates]
    assert ask(url, "SELECT reason FROM failures") == [("the library has no zebra",)]
    assert ask(url, "SELECT DISTINCT licence, creator, depth_cm FROM cads") == [
        ("CC-BY-3.0", "A. Maker", 420.0)
    ]
    assert ask(url, "SELECT tool_version, library FROM provenances") == [("0.1.0", "")]
    assert ask(url, "SELECT DISTINCT kind, author, verdict FROM decisions") == [
        ("program", "cadpose", "review")
    ]


def test_an_sqlite_file_is_written_ahead(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'a.db'}"
    Store(url).close()
    assert ask(url, "PRAGMA journal_mode") == [("wal",)]


def test_the_same_run_again_changes_nothing(url: str) -> None:
    photo = make_photo()
    slow, fast = (
        document_from(photo, [make_annotation(photo, seconds={"rotation": seconds})])
        for seconds in (2.0, 1.0)
    )
    with Store(url) as store:
        assert store.add(slow)
        before = dump(url)
        assert not store.add(fast)
        assert store.add_many([fast, slow]) == 0
    assert dump(url) == before


def test_a_new_answer_replaces_the_old_one_wholly(url: str) -> None:
    with Store(url) as store:
        store.add(make_document("a.jpg"))
        store.add(make_document("b.jpg"))
        shorter = make_document("a.jpg", annotations=1)
        assert store.add(shorter)
        assert store.document(shorter.photo.sha256) == shorter
        assert len(store.annotations()) == 3 == store.count()
        # The former answer is history.
        (former,) = store.former(shorter.photo.sha256)
        assert (former.item.position, former.item.in_force) == (1, False)
        assert list(store.check()) == []
        # The first answer again: what was history holds again, and nothing is there twice.
        first = make_document("a.jpg")
        assert store.add(first)
        assert store.document(first.photo.sha256) == first
        assert store.former(first.photo.sha256) == []
        assert list(store.check()) == []
    tables = [t.PHOTOS, t.ANNOTATIONS, t.CANDIDATES, t.HYPOTHESES, t.FAILURES]
    assert counts(url, tables) == {
        "photos": 2, "annotations": 4, "candidates": 12, "hypotheses": 8, "failures": 2,
    }  # fmt: skip


def test_a_document_that_repeats_a_part_takes_its_new_timings(url: str) -> None:
    photo = make_photo()
    one = make_annotation(photo, seconds={"rotation": 1.0})
    again = replace(one, seconds={"rotation": 9.0})
    other = make_annotation(photo, box=Box(1, 1, 30, 30))
    with Store(url) as store:
        store.add(document_from(photo, [one]))
        longer = document_from(photo, [again, other])
        assert store.add(longer)
        assert store.document(photo.sha256) == longer


def test_a_copy_under_another_name_takes_the_place_of_the_first(url: str) -> None:
    photo = make_photo("a.jpg")
    copy = replace(photo, name="b.jpg")
    with Store(url) as store:
        store.add(document_from(photo, [make_annotation(photo)]))
        store.add(document_from(copy, [make_annotation(copy)]))
        assert [photo.name for photo in store.photos()] == ["b.jpg"]
        assert [a.photo_name for a in store.annotations()] == ["b.jpg"]
        assert list(store.check()) == []


def test_annotations_are_found_by_category_and_cad(url: str) -> None:
    photo = make_photo()
    detection = make_annotation(photo).detection
    annotations = [
        make_annotation(photo),
        make_annotation(photo, detection=Detection(detection.box, "bus")),
        make_annotation(photo, candidates=(Candidate(make_cad(7), 1.0, Rotation(0.0, 0.0)),)),
    ]
    with Store(url) as store:
        store.add(document_from(photo, annotations))
        assert [a.detection.category for a in store.annotations()] == ["car", "bus", "car"]
        assert [a.cad.id for a in store.annotations(category="car")] == ["Set/cad-0.obj", "Set/cad-7.obj"]
        assert len(store.annotations(category="car", cad_id="Set/cad-7.obj")) == 1
        assert store.annotations(category="x' OR '1'='1") == []
        assert store.annotations()[0].photo_name == photo.name


def test_many_documents_are_added_in_few_transactions(url: str) -> None:
    documents = [make_document(f"{i:03}.jpg", annotations=1) for i in range(104)]
    # The same photo twice in one call: the later answer holds.
    documents.append(make_document("005.jpg", annotations=2))
    with Store(url) as store:
        assert store.add_many(iter(documents)) == 105
        assert store.add_many(documents[:104]) == 1
        assert store.add_many([]) == 0
        assert [d.photo.name for d in store.iter_documents()] == [f"{i:03}.jpg" for i in range(104)]
        assert len(list(store.iter_annotations(Selection(category="car")))) == 104
        assert list(store.iter_annotations(Selection(category="bus"))) == []


def test_a_store_in_memory() -> None:
    with Store("sqlite://") as store:
        assert store.place == "memory"
        assert store.add(make_document())
        assert len(store.annotations()) == 2 and list(store.check()) == []


# -- photos that failed ----------------------------------------------------------------------------


def test_failed_photos_are_kept_until_they_succeed(url: str) -> None:
    good = make_document("good.jpg")
    with Store(url) as store:
        store.add_failure("good.jpg", good.photo.sha256, "detection", "no memory")
        store.add_failure("bad\udcff.jpg", None, "reading", "is no photo")
        store.add_failure("good.jpg", None, "rotation", "no memory either")
        bad, again = store.photo_failures()
        assert (bad.name, bad.sha256, bad.stage, bad.attempts) == ("bad\\udcff.jpg", None, "reading", 1)
        assert (again.reason, again.attempts, again.stage) == ("no memory either", 2, "rotation")
        assert again.failed_at >= bad.failed_at and again.failed_at.tzinfo is not None
        assert store.stats()["photos_failed"] == {"reading": 1, "rotation": 1}
        store.add(good)
        assert store.photo_failures() == [bad]
        # A failure that is written late goes when the same photo is added once more.
        store.add_failure("other.jpg", good.photo.sha256, "reading", "late")
        assert not store.add(good)
        assert store.photo_failures() == [bad]


# -- what cannot be used ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ("photos.db", "is not a database URL"),
        ("", "is not a database URL"),
        ("postgresql+asyncpg://host/db", r"cannot be a postgresql\+asyncpg database"),
        ("sqlite+aiosqlite:///x.db", "cannot be a sqlite"),
        ("nonsense://x", "cannot be a nonsense database"),
    ],
)
def test_a_bad_url_gives_one_sentence(bad: str, message: str) -> None:
    with pytest.raises(CadposeError, match=message) as caught:
        Store(bad)
    assert "sqlite:///file.db" in str(caught.value) and "postgresql+psycopg://" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_server_that_does_not_answer_gives_one_sentence_without_the_password() -> None:
    pytest.importorskip("psycopg")
    with pytest.raises(CadposeError, match="cannot open the store postgresql") as caught:
        Store("postgresql://someone:secret@127.0.0.1:1/db")
    assert "\n" not in str(caught.value) and "secret" not in str(caught.value)
    assert "--store" in str(caught.value)


def test_a_missing_driver_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "psycopg", None)
    with pytest.raises(DependencyError, match=r"pip install 'cadpose\[postgres\]'"):
        Store("postgresql+psycopg://host/db")


def test_a_file_that_is_no_database_gives_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "x.db"
    content = b"not a database, but long enough to be looked at" * 30
    path.write_bytes(content)
    with pytest.raises(CadposeError, match=r"cannot open the store .*x\.db: file is not a database; choose"):
        Store(f"sqlite:///{path}")
    assert path.read_bytes() == content


def test_a_missing_file_is_made_only_where_that_is_wanted(tmp_path: Path) -> None:
    path = tmp_path / "none.db"
    with pytest.raises(CadposeError, match=r"there is no store at .*none\.db: `cadpose db init`"):
        Store(f"sqlite:///{path}", create=False)
    assert list(tmp_path.iterdir()) == []


def test_an_empty_database_is_left_so_where_that_is_wanted(url: str) -> None:
    if url.startswith("sqlite"):
        Path(url.removeprefix("sqlite:///")).parent.mkdir()
    ask(url, "SELECT 1")  # makes the file
    with pytest.raises(CadposeError, match="holds no store: `cadpose db init`"):
        Store(url, create=False, migrate=False)
    with pytest.raises(CadposeError, match="holds no store"):
        Store(url, create=False, migrate=True)
    with pytest.raises(CadposeError):
        counts(url)


def test_a_place_that_cannot_be_written_gives_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.db").mkdir()
    for place, what in (("file/x.db", "make the folder"), ("folder.db", "open the store")):
        with pytest.raises(CadposeError, match=f"cannot {what}") as caught:
            Store(f"sqlite:///{tmp_path / place}")
        assert "\n" not in str(caught.value)


def test_a_tampered_document_gives_one_sentence(url: str) -> None:
    document = make_document()
    with Store(url) as store:
        store.add(document)
        ask(url, "UPDATE annotations SET document = '{}'")
        for read in (lambda: store.document(document.photo.sha256), store.annotations):
            with pytest.raises(CadposeError, match="cannot read the store"):
                read()
