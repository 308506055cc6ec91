"""Labelled photographs: the project's own label files and readers of published data sets."""
