"""The store's tables: typed columns to query by, and the JSON that gives every document back exactly.

Nothing here is SQLite's own, so that other databases can hold the same tables.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    Boolean,
    CheckConstraint,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
    false,
)

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
    CheckConstraint("width > 0 AND height > 0", name="size"),
)


def _photo() -> Column[str]:
    return Column("photo_sha256", ForeignKey(PHOTOS.c.sha256, ondelete="CASCADE"), nullable=False)


def _box() -> list[Column[float]]:
    return [Column(name, Float(53), nullable=False) for name in ("box_x0", "box_y0", "box_x1", "box_y1")]


def _angles() -> list[Column[float]]:
    return [Column(name, Float(53), nullable=False) for name in ("azimuth", "elevation", "inplane")]


def _flags() -> list[Column[bool]]:
    names = ("truncated", "tiny", "unsure")
    return [Column(name, Boolean, nullable=False, server_default=false()) for name in names]


ANNOTATIONS = Table(
    "annotations",
    metadata,
    # Digest of the photo's digest, the position and the annotation without its timings.
    Column("id", String(64), primary_key=True),
    _photo(),
    Column("position", Integer, nullable=False),
    Column("category", Text, nullable=False, index=True),
    Column("score", Float(53), nullable=False),
    Column("source", Text, nullable=False),
    *_box(),
    *_angles(),
    Column("focal_px", Float(53), nullable=False),
    Column("principal_x", Float(53), nullable=False),
    Column("principal_y", Float(53), nullable=False),
    Column("t_z", Float(53), nullable=False),
    Column("cad_id", Text, nullable=False, index=True),
    Column("cad_name", Text, nullable=False),
    Column("box_iou", Float(53), nullable=False),
    Column("mask_iou", Float(53)),
    Column("cad_probability", Float(53)),
    Column("none_probability", Float(53)),
    Column("cad_needs_review", Boolean, nullable=False, server_default=false()),
    *_flags(),
    Column("document", JSON, nullable=False),
    UniqueConstraint("photo_sha256", "position"),
)

CANDIDATES = Table(
    "candidates",
    metadata,
    Column("annotation_id", ForeignKey(ANNOTATIONS.c.id, ondelete="CASCADE"), primary_key=True),
    Column("rank", Integer, primary_key=True),
    Column("cad_id", Text, nullable=False, index=True),
    Column("cad_name", Text, nullable=False),
    Column("cad_category", Text, nullable=False),
    Column("score", Float(53), nullable=False),
    *_angles(),
    Column("measures", JSON, nullable=False),
    Column("probability", Float(53)),
)

HYPOTHESES = Table(
    "hypotheses",
    metadata,
    Column("annotation_id", ForeignKey(ANNOTATIONS.c.id, ondelete="CASCADE"), primary_key=True),
    Column("rank", Integer, primary_key=True),
    *_angles(),
    Column("score", Float(53), nullable=False),
    Column("probability", Float(53), nullable=False),
    Column("expected_error", Float(53)),
    Column("needs_review", Boolean, nullable=False, server_default=false()),
)

FAILURES = Table(
    "failures",
    metadata,
    Column("photo_sha256", ForeignKey(PHOTOS.c.sha256, ondelete="CASCADE"), primary_key=True),
    Column("position", Integer, primary_key=True),
    Column("category", Text, nullable=False),
    Column("score", Float(53), nullable=False),
    *_box(),
    Column("stage", Text, nullable=False),
    Column("reason", Text, nullable=False),
    *_flags(),
    Column("document", JSON, nullable=False),
    Index("ix_failures_category", "category"),
)

#: Columns that stores made by earlier versions lack: null, or with a default, so that they can be added.
ADDED_LATER: tuple[Column[Any], ...] = (
    HYPOTHESES.c.expected_error,
    HYPOTHESES.c.needs_review,
    ANNOTATIONS.c.cad_probability,
    ANNOTATIONS.c.none_probability,
    ANNOTATIONS.c.cad_needs_review,
    CANDIDATES.c.probability,
    *(table.c[name] for table in (ANNOTATIONS, FAILURES) for name in ("truncated", "tiny", "unsure")),
)
