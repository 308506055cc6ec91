"""The store's tables: typed columns to query by, and the JSON that gives every document back exactly.

Nothing here is one database's own, so that SQLite and PostgreSQL hold the same tables. A change of this file
needs a revision in ``annotations/migrations/versions`` and a new ``HEAD``; a test compares the two.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    Boolean,
    CheckConstraint,
    Column,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    TypeDecorator,
    UniqueConstraint,
    false,
    true,
)

#: The newest revision of the tables; :mod:`cadpose.annotations.migrations` leads there from any older one.
HEAD = "0003"

#: Where a store says its revision. Not alembic's own name: a database may hold other programs' tables too.
VERSION_TABLE = "cadpose_revision"


class UtcTime(TypeDecorator[datetime]):
    """A moment with its time zone, also in SQLite, which keeps none: always UTC."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """To UTC."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:
        """In UTC."""
        if not isinstance(value, datetime):
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


# Named constraints, so that migrations can speak of them.
metadata = MetaData(
    naming_convention={
        "ix": "ix_%(column_0_N_label)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
        "pk": "pk_%(table_name)s",
    }
)

PHOTOS = Table(
    "photos",
    metadata,
    Column("sha256", String(64), primary_key=True),
    Column("name", Text, nullable=False),
    Column("width", Integer, nullable=False),
    Column("height", Integer, nullable=False),
    Column("schema_version", String(64), nullable=False),
    # Digest of the document without its timings: equal means that nothing has to be written.
    Column("content_sha256", String(64), nullable=False),
    # When this document was written; unknown of those that came from the first revision.
    Column("written_at", UtcTime),
    CheckConstraint("width > 0 AND height > 0", name="size"),
    # Lists are by name, a page at a time.
    Index("ix_photos_name_sha256", "name", "sha256"),
)

CADS = Table(
    "cads",
    metadata,
    # Digest of what is told here: a model that a library changed is another row.
    Column("key", String(32), primary_key=True),
    Column("id", Text, nullable=False, index=True),
    Column("name", Text, nullable=False),
    Column("category", Text, nullable=False),
    Column("licence", Text, nullable=False),
    Column("creator", Text, nullable=False),
    Column("source", Text, nullable=False),
    Column("width_cm", Float(53)),
    Column("depth_cm", Float(53)),
    Column("height_cm", Float(53)),
    Column("face_count", Integer, nullable=False),
    Column("sha256", Text, nullable=False),
)

PROVENANCES = Table(
    "provenances",
    metadata,
    Column("key", String(32), primary_key=True),
    # The program's version and the library's digest; the document names everything else that took part.
    Column("tool_version", Text, nullable=False),
    Column("library", Text, nullable=False),
    Column("document", JSON, nullable=False),
)


def _photo() -> Column[str]:
    return Column("photo_sha256", ForeignKey(PHOTOS.c.sha256, ondelete="CASCADE"), nullable=False)


def _angles() -> list[Column[float]]:
    return [Column(name, Float(53), nullable=False) for name in ("azimuth", "elevation", "inplane")]


DETECTIONS = Table(
    "detections",
    metadata,
    # Digest of the photo's digest and the detection.
    Column("id", String(32), primary_key=True),
    _photo(),
    Column("category", Text, nullable=False),
    Column("score", Float(53), nullable=False),
    Column("source", Text, nullable=False),
    *(Column(name, Float(53), nullable=False) for name in ("box_x0", "box_y0", "box_x1", "box_y1")),
    *(
        Column(name, Boolean, nullable=False, server_default=false())
        for name in ("truncated", "tiny", "unsure")
    ),
    Column("masked", Boolean, nullable=False, server_default=false()),
    Index("ix_detections_photo_sha256", "photo_sha256"),
)


def _detection() -> Column[str]:
    return Column("detection_id", ForeignKey(DETECTIONS.c.id), nullable=False)


ANNOTATIONS = Table(
    "annotations",
    metadata,
    # Digest of the photo's digest, the position and the annotation without its timings.
    Column("id", String(64), primary_key=True),
    _photo(),
    Column("position", Integer, nullable=False),
    # content_sha256 of the newest document that holds it: the photo's own, or a former one.
    Column("document_sha256", String(64), nullable=False),
    _detection(),
    Column("provenance_key", ForeignKey(PROVENANCES.c.key), nullable=False),
    # Pose and model as they are now, after whatever a person changed; `document` keeps the machine's.
    Column("category", Text, nullable=False),
    *_angles(),
    Column("focal_px", Float(53), nullable=False),
    Column("principal_x", Float(53), nullable=False),
    Column("principal_y", Float(53), nullable=False),
    Column("t_z", Float(53), nullable=False),
    Column("cad_key", ForeignKey(CADS.c.key), nullable=False),
    Column("cad_id", Text, nullable=False),
    Column("box_iou", Float(53), nullable=False),
    Column("mask_iou", Float(53)),
    Column("cad_probability", Float(53)),
    Column("none_probability", Float(53)),
    Column("cad_needs_review", Boolean, nullable=False, server_default=false()),
    Column("confidence", Float(53)),
    # The confidence, or -1 where none is told: what the queue is ordered by.
    Column("priority", Float(53), nullable=False),
    # What the machine said, and what holds now; `decided_by` is human, program or null.
    Column("machine_verdict", Text),
    Column("verdict", Text),
    Column("decided_by", Text),
    Column("edit", JSON(none_as_null=True)),
    # Whether lists and exports give it, and since when they do not; a reviewer's lock.
    Column("in_force", Boolean, nullable=False, server_default=true()),
    Column("superseded_at", UtcTime),
    Column("version", Integer, nullable=False, server_default="1"),
    Column("added_at", UtcTime),
    Column("document", JSON, nullable=False),
    UniqueConstraint("photo_sha256", "document_sha256", "position"),
    # Every list walks one of these in order, however deep it is.
    Index("ix_annotations_queue", "in_force", "priority", "id"),
    Index("ix_annotations_by_verdict", "in_force", "verdict", "priority", "id"),
    Index("ix_annotations_by_category", "in_force", "category", "verdict", "priority", "id"),
    Index("ix_annotations_by_category_only", "in_force", "category", "priority", "id"),
    Index("ix_annotations_by_cad", "in_force", "cad_id", "priority", "id"),
    # Looked up when the detections of a former document are swept.
    Index("ix_annotations_detection_id", "detection_id"),
)


def _annotation() -> Column[str]:
    return Column("annotation_id", ForeignKey(ANNOTATIONS.c.id, ondelete="CASCADE"), primary_key=True)


CANDIDATES = Table(
    "candidates",
    metadata,
    _annotation(),
    Column("rank", Integer, primary_key=True),
    Column("cad_key", ForeignKey(CADS.c.key), nullable=False),
    Column("score", Float(53), nullable=False),
    *_angles(),
    Column("measures", JSON, nullable=False),
    Column("probability", Float(53)),
)

HYPOTHESES = Table(
    "hypotheses",
    metadata,
    _annotation(),
    Column("rank", Integer, primary_key=True),
    *_angles(),
    Column("score", Float(53), nullable=False),
    Column("probability", Float(53), nullable=False),
    Column("expected_error", Float(53)),
    Column("needs_review", Boolean, nullable=False, server_default=false()),
)

DECISIONS = Table(
    "decisions",
    metadata,
    # Digest of everything below: a decision that is merged twice stays one.
    Column("id", String(32), primary_key=True),
    Column("annotation_id", ForeignKey(ANNOTATIONS.c.id), nullable=False),
    Column("kind", String(8), nullable=False),
    Column("author", Text, nullable=False),
    Column("tool", Text, nullable=False),
    Column("tool_version", Text, nullable=False),
    Column("decided_at", UtcTime, nullable=False),
    Column("verdict", String(16), nullable=False),
    Column("reason", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("pose_before", JSON(none_as_null=True)),
    Column("pose_after", JSON(none_as_null=True)),
    Column("cad_before", ForeignKey(CADS.c.key)),
    Column("cad_after", ForeignKey(CADS.c.key)),
    # Box and mask that were set, null where they were left.
    Column("region_after", JSON(none_as_null=True)),
    # box_iou and mask_iou of an edited pose.
    Column("measures", JSON(none_as_null=True)),
    CheckConstraint("kind IN ('human', 'program')", name="kind"),
    CheckConstraint(
        "verdict IN ('accept', 'reject', 'edit', 'auto_accept', 'review', 'skip')", name="verdict"
    ),
    Index("ix_decisions_annotation_id_decided_at", "annotation_id", "decided_at"),
)

FAILURES = Table(
    "failures",
    metadata,
    Column("photo_sha256", ForeignKey(PHOTOS.c.sha256, ondelete="CASCADE"), primary_key=True),
    Column("position", Integer, primary_key=True),
    _detection(),
    Column("category", Text, nullable=False),
    Column("stage", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("document", JSON, nullable=False),
    Index("ix_failures_category", "category"),
    Index("ix_failures_detection_id", "detection_id"),
)

PHOTO_FAILURES = Table(
    "photo_failures",
    metadata,
    Column("name", Text, primary_key=True),
    Column("sha256", String(64), index=True),
    Column("stage", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("failed_at", UtcTime, nullable=False),
)

_versions = MetaData()
#: The one row that tells the revision.
REVISION = Table(VERSION_TABLE, _versions, Column("version_num", String(32), primary_key=True))
