"""Angles, frames, cameras and boxes: numpy only, one convention (docs/conventions.md)."""
