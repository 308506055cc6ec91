"""What Alembic runs: the migrations in the transaction of a connection that it is given."""

from __future__ import annotations

from alembic import context

from cadpose.annotations.database.tables import VERSION_TABLE, metadata

connection = context.config.attributes.get("connection")
if connection is None:
    raise RuntimeError("migrations run through `cadpose db migrate`, which holds the lock and keeps a copy")
# The first revision of a store carried no number, so the row may be missing.
context.configure(
    connection=connection,
    target_metadata=metadata,
    version_table=VERSION_TABLE,
    transactional_ddl=True,
    render_as_batch=True,
)
# No transaction of Alembic's own: ours holds the lock, and takes everything back should anything fail.
context.run_migrations()
