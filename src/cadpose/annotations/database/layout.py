"""Making the tables, bringing older ones up to date, and refusing those of a newer program."""

from __future__ import annotations

import contextlib
import os
import secrets
import sqlite3
from dataclasses import dataclass
from pathlib import Path

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.engine import Database
from cadpose.errors import CadposeError

#: Names PostgreSQL's lock that only one process at a time makes or migrates tables under.
_LOCK = 0x0CAD_905E
#: What a store of the first revision, which carried no number yet, calls itself.
UNNUMBERED = "0000"


@dataclass(frozen=True, slots=True)
class Layout:
    """What was found or done when a store was opened.

    Attributes:
        revision: Of the tables as they are now.
        found: Of the tables as they were found, empty for a new store.
        backup: The copy of the older file that was kept, None where nothing was migrated or on a server.
    """

    revision: str
    found: str
    backup: Path | None = None


def prepare(database: Database, migrate: bool | None = None, create: bool = True) -> Layout:
    """Make sure that the tables are those of this program.

    A new database gets them. An older SQLite file is migrated in one transaction, and a copy of it kept
    beside it; several processes that open it at once take turns, and the first one does it. An older
    PostgreSQL database is left to `cadpose db migrate`, because its backup is its keeper's.

    Args:
        database: Where.
        migrate: Migrate, also on a server (True); refuse whatever is older (False); by default as above.
        create: Give a new database its tables; else it is refused.

    Raises:
        CadposeError: the tables are newer than the program, or older and not to be migrated, or they are
            another program's, or the database cannot be read or written.
    """
    with database.reading("open") as connection:
        found = _found(connection, database)
    if found == t.HEAD:
        return Layout(t.HEAD, found)
    if found == "":
        if not create:
            raise CadposeError(f"{database.place} holds no store: `cadpose db init` makes one")
        with database.writing("open") as connection:
            _take_turns(connection)
            # Another process may have been quicker.
            found = _found(connection, database)
            if found == "":
                t.metadata.create_all(connection)
                t.REVISION.create(connection)
                connection.execute(sa.insert(t.REVISION), {"version_num": t.HEAD})
                return Layout(t.HEAD, "")
        return prepare(database, migrate, create)
    if not (database.is_sqlite if migrate is None else migrate):
        raise CadposeError(
            f"the store {database.place} was made by an earlier version of cadpose: back it up and run "
            f"`cadpose db migrate --store URL`"
        )
    return _migrate(database)


def _found(connection: sa.Connection, database: Database) -> str:
    """Revision of the tables; empty where there are none."""
    names = set(sa.inspect(connection).get_table_names())
    if t.VERSION_TABLE in names:
        found = connection.scalar(sa.select(t.REVISION.c.version_num)) or ""
        if found not in REVISIONS:
            raise CadposeError(
                f"the store {database.place} was made by a newer version of cadpose (revision {found}, this "
                f"one knows {t.HEAD}): update cadpose, or choose another store with --store"
            )
        return str(found)
    if "photos" in names:
        held = {column["name"] for column in sa.inspect(connection).get_columns("photos")}
        if {"sha256", "content_sha256"} <= held and {"annotations", "hypotheses"} <= names:
            return UNNUMBERED
    # A server's database may be shared; a file of another program is a mistake.
    ours = names & set(t.metadata.tables)
    if ours or (names and database.is_sqlite):
        raise CadposeError(
            f"{database.place} holds tables of another program ({', '.join(sorted(ours or names)[:3])}): "
            "choose another store with --store"
        )
    return ""


#: Every revision that this program can read or migrate, oldest first.
REVISIONS = (UNNUMBERED, "0001", "0002", t.HEAD)


def _take_turns(connection: sa.Connection) -> None:
    if connection.dialect.name == "postgresql":
        connection.execute(sa.text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})


def _migrate(database: Database) -> Layout:
    # Without foreign keys, because SQLite changes a table by making it anew; they are looked at afterwards.
    work = Database(database.url, create=False, foreign_keys=False)
    try:
        with work.writing("migrate") as connection:
            _take_turns(connection)
            found = _found(connection, work)
            if found == t.HEAD:
                return Layout(t.HEAD, found)
            backup = None if work.file is None else _copy(work.file)
            _upgrade(connection)
            if work.is_sqlite and (broken := connection.exec_driver_sql("PRAGMA foreign_key_check").first()):
                raise ValueError(f"a row of {broken[0]} points to nothing, see `cadpose db check`")
    finally:
        work.close()
        # Connections that were open before know the tables as they were.
        database.engine.dispose()
    return Layout(t.HEAD, found, backup)


def _upgrade(connection: sa.Connection) -> None:
    # Imported when needed: every other run does without.
    from alembic import command

    from cadpose.annotations.migrations.config import alembic_config

    command.upgrade(alembic_config(connection), "head")


def _copy(file: Path) -> Path:
    """A copy of the file as it is, beside it; the writer's lock is held meanwhile."""
    number, target = 1, file.with_name(f"{file.name}.before-{t.HEAD}")
    while target.exists():
        number += 1
        target = file.with_name(f"{file.name}.before-{t.HEAD}.{number}")
    part = file.with_name(f".{file.name}.{secrets.token_hex(8)}.part")
    try:
        source, copy = sqlite3.connect(file), sqlite3.connect(part)
        try:
            source.backup(copy)
        finally:
            source.close()
            copy.close()
        with part.open("rb+") as stream:
            os.fsync(stream.fileno())
        part.replace(target)
    except OSError as error:
        raise CadposeError(
            f"cannot keep a copy of the store {file} before it is migrated: {error.strerror or error}"
        ) from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return target
