"""Decisions: who said what of an annotation, and when. Nothing is ever taken back, only said anew."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.editing import region_json, region_of
from cadpose.annotations.database.engine import fetch, insert_new, lock_photos
from cadpose.annotations.database.results import (
    VERDICTS,
    Author,
    ConflictError,
    DecisionVerdict,
    Region,
    StoredDecision,
)
from cadpose.annotations.database.rows import Row, add_cad, cad_json, ordered, short_digest
from cadpose.annotations.database.settling import settle
from cadpose.annotations.parts import CadPart, plain_text
from cadpose.annotations.pose_parts import pose_json, pose_of
from cadpose.errors import InputError
from cadpose.records import CadModel, Pose4Dof


def decide(
    connection: sa.Connection,
    annotation_id: str,
    verdict: DecisionVerdict,
    author: Author,
    expected_version: int | None,
    *,
    reason: str = "",
    note: str = "",
    pose: Pose4Dof | None = None,
    cad: CadModel | None = None,
    region: Region | None = None,
    measures: Mapping[str, float] | None = None,
) -> int:
    """Write a decision; see ``Store.decide``."""
    if verdict not in VERDICTS:
        raise InputError(f"a verdict is one of {', '.join(VERDICTS)}, not {verdict!r}")
    changed = pose is not None or cad is not None or region is not None
    if changed != (verdict == "edit"):
        raise InputError(
            "the verdict edit needs a pose, a CAD model or a region, and no other verdict takes one"
        )
    a = t.ANNOTATIONS.c
    photo = connection.scalar(sa.select(a.photo_sha256).where(a.id == annotation_id))
    if photo is None:
        raise InputError(f"the store holds no annotation {annotation_id}")
    # Held until the end: what is read from here on nobody changes.
    lock_photos(connection, [photo])
    (row,) = fetch(connection, sa.select(t.ANNOTATIONS).where(a.id == annotation_id))
    last = _last(connection, annotation_id)
    _refuse_stale(row, last, author, expected_version)
    if region is not None:
        _refuse_outside(connection, photo, region)
    cads: dict[str, Row] = {}
    after = None if cad is None else add_cad(cads, CadPart.of(cad).model_dump(mode="json"))
    insert_new(connection, t.CADS, ordered(cads))
    now = datetime.now(UTC)
    if last is not None and now <= last["decided_at"]:
        # Clocks differ, but what is said later counts later.
        now = last["decided_at"] + timedelta(microseconds=1)
    decision: Row = {
        "annotation_id": annotation_id,
        "kind": author.kind,
        "author": plain_text(author.name),
        "tool": plain_text(author.tool),
        "tool_version": plain_text(author.tool_version),
        "decided_at": now,
        "verdict": verdict,
        "reason": plain_text(reason),
        "note": plain_text(note),
        "pose_before": _current_pose(row),
        "pose_after": None if pose is None else pose_json(pose),
        "cad_before": row["cad_key"],
        "cad_after": after,
        "region_after": None if region is None else region_json(region),
        "measures": {name: float(value) for name, value in measures.items()} if measures else None,
    }
    connection.execute(sa.insert(t.DECISIONS), [{"id": decision_id(decision), **decision}])
    settle(connection, photo, now, [annotation_id])
    version = connection.scalar(sa.select(a.version).where(a.id == annotation_id))
    return int(version or 0)


def decision_id(decision: Mapping[str, Any]) -> str:
    """Key of a row of ``decisions``: digest of everything else in it."""
    told = {name: value for name, value in decision.items() if name != "id"}
    if told.get("region_after") is None:  # decisions of earlier revisions could tell none
        told.pop("region_after", None)
    return short_digest(told | {"decided_at": decision["decided_at"].isoformat()})


def _refuse_stale(
    row: Mapping[str, Any], last: Mapping[str, Any] | None, author: Author, expected: int | None
) -> None:
    name = row["id"][:12]
    if not row["in_force"]:
        raise ConflictError(
            f"annotation {name} is history, another answer holds in its place: load the photo again"
        )
    if expected is not None and expected != row["version"]:
        who = "" if last is None else f", last by {last['author']} ({last['verdict']})"
        raise ConflictError(
            f"annotation {name} was changed meanwhile{who}: load it again and decide anew "
            f"(it has version {row['version']}, not {expected})"
        )
    if author.kind == "program" and row["decided_by"] == "human":
        raise ConflictError(
            f"a person has decided on annotation {name}: {author.name} leaves it as it is ({row['verdict']})"
        )


def _refuse_outside(connection: sa.Connection, photo: str, region: Region) -> None:
    p = t.PHOTOS.c
    width, height = connection.execute(sa.select(p.width, p.height).where(p.sha256 == photo)).one()
    if region.box.clipped(width, height) is None:
        raise InputError(f"the box {region.box.to_tuple()} lies outside the photo of {width} x {height}")
    if region.mask is not None and region.mask.shape != (height, width):
        rows, columns = region.mask.shape
        raise InputError(
            f"the mask of {columns} x {rows} pixels does not fit the photo of {width} x {height}"
        )


def _last(connection: sa.Connection, annotation_id: str) -> Mapping[str, Any] | None:
    d = t.DECISIONS.c
    made = sa.select(t.DECISIONS).where(d.annotation_id == annotation_id)
    return next(iter(fetch(connection, made.order_by(d.decided_at.desc(), d.id.desc()).limit(1))), None)


def _current_pose(row: Mapping[str, Any]) -> dict[str, Any]:
    names = ("azimuth", "elevation", "inplane", "focal_px")
    principal = [row["principal_x"], row["principal_y"]]
    return {**{name: row[name] for name in names}, "principal_px": principal, "t_z": row["t_z"]}


def history(connection: sa.Connection, annotation_id: str) -> list[StoredDecision]:
    """Every decision on an annotation, the first one first."""
    d = t.DECISIONS.c
    made = sa.select(t.DECISIONS).where(d.annotation_id == annotation_id).order_by(d.decided_at, d.id)
    rows = fetch(connection, made)
    keys = {row[name] for row in rows for name in ("cad_before", "cad_after")} - {None}
    found = fetch(connection, sa.select(t.CADS).where(t.CADS.c.key.in_(keys))) if keys else []
    cads = {row["key"]: cad_of(row) for row in found}
    return [
        StoredDecision(
            id=row["id"],
            annotation_id=annotation_id,
            author=Author(row["author"], row["kind"], row["tool"], row["tool_version"]),
            decided_at=row["decided_at"],
            verdict=row["verdict"],
            reason=row["reason"],
            note=row["note"],
            pose_before=None if row["pose_before"] is None else pose_of(row["pose_before"]),
            pose_after=None if row["pose_after"] is None else pose_of(row["pose_after"]),
            cad_before=cads.get(row["cad_before"]),
            cad_after=cads.get(row["cad_after"]),
            region_after=None if row["region_after"] is None else region_of(row["region_after"]),
            measures=row["measures"] or {},
        )
        for row in rows
    ]


def cad_of(row: Mapping[str, Any]) -> CadModel:
    """The record of a row of ``cads``."""
    data = cad_json(row)
    size = data.pop("size_cm")
    return CadModel(**data, size_cm=None if size is None else tuple(size))
