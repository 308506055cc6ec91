"""Taking over another store: the documents, every decision, and who failed; twice is the same as once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.engine import Database, fetch, insert_new, lock_photos
from cadpose.annotations.database.failing import put_failure
from cadpose.annotations.database.rows import Row
from cadpose.annotations.database.settling import settle, states
from cadpose.annotations.database.writing import forget_failures, sweep_detections
from cadpose.errors import InputError

_PHOTOS = 50
_EARLIEST = datetime.min.replace(tzinfo=UTC)


@dataclass(slots=True)
class MergeReport:
    """What a merge did.

    Attributes:
        photos: Photos that were not there.
        annotations: Annotations that were not there, former ones among them.
        decisions: Decisions that were not there.
        conflicts: A sentence for every photo that both annotated otherwise, and for every annotation that
            people decided on differently; the later one holds, the other is history.
    """

    photos: int = 0
    annotations: int = 0
    decisions: int = 0
    conflicts: list[str] = field(default_factory=list)


def merge(target: Database, source: Database) -> MergeReport:
    """Take over everything of ``source`` in one transaction; see ``Store.merge``."""
    if _same(target, source):
        raise InputError(f"the store {target.place} cannot be merged into itself")
    report = MergeReport()
    with source.reading() as there, target.writing() as here:
        for table in (t.CADS, t.PROVENANCES):
            insert_new(here, table, fetch(there, sa.select(table).order_by(table.c.key)))
        after = ""
        while True:
            p = t.PHOTOS.c
            query = sa.select(t.PHOTOS).where(p.sha256 > after).order_by(p.sha256).limit(_PHOTOS)
            photos = fetch(there, query)
            if not photos:
                break
            lock_photos(here, [photo["sha256"] for photo in photos])
            for photo in photos:
                _photo(here, there, photo, report)
            forget_failures(here, photos)
            after = photos[-1]["sha256"]
        _failures(here, there)
    return report


def _same(a: Database, b: Database) -> bool:
    if a.file is not None and b.file is not None:
        return a.file.resolve() == b.file.resolve()
    return a is b or (not a.is_sqlite and a.engine.url == b.engine.url)


def _of_photo(connection: sa.Connection, table: sa.Table, sha256: str) -> list[Row]:
    """A table's rows of one photo."""
    query = sa.select(table)
    if "photo_sha256" in table.c:
        query = query.where(table.c.photo_sha256 == sha256)
    else:
        a = t.ANNOTATIONS.c
        query = query.join(t.ANNOTATIONS, table.c.annotation_id == a.id).where(a.photo_sha256 == sha256)
    return fetch(connection, query.order_by(*table.primary_key))


def _photo(here: sa.Connection, there: sa.Connection, photo: Mapping[str, Any], report: MergeReport) -> None:
    sha256 = photo["sha256"]
    mine = next(iter(fetch(here, sa.select(t.PHOTOS).where(t.PHOTOS.c.sha256 == sha256))), None)
    theirs = {table.name: _of_photo(there, table, sha256) for table in _TABLES}
    known = {row["id"] for row in _of_photo(here, t.ANNOTATIONS, sha256)}
    decided = {row["id"] for row in _of_photo(here, t.DECISIONS, sha256)}
    before = {row["id"]: row for row, _ in states(here, sha256)}
    added = [row for row in theirs["annotations"] if row["id"] not in known]
    said = [row for row in theirs["decisions"] if row["id"] not in decided]
    newer = mine is None or _newer(photo, mine)
    if mine is None:
        here.execute(sa.insert(t.PHOTOS), [dict(photo)])
    elif newer:
        here.execute(sa.update(t.PHOTOS).where(t.PHOTOS.c.sha256 == sha256).values(dict(photo)))
    elif not (added or said):
        return
    if mine is not None and mine["content_sha256"] != photo["content_sha256"] and added:
        report.conflicts.append(
            f"{photo['name']} was annotated otherwise in both stores: the {'other' if newer else 'own'} "
            "store's answer is the later one and holds"
        )
    insert_new(here, t.DETECTIONS, theirs["detections"])
    # Versions begin anew: only this store's own readers have seen one.
    insert_new(here, t.ANNOTATIONS, [{**row, "version": 1} for row in added])
    for table in (t.CANDIDATES, t.HYPOTHESES, t.DECISIONS):
        insert_new(here, table, theirs[table.name])
    if newer:
        _take_document(here, sha256, photo["content_sha256"], theirs)
    sweep_detections(here, sha256)
    moved = {row["annotation_id"] for row in said} & known
    settle(here, sha256, datetime.now(UTC), moved)
    report.photos += mine is None
    report.annotations += len(added)
    report.decisions += len(said)
    if mine is not None:
        report.conflicts += _overruled(here, sha256, str(photo["name"]), before, said)


_TABLES = (t.DETECTIONS, t.ANNOTATIONS, t.CANDIDATES, t.HYPOTHESES, t.DECISIONS, t.FAILURES)


def _newer(theirs: Mapping[str, Any], mine: Mapping[str, Any]) -> bool:
    """Whether their document is another one and takes the place of mine: the later, by digest when equal."""
    if theirs["content_sha256"] == mine["content_sha256"]:
        return False
    return (theirs["written_at"] or _EARLIEST, theirs["content_sha256"]) > (
        mine["written_at"] or _EARLIEST,
        mine["content_sha256"],
    )


def _take_document(
    here: sa.Connection, sha256: str, content: str, theirs: Mapping[str, Sequence[Row]]
) -> None:
    a, f = t.ANNOTATIONS.c, t.FAILURES.c
    for row in theirs["annotations"]:
        if row["document_sha256"] == content:
            values = {"document_sha256": content, "document": row["document"]}
            here.execute(sa.update(t.ANNOTATIONS).where(a.id == row["id"]).values(values))
    here.execute(sa.delete(t.FAILURES).where(f.photo_sha256 == sha256))
    if theirs["failures"]:
        here.execute(sa.insert(t.FAILURES), theirs["failures"])


def _overruled(
    here: sa.Connection, sha256: str, name: str, before: Mapping[str, Mapping[str, Any]], said: Sequence[Row]
) -> list[str]:
    """Sentences for annotations on which people decided in both stores, and not the same."""
    people: dict[str, Row] = {}
    for row in sorted(said, key=lambda row: (row["decided_at"], row["id"])):
        if row["kind"] == "human" and row["verdict"] != "skip":
            people[row["annotation_id"]] = row
    conflicts = []
    for row, _ in states(here, sha256):
        mine, theirs = before.get(row["id"]), people.get(row["id"])
        if mine is None or theirs is None or mine["decided_by"] != "human":
            continue
        if mine["verdict"] != theirs["verdict"] or (
            mine["edit"] or theirs["pose_after"] or theirs["cad_after"]
        ):
            conflicts.append(
                f"annotation {row['id'][:12]} of {name} was decided by people in both stores "
                f"({mine['verdict']} here, {theirs['verdict']} by {theirs['author']} there): "
                f"{row['verdict']} is the later one and holds"
            )
    return conflicts


def _failures(here: sa.Connection, there: sa.Connection) -> None:
    """Photos that failed there and were annotated nowhere."""
    p, f = t.PHOTOS.c, t.PHOTO_FAILURES.c
    for row in fetch(there, sa.select(t.PHOTO_FAILURES).order_by(f.name)):
        done = sa.select(p.sha256).where(sa.or_(p.name == row["name"], p.sha256 == row["sha256"]))
        if here.scalar(done.limit(1)) is not None:
            continue
        mine = next(iter(fetch(here, sa.select(t.PHOTO_FAILURES).where(f.name == row["name"]))), None)
        if mine is None or (mine["failed_at"], mine["attempts"]) < (row["failed_at"], row["attempts"]):
            attempts = max(row["attempts"], 0 if mine is None else mine["attempts"])
            put_failure(here, {**row, "attempts": attempts}, attempts)
