"""The tables as they were before revisions were counted.

Stores made then are taken over: tables are made where there are none, columns added that the earliest of them
lack. Their rows get null or the default.

Revision ID: 0001
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the tables, or complete those of an early store."""
    if "photos" in sa.inspect(op.get_bind()).get_table_names():
        _complete()
    else:
        _create()


def downgrade() -> None:
    """There is nothing before it."""
    raise NotImplementedError("a store is not taken back to before its first revision")


def _flags() -> list[sa.Column[bool]]:
    return [
        sa.Column(name, sa.Boolean, nullable=False, server_default=sa.false())
        for name in ("truncated", "tiny", "unsure")
    ]


def _box() -> list[sa.Column[float]]:
    return [
        sa.Column(name, sa.Float(53), nullable=False) for name in ("box_x0", "box_y0", "box_x1", "box_y1")
    ]


def _angles() -> list[sa.Column[float]]:
    return [sa.Column(name, sa.Float(53), nullable=False) for name in ("azimuth", "elevation", "inplane")]


def _later() -> dict[str, list[sa.Column[Any]]]:
    """Columns that the earliest stores lack."""
    return {
        "hypotheses": [
            sa.Column("expected_error", sa.Float(53)),
            sa.Column("needs_review", sa.Boolean, nullable=False, server_default=sa.false()),
        ],
        "annotations": [
            sa.Column("cad_probability", sa.Float(53)),
            sa.Column("none_probability", sa.Float(53)),
            sa.Column("cad_needs_review", sa.Boolean, nullable=False, server_default=sa.false()),
            *_flags(),
        ],
        "candidates": [sa.Column("probability", sa.Float(53))],
        "failures": [*_flags()],
    }


def _complete() -> None:
    inspector = sa.inspect(op.get_bind())
    for table, columns in _later().items():
        held = {column["name"] for column in inspector.get_columns(table)}
        for column in columns:
            if column.name not in held:
                op.add_column(table, column)


def _create() -> None:
    later = _later()
    op.create_table(
        "photos",
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("name", sa.Text, nullable=False),
        sa.Column("width", sa.Integer, nullable=False),
        sa.Column("height", sa.Integer, nullable=False),
        sa.Column("schema_version", sa.String(64), nullable=False),
        sa.Column("content_sha256", sa.String(64), nullable=False),
        sa.PrimaryKeyConstraint("sha256", name="pk_photos"),
        sa.CheckConstraint("width > 0 AND height > 0", name=op.f("ck_photos_size")),
    )
    op.create_table(
        "annotations",
        sa.Column("id", sa.String(64), nullable=False),
        sa.Column("photo_sha256", sa.String(64), nullable=False),
        sa.Column("position", sa.Integer, nullable=False),
        sa.Column("category", sa.Text, nullable=False),
        sa.Column("score", sa.Float(53), nullable=False),
        sa.Column("source", sa.Text, nullable=False),
        *_box(),
        *_angles(),
        *(
            sa.Column(name, sa.Float(53), nullable=False)
            for name in ("focal_px", "principal_x", "principal_y", "t_z")
        ),
        sa.Column("cad_id", sa.Text, nullable=False),
        sa.Column("cad_name", sa.Text, nullable=False),
        sa.Column("box_iou", sa.Float(53), nullable=False),
        sa.Column("mask_iou", sa.Float(53)),
        *later["annotations"],
        sa.Column("document", sa.JSON, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_annotations"),
        sa.UniqueConstraint("photo_sha256", "position", name="uq_annotations_photo_sha256_position"),
        sa.ForeignKeyConstraint(
            ["photo_sha256"],
            ["photos.sha256"],
            name="fk_annotations_photo_sha256_photos",
            ondelete="CASCADE",
        ),
    )
    op.create_index("ix_annotations_category", "annotations", ["category"])
    op.create_index("ix_annotations_cad_id", "annotations", ["cad_id"])
    op.create_table(
        "candidates",
        sa.Column("annotation_id", sa.String(64), nullable=False),
        sa.Column("rank", sa.Integer, nullable=False),
        sa.Column("cad_id", sa.Text, nullable=False),
        sa.Column("cad_name", sa.Text, nullable=False),
        sa.Column("cad_category", sa.Text, nullable=False),
        sa.Column("score", sa.Float(53), nullable=False),
        *_angles(),
        sa.Column("measures", sa.JSON, nullable=False),
        *later["candidates"],
        sa.PrimaryKeyConstraint("annotation_id", "rank", name="pk_candidates"),
        _of_annotation("candidates"),
    )
    op.create_index("ix_candidates_cad_id", "candidates", ["cad_id"])
    op.create_table(
        "hypotheses",
        sa.Column("annotation_id", sa.String(64), nullable=False),
        sa.Column("rank", sa.Integer, nullable=False),
        *_angles(),
        sa.Column("score", sa.Float(53), nullable=False),
        sa.Column("probability", sa.Float(53), nullable=False),
        *later["hypotheses"],
        sa.PrimaryKeyConstraint("annotation_id", "rank", name="pk_hypotheses"),
        _of_annotation("hypotheses"),
    )
    op.create_table(
        "failures",
        sa.Column("photo_sha256", sa.String(64), nullable=False),
        sa.Column("position", sa.Integer, nullable=False),
        sa.Column("category", sa.Text, nullable=False),
        sa.Column("score", sa.Float(53), nullable=False),
        *_box(),
        sa.Column("stage", sa.Text, nullable=False),
        sa.Column("reason", sa.Text, nullable=False),
        *later["failures"],
        sa.Column("document", sa.JSON, nullable=False),
        sa.PrimaryKeyConstraint("photo_sha256", "position", name="pk_failures"),
        sa.ForeignKeyConstraint(
            ["photo_sha256"], ["photos.sha256"], name="fk_failures_photo_sha256_photos", ondelete="CASCADE"
        ),
    )
    op.create_index("ix_failures_category", "failures", ["category"])


def _of_annotation(table: str) -> sa.ForeignKeyConstraint:
    name = f"fk_{table}_annotation_id_annotations"
    return sa.ForeignKeyConstraint(["annotation_id"], ["annotations.id"], name=name, ondelete="CASCADE")
