"""Revisions of the store's tables, run by Alembic; docs/database.md tells how to add one."""
