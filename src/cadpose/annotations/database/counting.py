"""How much of what a store holds."""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.selection import UNDECIDED

Counts = dict[str, dict[str, int]]


def stats(connection: sa.Connection) -> Counts:
    """Counts of what holds, each most frequent first; ``totals`` counts the history too."""
    a, c, p, d, f = t.ANNOTATIONS.c, t.CADS.c, t.PROVENANCES.c, t.DECISIONS.c, t.FAILURES.c
    holding = a.in_force == sa.true()

    def by(column: sa.ColumnElement[Any], *joins: sa.ColumnElement[bool]) -> dict[str, int]:
        return _counts(connection, column, [holding, *joins])

    return {
        "totals": _totals(connection),
        "category": by(a.category),
        "verdict": by(sa.func.coalesce(a.verdict, UNDECIDED)),
        "decided_by": by(sa.func.coalesce(a.decided_by, "nobody")),
        "cad": by(a.cad_id),
        "licence": by(c.licence, a.cad_key == c.key),
        "creator": by(c.creator, a.cad_key == c.key),
        "tool_version": by(p.tool_version, a.provenance_key == p.key),
        "library": by(p.library, a.provenance_key == p.key),
        "decisions_by": _counts(connection, d.kind + sa.literal(" ") + d.author, []),
        "objects_left_out": _counts(connection, f.stage, []),
        "photos_failed": _counts(connection, t.PHOTO_FAILURES.c.stage, []),
    }


def _totals(connection: sa.Connection) -> dict[str, int]:
    def rows(table: sa.Table, *where: sa.ColumnElement[bool]) -> int:
        return int(connection.scalar(sa.select(sa.func.count()).select_from(table).where(*where)) or 0)

    a = t.ANNOTATIONS.c
    return {
        "photos": rows(t.PHOTOS),
        "annotations": rows(t.ANNOTATIONS, a.in_force == sa.true()),
        "former annotations": rows(t.ANNOTATIONS, a.in_force == sa.false()),
        "edited annotations": rows(t.ANNOTATIONS, a.in_force == sa.true(), a.edit.is_not(None)),
        "detections": rows(t.DETECTIONS),
        "decisions": rows(t.DECISIONS),
        "CAD models": rows(t.CADS),
        "objects left out": rows(t.FAILURES),
        "photos failed": rows(t.PHOTO_FAILURES),
    }


def _counts(
    connection: sa.Connection, column: sa.ColumnElement[Any], where: list[sa.ColumnElement[bool]]
) -> dict[str, int]:
    number = sa.func.count().label("number")
    query = sa.select(column.label("what"), number).where(*where).group_by(column)
    rows = connection.execute(query).all()
    return {str(row.what): row.number for row in sorted(rows, key=lambda r: (-r.number, str(r.what)))}
