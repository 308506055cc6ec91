"""The annotation database behind :mod:`cadpose.annotations.store`: SQLite or PostgreSQL, the same tables."""
