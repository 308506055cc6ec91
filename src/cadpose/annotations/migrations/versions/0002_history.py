"""Detections, CAD models and provenances as tables of their own; decisions with their history; failed photos.

What the documents say is spread over the new tables. Nothing is lost: they themselves stay as they are.

Revision ID: 0002
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

_BOX = ("box_x0", "box_y0", "box_x1", "box_y1")
_FLAGS = ("truncated", "tiny", "unsure")
_CAD = ("id", "name", "category", "licence", "creator", "source", "face_count", "sha256")
_ROWS = 200


def upgrade() -> None:
    """From the first layout to this one."""
    _make_tables()
    op.add_column("photos", sa.Column("written_at", sa.DateTime(timezone=True)))
    op.create_index("ix_photos_name_sha256", "photos", ["name", "sha256"])
    op.drop_index("ix_annotations_category", "annotations")
    op.drop_index("ix_annotations_cad_id", "annotations")
    op.drop_index("ix_candidates_cad_id", "candidates")
    with op.batch_alter_table("annotations") as batch:
        batch.drop_constraint("uq_annotations_photo_sha256_position", type_="unique")
        for column in _new_columns():
            batch.add_column(column)
    for table, name in (("failures", "detection_id"), ("candidates", "cad_key")):
        op.add_column(table, sa.Column(name, sa.String(32)))
    _fill(op.get_bind())
    _finish()


def downgrade() -> None:
    """A person's decisions have no place in the first layout."""
    raise NotImplementedError("decisions would be lost: go back to the copy that was kept beside the store")


def _new_columns() -> list[sa.Column[Any]]:
    return [
        sa.Column("document_sha256", sa.String(64)),
        sa.Column("detection_id", sa.String(32)),
        sa.Column("provenance_key", sa.String(32)),
        sa.Column("cad_key", sa.String(32)),
        sa.Column("confidence", sa.Float(53)),
        sa.Column("priority", sa.Float(53)),
        sa.Column("machine_verdict", sa.Text),
        sa.Column("verdict", sa.Text),
        sa.Column("decided_by", sa.Text),
        sa.Column("edit", sa.JSON),
        sa.Column("in_force", sa.Boolean, nullable=False, server_default=sa.true()),
        sa.Column("superseded_at", sa.DateTime(timezone=True)),
        sa.Column("version", sa.Integer, nullable=False, server_default="1"),
        sa.Column("added_at", sa.DateTime(timezone=True)),
    ]


def _make_tables() -> None:
    op.create_table(
        "cads",
        sa.Column("key", sa.String(32), nullable=False),
        *(
            sa.Column(name, sa.Text, nullable=False)
            for name in ("id", "name", "category", "licence", "creator", "source")
        ),
        *(sa.Column(name, sa.Float(53)) for name in ("width_cm", "depth_cm", "height_cm")),
        sa.Column("face_count", sa.Integer, nullable=False),
        sa.Column("sha256", sa.Text, nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_cads"),
    )
    op.create_index("ix_cads_id", "cads", ["id"])
    op.create_table(
        "provenances",
        sa.Column("key", sa.String(32), nullable=False),
        sa.Column("tool_version", sa.Text, nullable=False),
        sa.Column("library", sa.Text, nullable=False),
        sa.Column("document", sa.JSON, nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_provenances"),
    )
    op.create_table(
        "detections",
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("photo_sha256", sa.String(64), nullable=False),
        sa.Column("category", sa.Text, nullable=False),
        sa.Column("score", sa.Float(53), nullable=False),
        sa.Column("source", sa.Text, nullable=False),
        *(sa.Column(name, sa.Float(53), nullable=False) for name in _BOX),
        *(
            sa.Column(name, sa.Boolean, nullable=False, server_default=sa.false())
            for name in (*_FLAGS, "masked")
        ),
        sa.PrimaryKeyConstraint("id", name="pk_detections"),
        sa.ForeignKeyConstraint(
            ["photo_sha256"],
            ["photos.sha256"],
            name="fk_detections_photo_sha256_photos",
            ondelete="CASCADE",
        ),
    )
    op.create_index("ix_detections_photo_sha256", "detections", ["photo_sha256"])
    op.create_table(
        "decisions",
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("annotation_id", sa.String(64), nullable=False),
        sa.Column("kind", sa.String(8), nullable=False),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("author", "tool", "tool_version")),
        sa.Column("decided_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("verdict", sa.String(16), nullable=False),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("reason", "note")),
        *(sa.Column(name, sa.JSON) for name in ("pose_before", "pose_after")),
        *(sa.Column(name, sa.String(32)) for name in ("cad_before", "cad_after")),
        sa.Column("measures", sa.JSON),
        sa.PrimaryKeyConstraint("id", name="pk_decisions"),
        sa.ForeignKeyConstraint(
            ["annotation_id"], ["annotations.id"], name="fk_decisions_annotation_id_annotations"
        ),
        *(
            sa.ForeignKeyConstraint([name], ["cads.key"], name=f"fk_decisions_{name}_cads")
            for name in ("cad_before", "cad_after")
        ),
        sa.CheckConstraint("kind IN ('human', 'program')", name=op.f("ck_decisions_kind")),
        sa.CheckConstraint(
            "verdict IN ('accept', 'reject', 'edit', 'auto_accept', 'review', 'skip')",
            name=op.f("ck_decisions_verdict"),
        ),
    )
    op.create_index("ix_decisions_annotation_id_decided_at", "decisions", ["annotation_id", "decided_at"])
    op.create_table(
        "photo_failures",
        sa.Column("name", sa.Text, nullable=False),
        sa.Column("sha256", sa.String(64)),
        sa.Column("stage", sa.Text, nullable=False),
        sa.Column("reason", sa.Text, nullable=False),
        sa.Column("attempts", sa.Integer, nullable=False),
        sa.Column("failed_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_photo_failures"),
    )
    op.create_index("ix_photo_failures_sha256", "photo_failures", ["sha256"])


def _finish() -> None:
    """What can be said only of filled columns, and the columns that moved to other tables."""
    with op.batch_alter_table("annotations") as batch:
        for name in (*_BOX, *_FLAGS, "score", "source", "cad_name"):
            batch.drop_column(name)
        for name, kind in (
            ("document_sha256", sa.String(64)),
            ("detection_id", sa.String(32)),
            ("provenance_key", sa.String(32)),
            ("cad_key", sa.String(32)),
            ("priority", sa.Float(53)),
        ):
            batch.alter_column(name, existing_type=kind, nullable=False)
        batch.create_unique_constraint(
            "uq_annotations_photo_sha256_document_sha256_position",
            ["photo_sha256", "document_sha256", "position"],
        )
        for name, table, key in (
            ("detection_id", "detections", "id"),
            ("provenance_key", "provenances", "key"),
            ("cad_key", "cads", "key"),
        ):
            batch.create_foreign_key(f"fk_annotations_{name}_{table}", table, [name], [key])
    for index, columns in (
        ("ix_annotations_queue", ["in_force", "priority", "id"]),
        ("ix_annotations_by_verdict", ["in_force", "verdict", "priority", "id"]),
        ("ix_annotations_by_category", ["in_force", "category", "verdict", "priority", "id"]),
        ("ix_annotations_by_category_only", ["in_force", "category", "priority", "id"]),
        ("ix_annotations_by_cad", ["in_force", "cad_id", "priority", "id"]),
        ("ix_annotations_detection_id", ["detection_id"]),
    ):
        op.create_index(index, "annotations", columns)
    with op.batch_alter_table("candidates") as batch:
        for name in ("cad_id", "cad_name", "cad_category"):
            batch.drop_column(name)
        batch.alter_column("cad_key", existing_type=sa.String(32), nullable=False)
        batch.create_foreign_key("fk_candidates_cad_key_cads", "cads", ["cad_key"], ["key"])
    with op.batch_alter_table("failures") as batch:
        for name in (*_BOX, *_FLAGS, "score"):
            batch.drop_column(name)
        batch.alter_column("detection_id", existing_type=sa.String(32), nullable=False)
        batch.create_foreign_key(
            "fk_failures_detection_id_detections", "detections", ["detection_id"], ["id"]
        )
    op.create_index("ix_failures_detection_id", "failures", ["detection_id"])


# -- what the documents say ------------------------------------------------------------------------


def _fill(bind: sa.Connection) -> None:
    meta = sa.MetaData()
    names = ("photos", "annotations", "candidates", "failures", "cads", "provenances", "detections")
    tables = {name: sa.Table(name, meta, autoload_with=bind) for name in (*names, "decisions")}
    cads: dict[str, dict[str, Any]] = {}
    provenances: dict[str, dict[str, Any]] = {}
    photos, annotations, failures = tables["photos"], tables["annotations"], tables["failures"]
    for digests in _chunks(bind.scalars(sa.select(photos.c.sha256).order_by(photos.c.sha256)).all()):
        detections: dict[str, dict[str, Any]] = {}
        changed, decided, ranked, failed = [], [], [], []
        query = sa.select(annotations.c.id, annotations.c.document, photos.c.sha256, photos.c.content_sha256)
        query = query.join_from(annotations, photos, annotations.c.photo_sha256 == photos.c.sha256)
        for key, part, sha256, content in bind.execute(query.where(photos.c.sha256.in_(digests))).all():
            try:
                changed.append(_columns(key, part, sha256, content, detections, provenances, cads))
                ranked += [
                    {"b_id": key, "b_rank": candidate["rank"], "cad_key": _cad(cads, candidate["cad"])}
                    for candidate in part["candidates"]
                ]
            except (KeyError, TypeError, AttributeError) as error:
                raise ValueError(f"the document of annotation {key} cannot be read ({error!r})") from None
            if (verdict := part.get("verdict")) is not None:
                decided.append(_decision(key, verdict, part["provenance"]))
        query = sa.select(failures.c.photo_sha256, failures.c.position, failures.c.document)
        for row in bind.execute(query.where(failures.c.photo_sha256.in_(digests))).all():
            found = _detection(detections, row.photo_sha256, row.document["detection"])
            failed.append({"b_sha": row.photo_sha256, "b_position": row.position, "detection_id": found})
        # Foreign keys to cads and provenances come later, so those may be filled last.
        _insert(bind, tables["detections"], detections.values())
        _update(bind, annotations, {"id": "b_id"}, changed)
        _update(bind, tables["candidates"], {"annotation_id": "b_id", "rank": "b_rank"}, ranked)
        _update(bind, failures, {"photo_sha256": "b_sha", "position": "b_position"}, failed)
        _insert(bind, tables["decisions"], decided)
    _insert(bind, tables["cads"], cads.values())
    _insert(bind, tables["provenances"], provenances.values())


def _columns(
    key: str,
    part: dict[str, Any],
    sha256: str,
    content: str,
    detections: dict[str, dict[str, Any]],
    provenances: dict[str, dict[str, Any]],
    cads: dict[str, dict[str, Any]],
) -> dict[str, Any]:
    """The new columns of one annotation."""
    confidence, verdict = part.get("confidence"), part.get("verdict")
    return {
        "b_id": key,
        "document_sha256": content,
        "detection_id": _detection(detections, sha256, part["detection"]),
        "provenance_key": _provenance(provenances, part["provenance"]),
        "cad_key": _cad(cads, part["cad"]),
        "confidence": confidence,
        "priority": -1.0 if confidence is None else confidence,
        "machine_verdict": verdict,
        "verdict": verdict,
        "decided_by": None if verdict is None else "program",
    }


def _chunks(digests: Any) -> Iterator[list[str]]:
    for start in range(0, len(digests), _ROWS):
        yield list(digests[start : start + _ROWS])


def _insert(bind: sa.Connection, table: sa.Table, rows: Iterable[dict[str, Any]]) -> None:
    if listed := list(rows):
        bind.execute(sa.insert(table), listed)


def _update(bind: sa.Connection, table: sa.Table, keys: dict[str, str], rows: list[dict[str, Any]]) -> None:
    if rows:
        where = [table.c[column] == sa.bindparam(name) for column, name in keys.items()]
        values: dict[str, Any] = {name: sa.bindparam(name) for name in rows[0] if name not in keys.values()}
        bind.execute(sa.update(table).where(*where).values(values), rows)


# The digests as this revision defines them, whatever later ones do.


def _digest(*values: Any) -> str:
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _cad(cads: dict[str, dict[str, Any]], cad: dict[str, Any]) -> str:
    key = _digest(cad)
    size = cad["size_cm"] or (None, None, None)
    sizes = dict(zip(("width_cm", "depth_cm", "height_cm"), size, strict=True))
    cads.setdefault(key, {"key": key, **{name: cad[name] for name in _CAD}, **sizes})
    return key


def _provenance(provenances: dict[str, dict[str, Any]], provenance: dict[str, Any]) -> str:
    key = _digest(provenance)
    version, library = provenance.get("cadpose") or "unknown", provenance.get("library") or ""
    told = {"tool_version": str(version), "library": str(library)}
    provenances.setdefault(key, {"key": key, **told, "document": provenance})
    return key


def _detection(detections: dict[str, dict[str, Any]], sha256: str, detection: dict[str, Any]) -> str:
    key = _digest(sha256, detection)
    detections.setdefault(
        key,
        {
            "id": key,
            "photo_sha256": sha256,
            **{name: detection[name] for name in ("category", "score", "source")},
            **dict(zip(_BOX, detection["box"], strict=True)),
            **{name: detection.get(name, False) for name in _FLAGS},
            "masked": detection["mask"] is not None,
        },
    )
    return key


def _decision(annotation_id: str, verdict: str, provenance: dict[str, Any]) -> dict[str, Any]:
    return {
        "id": _digest(annotation_id, "cadpose annotate", verdict),
        "annotation_id": annotation_id,
        "kind": "program",
        "author": "cadpose",
        "tool": "cadpose annotate",
        "tool_version": str(provenance.get("cadpose") or "unknown"),
        "decided_at": datetime.now(UTC),
        "verdict": verdict,
        "reason": "",
        "note": "",
    }
