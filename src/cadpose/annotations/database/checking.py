"""Reading a store again and telling what is damaged: nothing is mended, nothing is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.deciding import decision_id
from cadpose.annotations.database.engine import Database, fetch
from cadpose.annotations.database.rows import (
    CURRENT,
    DocumentRows,
    Row,
    add_annotation,
    annotation_id,
    cad_json,
    content_digest,
    rows_of,
    short_digest,
)
from cadpose.annotations.database.settling import states
from cadpose.annotations.database.writing import first_decision

_PHOTOS = 100
#: Columns whose value the document does not tell.
_STATE = {
    "document_sha256", "verdict", "decided_by", "edit", "in_force", "superseded_at", "version", "added_at",
    *CURRENT,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Problem:
    """Something that is not as it was written.

    Attributes:
        where: Table and key.
        what: One sentence.
    """

    where: str
    what: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}"


def problems(database: Database) -> Iterator[Problem]:
    """Everything that is damaged: the file, digests, columns, what holds, and rows that nothing needs."""
    if database.is_sqlite:
        with database.reading("check") as connection:
            told = list(_sqlite(connection))
        yield from told
        if told:
            return  # what follows would trip over the same
    after = ""
    while True:
        with database.reading("check") as connection:
            query = sa.select(t.PHOTOS).where(t.PHOTOS.c.sha256 > after).order_by(t.PHOTOS.c.sha256)
            photos = fetch(connection, query.limit(_PHOTOS))
            told = [problem for photo in photos for problem in _photo(connection, photo)]
        yield from told
        if not photos:
            break
        after = photos[-1]["sha256"]
    with database.reading("check") as connection:
        told = [*_shared(connection), *_orphans(connection)]
    yield from told


def _sqlite(connection: sa.Connection) -> Iterator[Problem]:
    for (line,) in connection.exec_driver_sql("PRAGMA integrity_check"):
        if line != "ok":
            yield Problem("the file", str(line))
    for row in connection.exec_driver_sql("PRAGMA foreign_key_check"):
        yield Problem(f"{row[0]} row {row[1]}", f"points to a row of {row[2]} that is not there")


def _photo(connection: sa.Connection, photo: Mapping[str, Any]) -> Iterator[Problem]:
    sha256, where = photo["sha256"], f"photo {photo['name']}"
    try:
        found = states(connection, sha256)
        newest = [row for row, _ in found if row["document_sha256"] == photo["content_sha256"]]
        f = t.FAILURES.c
        query = sa.select(t.FAILURES).where(f.photo_sha256 == sha256).order_by(f.position)
        failures = fetch(connection, query)
        data = {
            "schema": photo["schema_version"],
            "photo": {"name": photo["name"], "sha256": sha256, "size": [photo["width"], photo["height"]]},
            "annotations": [row["document"] for row in newest],
            "failures": [row["document"] for row in failures],
        }
        if content_digest(data) != photo["content_sha256"]:
            yield Problem(where, "its document is not the one that was written")
        for row, wanted in found:
            name = f"annotation {row['id'][:12]} of {photo['name']}"
            if annotation_id(sha256, row["position"], row["document"]) != row["id"]:
                yield Problem(name, "its document is not the one that was written")
            for column, value in wanted.items():
                if row[column] != value:
                    yield Problem(name, f"{column} is {row[column]!r}, documents and decisions say {value!r}")
        yield from _columns(connection, data, found, failures)
        yield from _decisions(connection, sha256, {row["id"]: row for row, _ in found})
    except (KeyError, TypeError, IndexError, ValueError, AttributeError) as error:
        yield Problem(where, f"its document cannot be read ({type(error).__name__}: {error})")


def _columns(
    connection: sa.Connection,
    data: Mapping[str, Any],
    found: Sequence[tuple[Row, Row]],
    failures: Sequence[Mapping[str, Any]],
) -> Iterator[Problem]:
    """What the tables should hold of a photo's documents, the former ones too, against what they do."""
    rows: DocumentRows = rows_of({**data, "annotations": []})
    sha256 = data["photo"]["sha256"]
    for row, _ in found:
        add_annotation(rows, row["id"], sha256, row["document_sha256"], row["position"], row["document"])
    held = {row["id"]: row for row, _ in found}
    for wanted in rows.annotations:
        yield from _differences(f"annotation {wanted['id'][:12]}", held[wanted["id"]], wanted, _STATE)
    for wanted, kept in zip(rows.failures, failures, strict=True):
        yield from _differences(f"failure {kept['position']} of {data['photo']['name']}", kept, wanted)
    d = t.DETECTIONS.c
    stored = fetch(connection, sa.select(t.DETECTIONS).where(d.photo_sha256 == sha256))
    yield from _table("detection", {r["id"]: r for r in stored}, rows.detections)
    for table, wanted_rows in ((t.CANDIDATES, rows.candidates), (t.HYPOTHESES, rows.hypotheses)):
        query = (
            sa.select(table)
            .join_from(table, t.ANNOTATIONS, table.c.annotation_id == t.ANNOTATIONS.c.id)
            .where(t.ANNOTATIONS.c.photo_sha256 == sha256)
        )
        stored_rows = {(r["annotation_id"], r["rank"]): r for r in fetch(connection, query)}
        wanted_by_key = {(r["annotation_id"], r["rank"]): r for r in wanted_rows}
        yield from _table(table.name, stored_rows, wanted_by_key)


def _table(
    name: str, stored: Mapping[Any, Mapping[str, Any]], wanted: Mapping[Any, Row]
) -> Iterator[Problem]:
    for key in sorted(stored.keys() | wanted.keys()):
        where = f"{name} {key if isinstance(key, str) else f'{key[0][:12]} {key[1]}'}"
        if key not in stored:
            yield Problem(where, "is missing")
        elif key not in wanted:
            yield Problem(where, "no document tells of it")
        else:
            yield from _differences(where, stored[key], wanted[key])


def _differences(
    where: str, row: Mapping[str, Any], wanted: Row, ignored: set[str] | None = None
) -> Iterator[Problem]:
    for column, value in wanted.items():
        if column not in (ignored or ()) and row[column] != value:
            yield Problem(where, f"{column} is {row[column]!r}, its document says {value!r}")


def _decisions(
    connection: sa.Connection, sha256: str, annotations: Mapping[str, Mapping[str, Any]]
) -> Iterator[Problem]:
    query = (
        sa.select(t.DECISIONS)
        .join_from(t.DECISIONS, t.ANNOTATIONS, t.DECISIONS.c.annotation_id == t.ANNOTATIONS.c.id)
        .where(t.ANNOTATIONS.c.photo_sha256 == sha256)
    )
    for row in fetch(connection, query):
        first = first_decision(
            dict(annotations[row["annotation_id"]]), row["tool"], row["tool_version"], None
        )
        if row["id"] not in (decision_id(row), first["id"]):
            yield Problem(f"decision {row['id']} of {row['author']}", "it is not the one that was written")


def _shared(connection: sa.Connection) -> Iterator[Problem]:
    for row in fetch(connection, sa.select(t.CADS)):
        if short_digest(cad_json(row)) != row["key"]:
            yield Problem(f"CAD model {row['id']}", "it is not the one that was written")
    for row in fetch(connection, sa.select(t.PROVENANCES)):
        if short_digest(row["document"]) != row["key"]:
            yield Problem(f"provenance {row['key']}", "it is not the one that was written")


def _orphans(connection: sa.Connection) -> Iterator[Problem]:
    """Rows that nothing speaks of; those without a parent are refused or told by the database itself."""
    a, c, d = t.ANNOTATIONS.c, t.CANDIDATES.c, t.DECISIONS.c
    used_cads = sa.union(
        sa.select(c.cad_key),
        sa.select(a.cad_key),
        sa.select(d.cad_before).where(d.cad_before.is_not(None)),
        sa.select(d.cad_after).where(d.cad_after.is_not(None)),
    )
    for key, name in connection.execute(
        sa.select(t.CADS.c.key, t.CADS.c.id).where(t.CADS.c.key.not_in(used_cads)).order_by(t.CADS.c.id)
    ):
        yield Problem(f"CAD model {name} ({key})", "no annotation speaks of it")
    unused = t.PROVENANCES.c.key.not_in(sa.select(a.provenance_key).distinct())
    for key in connection.scalars(sa.select(t.PROVENANCES.c.key).where(unused)):
        yield Problem(f"provenance {key}", "no annotation speaks of it")
