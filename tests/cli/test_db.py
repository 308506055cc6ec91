"""``cadpose db``: what it prints, exit codes, one sentence for what a user can mend."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from cadpose.annotations.database.tables import HEAD
from cadpose.annotations.store import Author, Store
from tests.annotations.database.looking import ask
from tests.annotations.database.test_migrations import old_store
from tests.annotations.factory import make_document
from tests.cli.invoking import cadpose, one_sentence, said


@pytest.fixture
def url(tmp_path: Path) -> str:
    url = f"sqlite:///{tmp_path / 'a.db'}"
    with Store(url) as store:
        store.add_many([make_document("a.jpg"), make_document("b.jpg", annotations=1)])
        store.add_failure("broken.jpg", None, "reading", "is no photo")
    return url


def test_init_makes_a_store_once(tmp_path: Path) -> None:
    path = tmp_path / "new" / "all.db"
    url = f"sqlite:///{path}"
    result = cadpose("db", "init", "--store", url)
    assert result.exit_code == 0 and result.stdout == f"made: {path} (revision {HEAD})\n"
    assert said(cadpose("db", "init", "--store", url, "--json")) == {
        "store": str(path), "made": False, "revision": HEAD,
    }  # fmt: skip
    assert cadpose("db", "check", "--store", url).stdout == "0 photos, 0 annotations, no problem\n"


def test_migrate_tells_what_it_kept(tmp_path: Path) -> None:
    path = old_store(tmp_path)
    url = f"sqlite:///{path}"
    for verb in ("check", "stats", "init"):
        one_sentence(cadpose("db", verb, "--store", url), path, "earlier version", "cadpose db migrate")
    assert said(cadpose("db", "migrate", "--store", url, "--json")) == {
        "store": str(path), "from": "0000", "revision": HEAD, "backup": f"{path}.before-{HEAD}",
    }  # fmt: skip
    result = cadpose("db", "migrate", "--store", url)
    assert result.exit_code == 0 and result.stdout == f"up to date: {path} (revision {HEAD})\n"
    assert "3 photos, 3 annotations, no problem" in cadpose("db", "check", "--store", url).stdout


def test_check_tells_damage(url: str) -> None:
    result = cadpose("db", "check", "--store", url)
    assert result.exit_code == 0 and result.stdout == "2 photos, 3 annotations, no problem\n"
    told = said(cadpose("db", "check", "--store", url, "--json"))
    assert told["problems"] == [] and told["totals"]["photos failed"] == 1
    ask(url, "UPDATE annotations SET focal_px = 1.0 WHERE position = 1")
    result = cadpose("db", "check", "--store", url)
    assert result.exit_code == 1 and "focal_px is 1.0, documents and decisions say" in result.stdout
    result = cadpose("db", "check", "--store", url, "--json")
    assert result.exit_code == 1
    (problem,) = said(result)["problems"]
    assert problem["where"].startswith("annotation ") and "focal_px" in problem["what"]


def test_stats_counts(url: str) -> None:
    result = cadpose("db", "stats", "--store", url)
    assert result.exit_code == 0
    for word in ("CC-BY-3.0", "Set/cad-0.obj", "review", "program cadpose", "broken.jpg", "is no photo"):
        assert word in result.stdout
    told = said(cadpose("db", "stats", "--store", url, "--json"))
    assert told["category"] == {"car": 3} and told["totals"]["photos"] == 2
    assert told["objects_left_out"] == {"library": 2}
    (failure,) = told["failures"]
    assert failure["name"] == "broken.jpg" and failure["failed_at"].endswith("+00:00")


def test_merge_tells_conflicts(url: str, tmp_path: Path) -> None:
    other = f"sqlite:///{tmp_path / 'b.db'}"
    with Store(url) as one, Store(other) as two:
        two.add_many([make_document("a.jpg"), make_document("c.jpg")])
        key = next(i.annotation_id for i in one.queue().items if i.photo_name == "a.jpg")
        one.decide(key, "accept", Author("Anna"), expected_version=None)
        two.decide(key, "reject", Author("Ben"), expected_version=None)
    result = cadpose("db", "merge", other, "--store", url)
    assert result.exit_code == 0 and "b.db" in result.stdout
    assert "decided by people in both stores" in result.stderr and result.stderr.count("\n") == 1
    told = said(cadpose("db", "merge", other, "--store", url, "--json"))
    assert told == {str(tmp_path / "b.db"): {"photos": 0, "annotations": 0, "decisions": 0, "conflicts": []}}
    assert "3 photos, 5 annotations" in cadpose("db", "check", "--store", url).stdout


def test_a_store_that_cannot_be_merged_leaves_no_target(tmp_path: Path) -> None:
    broken = tmp_path / "broken.db"
    broken.write_bytes(b"no database at all, and longer than a header" * 40)
    target = tmp_path / "target.db"
    one_sentence(cadpose("db", "merge", f"sqlite:///{broken}", "--store", f"sqlite:///{target}"), broken)
    assert not target.exists()


def test_sqlite_goes_into_postgres(url: str, new_postgres: object) -> None:
    assert callable(new_postgres)
    server = new_postgres()
    result = cadpose("db", "merge", url, "--store", server, "--json")
    (report,) = said(result).values()
    assert report["photos"] == 2 and report["annotations"] == 3
    assert cadpose("db", "check", "--store", server).stdout == "2 photos, 3 annotations, no problem\n"


@pytest.mark.parametrize("verb", ["migrate", "check", "stats"])
def test_a_missing_store_is_told_and_not_made(tmp_path: Path, verb: str) -> None:
    path = tmp_path / "none.db"
    one_sentence(cadpose("db", verb, "--store", f"sqlite:///{path}"), path, "cadpose db init")
    assert not path.exists()


def test_a_newer_store_is_refused(url: str, tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "a.db") as connection:
        connection.execute("UPDATE cadpose_revision SET version_num = '0999'")
    connection.close()
    for verb in ("init", "migrate", "check", "stats"):
        one_sentence(cadpose("db", verb, "--store", url), "newer version", "0999")


def test_the_store_is_asked_for() -> None:
    result = cadpose("db", "check")
    assert result.exit_code == 2 and "--store" in result.stderr
