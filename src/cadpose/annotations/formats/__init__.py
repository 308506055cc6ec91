"""Annotations in the formats of other tools: one file a format, its writer and its reader."""
