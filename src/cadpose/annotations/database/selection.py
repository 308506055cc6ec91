"""Which annotations a list or an export takes, in SQL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

import sqlalchemy as sa
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.results import VERDICTS, Kind, Page, QueueItem
from cadpose.errors import InputError

#: The verdict of an annotation on which nobody and nothing has decided.
UNDECIDED = "undecided"
_MOST = 1000
#: Photos whose annotations are looked up one by one.
_FEW = 500


@dataclass(frozen=True, slots=True)
class Selection:
    """What to take: all conditions hold together, and what is left out does not matter.

    Attributes:
        category: A detected category.
        cad_id: The CAD model, after any edit.
        verdicts: What holds now: any of these, ``"undecided"`` among them.
        min_confidence: At least; those that tell no confidence are left out.
        max_confidence: At most; likewise.
        text: Part of the photo's name or of the CAD model's, upper and lower case being the same.
        decided_by: ``"human"`` or ``"program"``.

    Raises:
        InputError: an unknown verdict, or a confidence outside [0, 1].
    """

    category: str | None = None
    cad_id: str | None = None
    verdicts: tuple[str, ...] = ()
    min_confidence: float | None = None
    max_confidence: float | None = None
    text: str = ""
    decided_by: Kind | None = None

    def __post_init__(self) -> None:
        for verdict in self.verdicts:
            if verdict not in (*VERDICTS, UNDECIDED):
                raise InputError(f"{verdict!r} is none of the verdicts {', '.join((*VERDICTS, UNDECIDED))}")
        for bound in (self.min_confidence, self.max_confidence):
            if bound is not None and not 0.0 <= bound <= 1.0:
                raise InputError(f"confidence {bound} is outside [0, 1]")
        if self.decided_by is not None and self.decided_by not in get_args(Kind):
            raise InputError(f"decided_by is human or program, not {self.decided_by!r}")


class aside(FunctionElement[Any]):
    """A column by whose index SQLite is not to go: without statistics it would take any for a narrow one."""

    name = "aside"
    inherit_cache = True

    def __init__(self, column: sa.ColumnElement[Any]) -> None:
        super().__init__(column)
        self.type = column.type


@compiles(aside)
def _as_it_is(element: aside, compiler: SQLCompiler, **words: Any) -> str:
    return str(compiler.process(element.clauses, **words))


@compiles(aside, "sqlite")
def _with_a_plus(element: aside, compiler: SQLCompiler, **words: Any) -> str:
    return f"+{compiler.process(element.clauses, **words)}"


def in_force(by_index: bool = False) -> sa.ColumnElement[bool]:
    """What holds; looked at of rows that are found in another way unless told."""
    column = t.ANNOTATIONS.c.in_force
    return (column if by_index else aside(column)) == sa.true()


def conditions(
    connection: sa.Connection, selection: Selection, by_index: bool
) -> list[sa.ColumnElement[bool]]:
    """The selection on ``annotations``; what does not hold any more is never taken.

    Args:
        connection: To look names up.
        selection: What to take.
        by_index: Find the rows by these conditions, rather than look at rows that are found otherwise.
    """

    def column(name: str) -> sa.ColumnElement[Any]:
        return t.ANNOTATIONS.c[name] if by_index else aside(t.ANNOTATIONS.c[name])

    found: list[sa.ColumnElement[bool]] = [in_force(by_index)]
    if selection.category is not None:
        found.append(column("category") == selection.category)
    if selection.cad_id is not None:
        found.append(column("cad_id") == selection.cad_id)
    if selection.verdicts:
        found.append(_verdict(column("verdict"), selection.verdicts))
    if selection.min_confidence is not None or selection.max_confidence is not None:
        # `priority` is the confidence, -1 where there is none: the order of the index.
        found.append(column("priority") >= (selection.min_confidence or 0.0))
    if selection.max_confidence is not None:
        found.append(column("priority") <= selection.max_confidence)
    if selection.decided_by is not None:
        found.append(column("decided_by") == selection.decided_by)
    if selection.text:
        found.append(_named(connection, column("id"), selection.text))
    return found


def _verdict(column: sa.ColumnElement[Any], verdicts: tuple[str, ...]) -> sa.ColumnElement[bool]:
    told = [v for v in verdicts if v != UNDECIDED]
    parts: list[sa.ColumnElement[bool]] = [column.is_(None)] if UNDECIDED in verdicts else []
    if told:
        parts.append(column == told[0] if len(told) == 1 else column.in_(told))
    return sa.or_(*parts)


def verdict_is(verdicts: tuple[str, ...]) -> sa.ColumnElement[bool]:
    """One of these holds, ``"undecided"`` among them; looked at of rows that are found otherwise."""
    return _verdict(aside(t.ANNOTATIONS.c.verdict), verdicts)


def not_rejected() -> sa.ColumnElement[bool]:
    """No person's rejection holds."""
    a = t.ANNOTATIONS.c
    # Both may be null, and null is not unequal to anything.
    return sa.or_(sa.func.coalesce(a.decided_by, "") != "human", a.verdict != "reject")


def _named(connection: sa.Connection, key: sa.ColumnElement[Any], text: str) -> sa.ColumnElement[bool]:
    """Names are looked through first: annotations of few matches are looked up, many are met on the way."""
    a, p, c = t.ANNOTATIONS.c, t.PHOTOS.c, t.CADS.c
    photos = sa.select(p.sha256).where(p.name.icontains(text, autoescape=True))
    cads = sa.select(c.id).where(c.name.icontains(text, autoescape=True))
    some = connection.scalars(photos.limit(_FEW + 1)).all()
    if len(some) > _FEW:
        return sa.or_(aside(a.photo_sha256).in_(photos), aside(a.cad_id).in_(cads))
    other = t.ANNOTATIONS.alias().c
    of_photos = sa.select(other.id).where(other.photo_sha256.in_(some))
    of_cads = sa.select(other.id).where(other.in_force == sa.true(), other.cad_id.in_(cads))
    return key.in_(sa.union_all(of_photos, of_cads))


def item_columns() -> list[sa.ColumnElement[Any]]:
    """What :func:`item_of` reads."""
    a, p, d, c = t.ANNOTATIONS.c, t.PHOTOS.c, t.DETECTIONS.c, t.CADS.c
    return [
        a.id, a.version, a.photo_sha256, p.name, p.width, p.height, a.position, a.category, d.score, a.cad_id,
        c.name.label("cad_name"), a.box_iou, a.mask_iou, a.confidence, a.machine_verdict, a.verdict,
        a.decided_by, a.edit, a.in_force, a.priority,
    ]  # fmt: skip


def joined(query: sa.Select[Any]) -> sa.Select[Any]:
    """With the tables that :func:`item_columns` are of."""
    a = t.ANNOTATIONS.c
    return (
        query.select_from(t.ANNOTATIONS)
        .join(t.PHOTOS, a.photo_sha256 == t.PHOTOS.c.sha256)
        .join(t.DETECTIONS, a.detection_id == t.DETECTIONS.c.id)
        .join(t.CADS, a.cad_key == t.CADS.c.key)
    )


def item_of(row: sa.Row[Any]) -> QueueItem:
    """The record of a row of :func:`item_columns`."""
    return QueueItem(
        annotation_id=row.id,
        version=row.version,
        photo_sha256=row.photo_sha256,
        photo_name=row.name,
        photo_size=(row.width, row.height),
        position=row.position,
        category=row.category,
        score=row.score,
        cad_id=row.cad_id,
        cad_name=row.cad_name,
        box_iou=row.box_iou,
        mask_iou=row.mask_iou,
        confidence=row.confidence,
        machine_verdict=row.machine_verdict,
        verdict=row.verdict,
        decided_by=row.decided_by,
        edited=row.edit is not None,
        in_force=row.in_force,
    )


def page(connection: sa.Connection, selection: Selection, after: str | None, limit: int) -> Page:
    """Items after a key, least confident first; see ``Store.queue``."""
    if not 1 <= limit <= _MOST:
        raise InputError(f"a page holds 1 to {_MOST} annotations, not {limit}")
    a = t.ANNOTATIONS.c
    chosen = sa.select(a.id, a.priority).where(*conditions(connection, selection, by_index=True))
    if after is not None:
        chosen = chosen.where(sa.tuple_(a.priority, a.id) > sa.tuple_(*_key(after)))
    # The page's keys first, from the index alone; then what is shown of them.
    chosen = chosen.order_by(a.priority, a.id).limit(limit + 1)
    keys = connection.execute(chosen).all()
    if not keys:
        return Page((), None)
    shown = joined(sa.select(*item_columns())).where(a.id.in_([key.id for key in keys[:limit]]))
    rows = connection.execute(shown.order_by(a.priority, a.id)).all()
    last = rows[-1] if len(keys) > limit and rows else None
    return Page(tuple(item_of(row) for row in rows), None if last is None else f"{last.priority!r}:{last.id}")


def _key(after: str) -> tuple[float, str]:
    number, _, key = after.partition(":")
    try:
        return float(number), key
    except ValueError:
        raise InputError(f"{after!r} is no key of a page: take the one that the page before gave") from None


def count(connection: sa.Connection, selection: Selection) -> int:
    """How many annotations the selection takes."""
    query = (
        sa.select(sa.func.count())
        .select_from(t.ANNOTATIONS)
        .where(*conditions(connection, selection, by_index=True))
    )
    return int(connection.scalar(query) or 0)
