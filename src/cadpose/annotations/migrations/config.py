"""Alembic's settings, without a file of their own."""

from __future__ import annotations

from pathlib import Path

import sqlalchemy as sa
from alembic.config import Config


def alembic_config(connection: sa.Connection | None = None) -> Config:
    """Settings that lead to this folder; migrations run in the connection's transaction."""
    config = Config()
    # A per cent sign starts a variable in such settings.
    config.set_main_option("script_location", str(Path(__file__).parent).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config
