"""Reading documents and annotations back, a few photos at a time, so that memory stays the same."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.database import tables as t
from cadpose.annotations.database.editing import edited
from cadpose.annotations.database.engine import Database
from cadpose.annotations.database.results import QueueItem, StoredAnnotation, StoredPhoto
from cadpose.annotations.database.rows import cad_json
from cadpose.annotations.database.selection import (
    Selection,
    conditions,
    in_force,
    item_columns,
    item_of,
    joined,
)
from cadpose.annotations.document import AnnotationDocument, FailurePart
from cadpose.annotations.parts import PhotoPart

#: Photos that are read at once.
_PHOTOS = 100

_CAD_NAMES = [column.name for column in t.CADS.c]

#: JSON as text: pydantic reads it itself, and in strict mode only there a list stands for a tuple.
_TEXT = sa.cast(t.ANNOTATIONS.c.document, sa.Text).label("text")


def photos(connection: sa.Connection, limit: int | None = None) -> list[StoredPhoto]:
    """All photos, or the first so many, by name."""
    p = t.PHOTOS.c
    query = sa.select(p.sha256, p.name, p.width, p.height).order_by(p.name, p.sha256).limit(limit)
    return [StoredPhoto(*row) for row in connection.execute(query)]


def photo(connection: sa.Connection, photo_sha256: str) -> StoredPhoto | None:
    """One photo."""
    p = t.PHOTOS.c
    query = sa.select(p.sha256, p.name, p.width, p.height).where(p.sha256 == photo_sha256)
    row = connection.execute(query).first()
    return None if row is None else StoredPhoto(*row)


def document(connection: sa.Connection, photo_sha256: str, original: bool) -> AnnotationDocument | None:
    """The document of one photo, or None."""
    found = connection.execute(sa.select(t.PHOTOS).where(t.PHOTOS.c.sha256 == photo_sha256)).all()
    return next(iter(_documents(connection, found, original)), None)


def iter_documents(
    database: Database, original: bool, where: Sequence[sa.ColumnElement[bool]] = ()
) -> Iterator[AnnotationDocument]:
    """Every document, by name of its photo, with those of its annotations that fulfil the conditions."""
    for found in _pages(database, []):
        with database.reading() as connection:
            documents = _documents(connection, found, original, where)
        yield from documents


def iter_stored(database: Database, selection: Selection, original: bool) -> Iterator[StoredAnnotation]:
    """Every annotation that the selection takes, by name of its photo."""
    a, p = t.ANNOTATIONS.c, t.PHOTOS.c
    with database.reading() as connection:
        where = conditions(connection, selection, by_index=False)
    for found in _pages(database, [sa.exists().where(a.photo_sha256 == p.sha256, *where)]):
        with database.reading() as connection:
            stored = _stored(
                connection, [*where, a.photo_sha256.in_([row.sha256 for row in found])], original
            )
        yield from stored


def stored(connection: sa.Connection, annotation_id: str, original: bool) -> StoredAnnotation | None:
    """One annotation, also one that is history."""
    return next(iter(_stored(connection, [t.ANNOTATIONS.c.id == annotation_id], original)), None)


def standing(connection: sa.Connection, photo_sha256: str) -> list[StoredAnnotation]:
    """A photo's annotations that hold."""
    a = t.ANNOTATIONS.c
    return _stored(connection, [a.photo_sha256 == photo_sha256, in_force()], False)


def items(connection: sa.Connection, photo_sha256: str) -> list[QueueItem]:
    """A photo's annotations that hold, without what they say."""
    a = t.ANNOTATIONS.c
    query = joined(sa.select(*item_columns())).where(a.photo_sha256 == photo_sha256, in_force())
    return [item_of(row) for row in connection.execute(query.order_by(a.position, a.id))]


def former(connection: sa.Connection, photo_sha256: str) -> list[StoredAnnotation]:
    """A photo's annotations that do not hold any more."""
    a = t.ANNOTATIONS.c
    return _stored(connection, [a.photo_sha256 == photo_sha256, ~in_force()], False)


def _pages(database: Database, where: Sequence[sa.ColumnElement[bool]]) -> Iterator[Sequence[sa.Row[Any]]]:
    p = t.PHOTOS.c
    query = sa.select(t.PHOTOS).where(*where).order_by(p.name, p.sha256).limit(_PHOTOS)
    after: tuple[str, str] | None = None
    while True:
        page = query if after is None else query.where(sa.tuple_(p.name, p.sha256) > sa.tuple_(*after))
        with database.reading() as connection:
            rows = connection.execute(page).all()
        if not rows:
            return
        yield rows
        after = rows[-1].name, rows[-1].sha256


def _documents(
    connection: sa.Connection,
    found: Sequence[sa.Row[Any]],
    original: bool,
    where: Sequence[sa.ColumnElement[bool]] = (),
) -> list[AnnotationDocument]:
    a, f = t.ANNOTATIONS.c, t.FAILURES.c
    digests = [photo.sha256 for photo in found]
    held = [a.document_sha256 == t.PHOTOS.c.content_sha256] if original else [in_force()]
    query = (
        _with_edits(
            sa.select(a.photo_sha256, _TEXT, a.edit, t.PHOTOS.c.width, t.PHOTOS.c.height, *_cad_columns())
        )
        .join(t.PHOTOS, a.photo_sha256 == t.PHOTOS.c.sha256)
        .where(a.photo_sha256.in_(digests), *held, *where)
        .order_by(a.photo_sha256, a.position, a.id)
    )
    parts: dict[str, list[AnnotationPart]] = {digest: [] for digest in digests}
    for row in connection.execute(query):
        parts[row.photo_sha256].append(_part(row, original))
    query = sa.select(f.photo_sha256, sa.cast(f.document, sa.Text).label("text"))
    query = query.where(f.photo_sha256.in_(digests)).order_by(f.photo_sha256, f.position)
    failures = {
        digest: [FailurePart.model_validate_json(row.text) for row in rows]
        for digest, rows in groupby(connection.execute(query), key=lambda row: row.photo_sha256)
    }
    return [
        AnnotationDocument(
            schema=photo.schema_version,
            photo=PhotoPart(name=photo.name, sha256=photo.sha256, size=(photo.width, photo.height)),
            annotations=tuple(parts[photo.sha256]),
            failures=tuple(failures.get(photo.sha256, ())),
        )
        for photo in found
    ]


def _stored(
    connection: sa.Connection, where: Sequence[sa.ColumnElement[bool]], original: bool
) -> list[StoredAnnotation]:
    a, p = t.ANNOTATIONS.c, t.PHOTOS.c
    query = joined(sa.select(*item_columns(), _TEXT, *_cad_columns())).where(*where)
    rows = connection.execute(query.order_by(p.name, p.sha256, a.position, a.id)).all()
    return [
        StoredAnnotation(
            item_of(row),
            _part(row, original).record(
                PhotoPart(name=row.name, sha256=row.photo_sha256, size=(row.width, row.height))
            ),
        )
        for row in rows
    ]


def _with_edits(query: sa.Select[Any]) -> sa.Select[Any]:
    return query.select_from(t.ANNOTATIONS).join(t.CADS, t.ANNOTATIONS.c.cad_key == t.CADS.c.key)


def _cad_columns() -> list[sa.ColumnElement[Any]]:
    return [column.label(f"now_{column.name}") for column in t.CADS.c]


def _part(row: sa.Row[Any], original: bool) -> AnnotationPart:
    part = AnnotationPart.model_validate_json(row.text)
    if original or row.edit is None:
        return part
    cad = cad_json({name: getattr(row, f"now_{name}") for name in _CAD_NAMES})
    return edited(part, row.edit, cad if "cad" in row.edit else None, (row.width, row.height))
