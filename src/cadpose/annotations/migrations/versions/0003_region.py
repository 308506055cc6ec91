"""Decisions that set another box or mask.

Revision ID: 0003
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """One more column, empty in every decision that was made before."""
    op.add_column("decisions", sa.Column("region_after", sa.JSON))


def downgrade() -> None:
    """A box that a person drew has no place in the earlier layout."""
    raise NotImplementedError("decisions would be lost: go back to the copy that was kept beside the store")
