"""One database: its address, its transactions, and one sentence for whatever goes wrong in them."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from cadpose.errors import CadposeError, DependencyError

_BUSY_SECONDS = 60
_CONNECT_SECONDS = 15
_FORMS = "write it as sqlite:///file.db or postgresql+psycopg://user@host/database"
_SQLITE = ("sqlite", "sqlite+pysqlite")
_POSTGRES = ("postgresql", "postgresql+psycopg")


class Database:
    """An SQLite file, SQLite in memory, or a PostgreSQL database.

    Args:
        url: SQLAlchemy's way to write it.
        create: Make a missing SQLite file and its folder.
        foreign_keys: Let SQLite enforce them; migrations rebuild tables and look afterwards.

    Raises:
        CadposeError: the URL names no database that can hold a store, or there is none.
        DependencyError: PostgreSQL is asked for and its driver is not installed.
    """

    def __init__(self, url: str, *, create: bool = True, foreign_keys: bool = True) -> None:
        parsed = _parsed(url)
        self.url = url
        self.is_sqlite = parsed.drivername in _SQLITE
        named = self.is_sqlite and parsed.database not in (None, "", ":memory:")
        #: The SQLite file, None in memory and on a server.
        self.file = Path(str(parsed.database)) if named else None
        #: What to call it in messages: never with its password.
        self.place = (
            str(self.file or "memory") if self.is_sqlite else parsed.render_as_string(hide_password=True)
        )
        if self.file is not None:
            _ready(self.file, create)
        self.engine = _sqlite_engine(parsed, foreign_keys) if self.is_sqlite else _postgres_engine(parsed)

    def close(self) -> None:
        """Let go of every connection."""
        self.engine.dispose()

    @contextmanager
    def reading(self, what: str = "read") -> Iterator[sa.Connection]:
        """A transaction that reads; ``what`` failed is told if it does."""
        with self._told(what), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def writing(self, what: str = "write") -> Iterator[sa.Connection]:
        """A transaction that writes, whole or not at all; SQLite's writers take turns."""
        with self._told(what), self.engine.execution_options(writes=True).begin() as connection:
            yield connection

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        try:
            yield
        except (SQLAlchemyError, sqlite3.Error, ValueError) as error:
            reason = (str(getattr(error, "orig", None) or error).strip() or repr(error)).splitlines()[0]
            raise CadposeError(
                f"cannot {what} the store {self.place}: {reason}; {self._mend(reason)}"
            ) from None

    def _mend(self, reason: str) -> str:
        if not self.is_sqlite:
            return (
                f"see that the server runs and lets you in, or choose another store with --store ({_FORMS})"
            )
        if "full" in reason:
            return "free some space, or choose another file with --store"
        if "readonly" in reason:
            return "make file and folder writable, or choose another file with --store"
        return "choose another file with --store"


def fetch(connection: sa.Connection, query: sa.Select[Any]) -> list[dict[str, Any]]:
    """All rows of a query, by column."""
    return [dict(row._mapping) for row in connection.execute(query)]


def insert_new(connection: sa.Connection, table: sa.Table, rows: Sequence[dict[str, Any]]) -> None:
    """Insert the rows whose key the table lacks. Sorted keys keep two writers from waiting for each other."""
    if rows:
        make = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
        connection.execute(make(table).on_conflict_do_nothing(), rows)


def lock_photos(connection: sa.Connection, digests: Sequence[str]) -> None:
    """Let no other writer change these photos before the transaction ends; SQLite has one writer anyway."""
    if connection.dialect.name == "postgresql":
        for digest in sorted(set(digests)):
            key = int(digest[:16], 16) - (1 << 63)
            connection.execute(sa.text("SELECT pg_advisory_xact_lock(:key)"), {"key": key})


def _parsed(url: str) -> sa.URL:
    try:
        parsed = sa.make_url(url)
    except (ArgumentError, ValueError):
        # It may hold a password, and where is unknown: it is not shown.
        raise CadposeError(f"the store's URL is not a database URL: {_FORMS}") from None
    if parsed.drivername not in (*_SQLITE, *_POSTGRES):
        raise CadposeError(f"the store cannot be a {parsed.drivername} database: {_FORMS}")
    return parsed.set(drivername=_POSTGRES[1]) if parsed.drivername in _POSTGRES else parsed


def _ready(file: Path, create: bool) -> None:
    try:
        if create:
            file.parent.mkdir(parents=True, exist_ok=True)
        elif not file.exists():
            raise CadposeError(f"there is no store at {file}: `cadpose db init` makes one")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CadposeError(f"cannot make the folder of the store {file}: {reason}") from None


# Made once: `json.dumps` would make one for every value.
_compact = json.JSONEncoder(separators=(",", ":"), ensure_ascii=True, allow_nan=False).encode


def _sqlite_engine(url: sa.URL, foreign_keys: bool) -> sa.Engine:
    engine = sa.create_engine(url, connect_args={"timeout": _BUSY_SECONDS}, json_serializer=_compact)
    pragmas = ("journal_mode=WAL", "synchronous=FULL", f"foreign_keys={'ON' if foreign_keys else 'OFF'}")

    @sa.event.listens_for(engine, "connect")
    def _connected(connection: Any, _: object) -> None:
        # Python's driver would begin transactions by its own rules; _begun does it instead.
        connection.isolation_level = None
        for pragma in pragmas:
            connection.execute(f"PRAGMA {pragma}")

    @sa.event.listens_for(engine, "begin")
    def _begun(connection: sa.Connection) -> None:
        # A writer takes the lock at once: one that read first could not wait for another writer.
        writes = connection.get_execution_options().get("writes")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _postgres_engine(url: sa.URL) -> sa.Engine:
    wait = {} if "connect_timeout" in url.query else {"connect_timeout": _CONNECT_SECONDS}
    name = {} if "application_name" in url.query else {"application_name": f"cadpose {os.getpid()}"}
    try:
        return sa.create_engine(url, connect_args={**wait, **name}, json_serializer=_compact)
    except ModuleNotFoundError:
        raise DependencyError(
            "a PostgreSQL store needs psycopg, which is not installed: pip install 'cadpose[postgres]'"
        ) from None
