"""The files of a run's photos: their bytes, and which of them hold the same ones."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path


def photo_digest(photo: Path) -> str:
    """SHA-256 of a photo's bytes; empty where they cannot be read."""
    try:
        # A pipe or a device would never end.
        if not photo.is_file():
            return ""
        with photo.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""


def file_mark(photo: Path) -> tuple[int, int]:
    """Size and time of last change (ns) of a file; a file of the same mark is taken as unchanged.

    (0, 0) where there is no file.
    """
    try:
        status = photo.stat()
    except (OSError, ValueError):
        return 0, 0
    return status.st_size, status.st_mtime_ns


def same_bytes(photos: Sequence[Path]) -> dict[Path, Path]:
    """Photos that hold the bytes of an earlier one of the sequence, and which one that is.

    Only files of one size are read.
    """
    by_size = defaultdict(list)
    for photo in dict.fromkeys(photos):
        size, _ = file_mark(photo)
        if size:
            by_size[size].append(photo)
    found: dict[Path, Path] = {}
    for crowd in by_size.values():
        if len(crowd) < 2:
            continue
        first: dict[str, Path] = {}
        for photo in crowd:
            digest = photo_digest(photo)
            if digest and first.setdefault(digest, photo) != photo:
                found[photo] = first[digest]
    return found
