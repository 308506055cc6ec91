"""Bringing a photo's rows in line with its documents and decisions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.engine import fetch
from cadpose.annotations.database.rows import Row, pose_columns, short_digest
from cadpose.annotations.database.standing import Standing, Verdict, in_force, settled
from cadpose.poses import Rotation


def settle(connection: sa.Connection, photo_sha256: str, now: datetime, decided: Iterable[str] = ()) -> None:
    """Work out anew what holds of a photo, and write what changed.

    Args:
        connection: A writing transaction.
        photo_sha256: The photo.
        now: Since when what no longer holds does not.
        decided: Keys of annotations whose decisions are others than before; their versions go up.
    """
    moved = set(decided)
    for row, wanted in states(connection, photo_sha256):
        changes = {name: value for name, value in wanted.items() if row[name] != value}
        if not changes and row["id"] not in moved:
            continue
        if "in_force" in changes:
            changes["superseded_at"] = None if changes["in_force"] else now
        a = t.ANNOTATIONS.c
        connection.execute(
            sa.update(t.ANNOTATIONS).where(a.id == row["id"]).values(**changes, version=a.version + 1)
        )


def states(connection: sa.Connection, photo_sha256: str) -> list[tuple[Row, Row]]:
    """(row, what its changeable columns should hold) of every annotation of a photo."""
    a, d, p = t.ANNOTATIONS.c, t.DETECTIONS.c, t.PHOTOS.c
    query = (
        sa.select(
            t.ANNOTATIONS,
            *(d[name] for name in ("box_x0", "box_y0", "box_x1", "box_y1")),
            p.content_sha256,
        )
        .join_from(t.ANNOTATIONS, t.DETECTIONS, a.detection_id == d.id)
        .join(t.PHOTOS, a.photo_sha256 == p.sha256)
        .where(a.photo_sha256 == photo_sha256)
        .order_by(a.position, a.id)
    )
    rows = fetch(connection, query)
    decisions: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    made = (
        sa.select(t.DECISIONS)
        .join_from(t.DECISIONS, t.ANNOTATIONS, t.DECISIONS.c.annotation_id == a.id)
        .where(a.photo_sha256 == photo_sha256)
    )
    for decision in fetch(connection, made):
        decisions[decision["annotation_id"]].append(decision)
    verdicts = {row["id"]: settled(decisions[row["id"]]) for row in rows}
    newest = rows[0]["content_sha256"] if rows else ""
    holding = in_force([_standing(row, verdicts[row["id"]]) for row in rows], newest)
    cads = _cad_ids(connection, verdicts.values())
    return [(row, _wanted(row, verdicts[row["id"]], row["id"] in holding, cads)) for row in rows]


def _standing(row: Mapping[str, Any], verdict: Verdict) -> Standing:
    part = row["document"]
    pose = part["pose"]
    return Standing(
        id=row["id"],
        document=row["document_sha256"],
        box=(row["box_x0"], row["box_y0"], row["box_x1"], row["box_y1"]),
        answer=(row["category"], part["cad"]["id"]),
        rotation=Rotation(pose["azimuth"], pose["elevation"], pose["inplane"]),
        settled=verdict.settled,
        settled_at=verdict.settled_at,
    )


def _cad_ids(connection: sa.Connection, verdicts: Iterable[Verdict]) -> dict[str, str]:
    keys = {v.edit["cad"] for v in verdicts if v.edit is not None and "cad" in v.edit}
    if not keys:
        return {}
    c = t.CADS.c
    return {row.key: row.id for row in connection.execute(sa.select(c.key, c.id).where(c.key.in_(keys)))}


def _wanted(row: Mapping[str, Any], verdict: Verdict, holds: bool, cads: Mapping[str, str]) -> Row:
    part, edit = row["document"], verdict.edit or {}
    key = edit.get("cad")
    return {
        "verdict": verdict.verdict,
        "decided_by": verdict.decided_by,
        "edit": verdict.edit,
        "in_force": holds,
        **pose_columns(edit.get("pose") or part["pose"]),
        "cad_key": short_digest(part["cad"]) if key is None else key,
        "cad_id": part["cad"]["id"] if key is None else cads[key],
    }
