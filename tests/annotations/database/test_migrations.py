from __future__ import annotations

import shutil
import sqlite3
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.engine import Database
from cadpose.annotations.database.layout import REVISIONS, prepare
from cadpose.annotations.migrations.config import alembic_config
from cadpose.annotations.store import Store
from cadpose.errors import CadposeError
from tests.annotations.database.looking import ask, counts, dump
from tests.annotations.factory import make_document

FIRST = Path(__file__).parent / "first_store.sql"
#: Columns that the earliest stores lacked, and the keys of the document that came with them.
LATER = {
    "hypotheses": ("expected_error", "needs_review"),
    "candidates": ("probability",),
    "annotations": (
        "cad_probability",
        "none_probability",
        "cad_needs_review",
        "truncated",
        "tiny",
        "unsure",
    ),
    "failures": ("truncated", "tiny", "unsure"),
}


def old_store(folder: Path) -> Path:
    """A file as the version before revisions made it: three photos, three annotations, one failure."""
    path = folder / "old.db"
    with sqlite3.connect(path) as connection:
        connection.executescript(FIRST.read_text(encoding="utf-8"))
        connection.execute("PRAGMA journal_mode=WAL")
    connection.close()
    return path


def old_documents(path: Path) -> list[tuple[str, str]]:
    with sqlite3.connect(path) as connection:
        return connection.execute("SELECT id, document FROM annotations ORDER BY id").fetchall()


def at_revision(url: str, revision: str) -> None:
    """Make tables by migrations alone."""
    database = Database(url, foreign_keys=False)
    with database.writing() as connection:
        command.upgrade(alembic_config(connection), revision)
    database.close()


def test_the_newest_revision_is_the_one_that_the_program_knows() -> None:
    scripts = ScriptDirectory.from_config(alembic_config())
    assert scripts.get_current_head() == t.HEAD
    known = [script.revision for script in scripts.walk_revisions()]
    assert tuple(reversed(known)) == REVISIONS[1:]


@pytest.mark.parametrize("made_by", ["migrations", "models"])
def test_models_and_migrations_agree(url: str, made_by: str) -> None:
    if made_by == "migrations":
        at_revision(url, "head")
    Store(url).close()
    database = Database(url)
    with database.reading() as connection:
        context = MigrationContext.configure(
            connection,
            opts={"compare_type": True, "compare_server_default": True, "version_table": t.VERSION_TABLE},
        )
        assert compare_metadata(context, t.metadata) == []
        checks = {
            table: sorted(str(c["name"]) for c in sa.inspect(connection).get_check_constraints(table))
            for table in ("photos", "decisions")
        }
    database.close()
    assert checks == {
        "photos": ["ck_photos_size"],
        "decisions": ["ck_decisions_kind", "ck_decisions_verdict"],
    }


def test_an_old_store_is_migrated_without_loss(tmp_path: Path) -> None:
    path = old_store(tmp_path)
    before = old_documents(path)
    url = f"sqlite:///{path}"
    with Store(url) as store:
        assert (store.revision_found, store.backup) == ("0000", tmp_path / f"old.db.before-{t.HEAD}")
        assert list(store.check()) == []
        assert [photo.name for photo in store.photos()] == ["old/a.jpg", "old/b.jpg", "old/empty.jpg"]
        first = store.document(store.photos()[0].sha256)
        assert first is not None and len(first.annotations) == 2
        assert first.failures[0].reason == "the library has no zebra" and first.failures[0].detection.tiny
        assert first.annotations[1].cad.licence == "LGPL" and first.annotations[0].confidence is None
        assert [a.cad.id for a in store.annotations(cad_id="Set/cad-7.obj")] == ["Set/cad-7.obj"]
        assert store.stats()["licence"] == {"CC-BY-3.0": 2, "LGPL": 1}
        assert store.stats()["tool_version"] == {"0.1.0": 3}
    assert old_documents(path) == before
    assert counts(url, [t.CANDIDATES, t.HYPOTHESES, t.DETECTIONS, t.CADS, t.DECISIONS]) == {
        "candidates": 7, "hypotheses": 6, "detections": 4, "cads": 4, "decisions": 0,
    }  # fmt: skip
    # The copy is the old file, and it is not made again.
    assert old_documents(tmp_path / f"old.db.before-{t.HEAD}") == before
    with Store(url) as store:
        assert (store.revision_found, store.backup) == (t.HEAD, None)
    assert [p.name for p in tmp_path.glob("*before*") if p.suffix == f".before-{t.HEAD}"] == [
        f"old.db.before-{t.HEAD}"
    ]
    assert not list(tmp_path.glob(".*.part"))


def test_the_earliest_stores_are_migrated_too(tmp_path: Path) -> None:
    path = old_store(tmp_path)
    with sqlite3.connect(path) as connection:
        for table, names in LATER.items():
            for name in names:
                connection.execute(f"ALTER TABLE {table} DROP COLUMN {name}")
        keys = [f"hypotheses[{i}].{name}" for i in range(2) for name in LATER["hypotheses"]]
        keys += [f"detection.{name}" for name in LATER["failures"]]
        keys += ["none_probability", "cad_needs_review", *(f"candidates[{i}].probability" for i in range(3))]
        gone = ", ".join(f"'$.{key}'" for key in keys)
        connection.execute(f"UPDATE annotations SET document = json_remove(document, {gone})")
    with Store(f"sqlite:///{path}") as store:
        annotations = store.annotations()
        assert len(annotations) == 3
        assert {h.expected_error for a in annotations for h in a.hypotheses} == {None}
        assert not any(a.detection.truncated for a in annotations)
        # Its documents were changed here, so their digests do not fit; nothing else is wrong.
        told = Counter(problem.what for problem in store.check())
        assert told == {"its document is not the one that was written": 5}
        new = make_document("new.jpg")
        assert store.add(new) and store.document(new.photo.sha256) == new


def test_postgres_is_migrated_when_asked(new_postgres: object, tmp_path: Path) -> None:
    assert callable(new_postgres)
    url = new_postgres()
    at_revision(url, "0001")
    source = old_store(tmp_path)
    copy_rows(source, url)
    with pytest.raises(CadposeError, match=r"made by an earlier version of cadpose.*cadpose db migrate"):
        Store(url)
    with Store(url, migrate=True) as store:
        assert (store.revision_found, store.backup) == ("0001", None)
        assert list(store.check()) == []
        there = dump(url)
    with Store(f"sqlite:///{source}"):
        here = dump(f"sqlite:///{source}")
    assert {name: len(rows) for name, rows in there.items()} == {
        name: len(rows) for name, rows in here.items()
    }
    assert there["annotations"] == here["annotations"] and there["cads"] == here["cads"]


def copy_rows(source: Path, url: str) -> None:
    """The rows of the first revision, from SQLite to a server."""
    old, new = sa.create_engine(f"sqlite:///{source}"), sa.create_engine(url)
    with old.connect() as reader, new.begin() as writer:
        for name in ("photos", "annotations", "candidates", "hypotheses", "failures"):
            here, there = (sa.Table(name, sa.MetaData(), autoload_with=c) for c in (reader, writer))
            writer.execute(sa.insert(there), [dict(row._mapping) for row in reader.execute(sa.select(here))])
    old.dispose()
    new.dispose()


def test_a_migration_that_fails_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = old_store(tmp_path)
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE annotations SET document = '{}' WHERE position = 1")
        before = "\n".join(connection.iterdump())
    with pytest.raises(CadposeError, match=r"cannot migrate the store .*old\.db") as caught:
        Store(f"sqlite:///{path}")
    assert "\n" not in str(caught.value)
    with sqlite3.connect(path) as connection:
        assert "\n".join(connection.iterdump()) == before


def test_a_migration_is_refused_on_demand(tmp_path: Path) -> None:
    path = old_store(tmp_path)
    with pytest.raises(CadposeError, match="earlier version"):
        Store(f"sqlite:///{path}", migrate=False)
    assert not list(tmp_path.glob("*before*"))


OPENER = (
    "import sys; from cadpose.annotations.store import Store; print(len(Store(sys.argv[1]).annotations()))"
)


def test_processes_that_open_an_old_store_at_once_take_turns(tmp_path: Path) -> None:
    path = old_store(tmp_path)
    command_line = [sys.executable, "-c", OPENER, f"sqlite:///{path}"]
    runs = [subprocess.Popen(command_line, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [run.communicate(timeout=120)[0] for run in runs] == ["3\n"] * 3
    assert [p.name for p in tmp_path.glob("*before*")] == [f"old.db.before-{t.HEAD}"]


def test_threads_that_make_a_store_at_once_take_turns(url: str) -> None:
    errors: list[Exception] = []

    def make() -> None:
        try:
            Store(url).close()
        except Exception as error:
            errors.append(error)

    workers = [threading.Thread(target=make) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert errors == []
    assert ask(url, f"SELECT version_num FROM {t.VERSION_TABLE}") == [(t.HEAD,)]


def test_a_newer_store_is_refused(url: str) -> None:
    Store(url).close()
    ask(url, f"UPDATE {t.VERSION_TABLE} SET version_num = '0999'")
    with pytest.raises(
        CadposeError, match=r"newer version of cadpose \(revision 0999.*update cadpose"
    ) as caught:
        Store(url)
    assert "\n" not in str(caught.value)


def test_tables_of_another_program_are_left_alone(url: str) -> None:
    ask(url, "CREATE TABLE photos (id INTEGER PRIMARY KEY)")
    with pytest.raises(CadposeError, match="holds tables of another program"):
        Store(url)
    assert ask(url, "SELECT count(*) FROM photos") == [(0,)]


def test_an_sqlite_file_of_another_program_is_left_alone(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'places.db'}"
    ask(url, "CREATE TABLE bookmarks (id INTEGER)")
    with pytest.raises(CadposeError, match="tables of another program"):
        Store(url)


def test_the_revisions_are_part_of_the_package(tmp_path: Path) -> None:
    folder = Path(ScriptDirectory.from_config(alembic_config()).dir)
    # A path with a per cent sign is no variable.
    shutil.copytree(folder, tmp_path / "50%s")
    assert (folder / "env.py").is_file() and (folder / "versions" / "0002_history.py").is_file()
    assert prepare.__module__.startswith("cadpose.")


def test_a_store_of_the_second_revision_takes_a_region(tmp_path: Path) -> None:
    path = tmp_path / "second.db"
    with Store(f"sqlite:///{path}") as store:
        store.add(make_document("a.jpg", annotations=1))
        before = store.history(store.queue().items[0].annotation_id)
    with sqlite3.connect(path) as connection:
        connection.execute("ALTER TABLE decisions DROP COLUMN region_after")
        connection.execute(f"UPDATE {t.VERSION_TABLE} SET version_num = '0002'")
    connection.close()
    with Store(f"sqlite:///{path}") as store:
        assert store.revision_found == "0002" and store.backup is not None
        # The ids of decisions stay what they were: they are digests of all columns.
        assert list(store.check()) == []
        assert store.history(store.queue().items[0].annotation_id) == before
