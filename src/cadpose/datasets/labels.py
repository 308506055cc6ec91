"""Label files: photographs with what is true of them, as one JSON array or as JSONL, one object a line.

Each entry names a ``photo`` (relative to the label file) and a ``category`` (or a word for it). What else
may be known is listed in docs/datasets.md; other keys are ignored.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from cadpose.datasets.files import json_lines, read_json
from cadpose.datasets.label import Label, RunLengths, mask_in_photo, object_in_photo
from cadpose.datasets.label_json import entry_from_label, label_from_entry, library_category
from cadpose.errors import InputError
from cadpose.library.storage import write_atomic

__all__ = [
    "Label", "RunLengths", "iter_labels", "mask_in_photo", "object_in_photo", "only_unoccluded",
    "read_labels", "write_labels",
]  # fmt: skip

#: Endings that mean one object a line.
JSONL_SUFFIXES = frozenset({".jsonl", ".ndjson"})


def read_labels(path: Path, category: str | None = None, split: str | None = None) -> list[Label]:
    """Read a label file, optionally one category, which may be a word for it ("motorcycle"), or one split.

    Raises:
        InputError: the file cannot be read, is no label file, an entry is wrong, or nothing is left.
    """
    wanted = None if category is None else library_category(category)
    chosen: list[Label] = []
    categories, splits = set(), set()
    for label in iter_labels(path):
        categories.add(label.category)
        if wanted not in (None, label.category):
            continue
        splits.add(label.split or "none")
        if split in (None, label.split):
            chosen.append(label)
    if not categories:
        raise InputError(f"{path}: holds no label, add one object a photo")
    if not splits:
        found = ", ".join(sorted(categories))
        raise InputError(f"{path}: no label of category {category!r}; it has {found}")
    if not chosen:
        raise InputError(f"{path}: no label of split {split!r}; it has {', '.join(sorted(splits))}")
    return chosen


def only_unoccluded(labels: Iterable[Label], path: Path) -> list[Label]:
    """The labels that published class means count: neither occluded nor truncated.

    Raises:
        InputError: none is left; the message names ``path``.
    """
    kept = [label for label in labels if not (label.occluded or label.truncated)]
    if not kept:
        raise InputError(f"{path}: every label is occluded or truncated, leave out --unoccluded")
    return kept


def iter_labels(path: Path) -> Iterator[Label]:
    """Every label of a file in order; JSONL is read line by line.

    Raises:
        InputError: the file cannot be read, is no label file, or an entry is wrong.
    """
    if path.suffix.lower() in JSONL_SUFFIXES:
        for number, entry in json_lines(path):
            yield label_from_entry(entry, f"{path}: line {number}", path.parent)
        return
    entries = read_json(path)
    if not isinstance(entries, list):
        raise InputError(f"{path}: expected a JSON array of labels, found {type(entries).__name__}")
    for i, entry in enumerate(entries):
        yield label_from_entry(entry, f"{path}: entry {i}", path.parent)


def write_labels(path: Path, labels: Iterable[Label]) -> int:
    """Write JSONL, paths relative to its folder; the file is whole or not there.

    Returns:
        How many labels were written.

    Raises:
        InputError: the name does not end in .jsonl, so it would not be read as what it is.
        OSError: it cannot be written.
    """
    if path.suffix.lower() not in JSONL_SUFFIXES:
        raise InputError(f"{path}: labels are written as JSONL, give a name that ends in .jsonl")
    folder = path.parent.resolve()

    @cache  # many photos share a folder
    def resolved(parent: Path) -> Path:
        return parent.resolve()

    def relative(target: Path) -> str:
        # Links are followed, for ".." goes up from where a folder really is.
        real = resolved(target.parent) / target.name
        try:
            return Path(os.path.relpath(real, folder)).as_posix()
        except ValueError:  # another drive
            return real.as_posix()

    lines = [json.dumps(entry_from_label(label, relative)) for label in labels]
    write_atomic(path, "".join(f"{line}\n" for line in lines).encode("ascii"))
    return len(lines)
