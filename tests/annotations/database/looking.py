"""Looking into a store behind its back."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.engine import Database


def ask(url: str, statement: str, **values: Any) -> list[tuple[Any, ...]]:
    """Run a statement of SQL; its rows, if it has any."""
    database = Database(url)
    try:
        with database.writing() as connection:
            result = connection.execute(sa.text(statement), values)
            return [tuple(row) for row in result] if result.returns_rows else []
    finally:
        database.close()


def counts(url: str, tables: Iterable[sa.Table] = t.metadata.sorted_tables) -> dict[str, int]:
    """Rows a table."""
    return {table.name: ask(url, f"SELECT count(*) FROM {table.name}")[0][0] for table in tables}


def dump(url: str) -> dict[str, list[dict[str, Any]]]:
    """Everything, by table."""
    database = Database(url)
    try:
        with database.reading() as connection:
            return {
                table.name: [
                    dict(row._mapping)
                    for row in connection.execute(sa.select(table).order_by(*table.primary_key))
                ]
                for table in t.metadata.sorted_tables
            }
    finally:
        database.close()
