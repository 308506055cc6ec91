"""Photos that could not be annotated: why, where, how often, until they are."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.results import StoredFailure
from cadpose.annotations.parts import plain_text


def add_failure(connection: sa.Connection, name: str, sha256: str | None, stage: str, reason: str) -> None:
    """Write that a photo failed once more."""
    row = {
        "name": plain_text(name),
        "sha256": sha256 or None,
        "stage": plain_text(stage),
        "reason": plain_text(reason),
        "attempts": 1,
        "failed_at": datetime.now(UTC),
    }
    put_failure(connection, row, t.PHOTO_FAILURES.c.attempts + 1)


def put_failure(connection: sa.Connection, row: dict[str, Any], attempts: Any) -> None:
    """Insert a failure, or let it take the place of the photo's former one, with that number of attempts."""
    make = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
    insert = make(t.PHOTO_FAILURES).values(row)
    changed = {name: insert.excluded[name] for name in ("sha256", "stage", "reason", "failed_at")}
    connection.execute(
        insert.on_conflict_do_update(index_elements=["name"], set_=changed | {"attempts": attempts})
    )


def failures(connection: sa.Connection) -> list[StoredFailure]:
    """All of them, by name."""
    f = t.PHOTO_FAILURES.c
    columns = (f.name, f.sha256, f.stage, f.reason, f.attempts, f.failed_at)
    return [StoredFailure(*row) for row in connection.execute(sa.select(*columns).order_by(f.name))]
