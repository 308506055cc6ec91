"""Writing documents: what is there already stays, what another run answers otherwise becomes history."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.deciding import decision_id
from cadpose.annotations.database.engine import Database, insert_new, lock_photos
from cadpose.annotations.database.results import Author
from cadpose.annotations.database.rows import DocumentRows, Row, document_json, ordered, rows_of, short_digest
from cadpose.annotations.database.settling import settle
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.parts import plain_text

#: Documents a transaction in ``add_documents``; as many are lost at most when the process is killed.
BATCH = 100


#: What the program that annotates calls itself.
ANNOTATE = Author("cadpose", "program", "cadpose annotate")
#: A document's verdict as a person says it.
_PERSONS = {"auto_accept": "accept", "review": "review", "reject": "reject"}


def add_documents(
    database: Database, documents: Iterable[AnnotationDocument], author: Author = ANNOTATE
) -> int:
    """Write documents, some a transaction; how many were not there already.

    Args:
        database: Where.
        documents: What.
        author: Whose word the verdicts of new annotations are.
    """
    written = 0
    for batch in _batches(documents):
        rows = [rows_of(document_json(document)) for document in batch]
        with database.writing() as connection:
            written += write(connection, rows, datetime.now(UTC), author)
    return written


def _batches(documents: Iterable[AnnotationDocument]) -> Iterator[list[AnnotationDocument]]:
    """Lists in which no photo is twice."""
    batch: dict[str, AnnotationDocument] = {}
    for document in documents:
        if len(batch) == BATCH or document.photo.sha256 in batch:
            yield list(batch.values())
            batch.clear()
        batch[document.photo.sha256] = document
    if batch:
        yield list(batch.values())


def write(
    connection: sa.Connection, documents: Sequence[DocumentRows], now: datetime, author: Author = ANNOTATE
) -> int:
    """Write the rows of documents of different photos; how many were not there already."""
    digests = [rows.photo["sha256"] for rows in documents]
    lock_photos(connection, digests)
    p = t.PHOTOS.c
    query = sa.select(p.sha256, p.content_sha256).where(p.sha256.in_(digests))
    held = {row.sha256: row.content_sha256 for row in connection.execute(query)}
    changed = [d for d in documents if held.get(d.photo["sha256"]) != d.photo["content_sha256"]]
    known = _known(connection, [d.photo["sha256"] for d in changed if d.photo["sha256"] in held])
    _insert_shared(connection, changed)
    photos = [{**d.photo, "written_at": now} for d in changed]
    _insert(connection, t.PHOTOS, [photo for photo in photos if photo["sha256"] not in held])
    replaced = [photo for photo in photos if photo["sha256"] in held]
    for photo in replaced:
        connection.execute(sa.update(t.PHOTOS).where(p.sha256 == photo["sha256"]).values(photo))
    insert_new(connection, t.DETECTIONS, [row for d in changed for row in ordered(d.detections)])
    _insert_annotations(connection, changed, known, now, author)
    for rows in changed:
        if rows.photo["sha256"] in held:
            _replace(connection, rows.photo["sha256"], rows, known)
    _insert(connection, t.FAILURES, [row for d in changed for row in d.failures])
    for photo in replaced:
        sweep_detections(connection, photo["sha256"])
    for photo in photos if author.kind == "human" else replaced:
        settle(connection, photo["sha256"], now)
    forget_failures(connection, [d.photo for d in documents])
    return len(changed)


def _known(connection: sa.Connection, digests: Sequence[str]) -> set[str]:
    """Keys of all annotations that the store holds of these photos."""
    if not digests:
        return set()
    a = t.ANNOTATIONS.c
    return set(connection.scalars(sa.select(a.id).where(a.photo_sha256.in_(digests))))


def _insert(connection: sa.Connection, table: sa.Table, rows: Sequence[Row]) -> None:
    if rows:
        connection.execute(sa.insert(table), rows)


def _insert_shared(connection: sa.Connection, documents: Sequence[DocumentRows]) -> None:
    """What photos have in common; sorted over all of them."""
    cads = {key: row for d in documents for key, row in d.cads.items()}
    provenances = {key: row for d in documents for key, row in d.provenances.items()}
    insert_new(connection, t.CADS, ordered(cads))
    insert_new(connection, t.PROVENANCES, ordered(provenances))


def _insert_annotations(
    connection: sa.Connection,
    documents: Sequence[DocumentRows],
    known: set[str],
    now: datetime,
    author: Author,
) -> None:
    new = [row for d in documents for row in d.annotations if row["id"] not in known]
    tools = {key: row["tool_version"] for d in documents for key, row in d.provenances.items()}
    said = [row for row in new if row["machine_verdict"] is not None]
    defaults: dict[str, Any] = {"in_force": True, "version": 1, "added_at": now, "edit": None}
    _insert(
        connection,
        t.ANNOTATIONS,
        [
            {
                **row,
                **defaults,
                "verdict": row["machine_verdict"],
                "decided_by": None if row["machine_verdict"] is None else "program",
            }
            for row in new
        ],
    )
    for table, children in ((t.CANDIDATES, "candidates"), (t.HYPOTHESES, "hypotheses")):
        rows = [row for d in documents for row in getattr(d, children)]
        _insert(connection, table, [row for row in rows if row["annotation_id"] not in known])
    first = [
        first_decision(r, author.tool, author.tool_version or tools[r["provenance_key"]], now) for r in said
    ]
    _insert(
        connection, t.DECISIONS, [_of_person(row, author) if author.kind == "human" else row for row in first]
    )


def first_decision(annotation: Row, tool: str, tool_version: str, now: datetime | None) -> Row:
    """What the program that annotated decided; the key leaves out when, so that it stays one in a merge."""
    return {
        "id": short_digest(annotation["id"], tool, annotation["machine_verdict"]),
        "annotation_id": annotation["id"],
        "kind": "program",
        "author": ANNOTATE.name,
        "tool": tool,
        "tool_version": tool_version,
        "decided_at": now,
        "verdict": annotation["machine_verdict"],
        "reason": "",
        "note": "",
        "pose_before": None,
        "pose_after": None,
        "cad_before": None,
        "cad_after": None,
        "measures": None,
    }


def _of_person(decision: Row, author: Author) -> Row:
    """The same as a person's word."""
    told = {**decision, "kind": "human", "author": plain_text(author.name)}
    told["verdict"] = _PERSONS[decision["verdict"]]
    return {**told, "id": decision_id(told)}


def _replace(connection: sa.Connection, sha256: str, rows: DocumentRows, known: set[str]) -> None:
    """Let the annotations that the new document repeats belong to it, and drop the former failures."""
    a = t.ANNOTATIONS.c
    for row in rows.annotations:
        if row["id"] in known:
            # The timings may be others.
            values = {"document_sha256": row["document_sha256"], "document": row["document"]}
            connection.execute(sa.update(t.ANNOTATIONS).where(a.id == row["id"]).values(values))
    connection.execute(sa.delete(t.FAILURES).where(t.FAILURES.c.photo_sha256 == sha256))


def sweep_detections(connection: sa.Connection, sha256: str) -> None:
    """Drop a photo's detections that neither an annotation nor a failure speaks of any more."""
    d, a, f = t.DETECTIONS.c, t.ANNOTATIONS.c, t.FAILURES.c
    connection.execute(
        sa.delete(t.DETECTIONS).where(
            d.photo_sha256 == sha256,
            ~sa.exists().where(a.detection_id == d.id),
            ~sa.exists().where(f.detection_id == d.id),
        )
    )


def forget_failures(connection: sa.Connection, photos: Sequence[Row]) -> None:
    """A photo that was annotated has not failed."""
    f = t.PHOTO_FAILURES.c
    names, digests = [photo["name"] for photo in photos], [photo["sha256"] for photo in photos]
    for column, values in ((f.name, names), (f.sha256, digests)):
        # Looked for first: the same run again must not write at all.
        if connection.scalar(sa.select(f.name).where(column.in_(values)).limit(1)) is not None:
            connection.execute(sa.delete(t.PHOTO_FAILURES).where(column.in_(values)))
