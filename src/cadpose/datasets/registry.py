"""Data sets by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cadpose.datasets.bop import bop
from cadpose.datasets.dataset import DataSet, is_published_test
from cadpose.datasets.imagenet3d import imagenet3d
from cadpose.datasets.labels import read_labels
from cadpose.datasets.objectnet3d import objectnet3d
from cadpose.datasets.pascal3d import pascal3d
from cadpose.datasets.pix3d import pix3d
from cadpose.errors import InputError


def label_file(root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """The project's own label file, JSON or JSONL, as a data set.

    Args:
        root: The file.
        split: Only labels of this split.
        published: Only labels that are not difficult, occluded or truncated; in the split ``train`` only
            difficult ones are left out.

    Raises:
        InputError: the file cannot be read or holds no such label.
    """
    labels = read_labels(root, split=split)
    if published:
        labels = [
            label
            for label in labels
            if is_published_test(label) or (label.split == "train" and not label.difficult)
        ]
    return DataSet("labels", labels, lambda label: iter((label,)))


KINDS: dict[str, Callable[[Path, str | None, bool], DataSet]] = {
    "pascal3d": pascal3d,
    "objectnet3d": objectnet3d,
    "pix3d": pix3d,
    "imagenet3d": imagenet3d,
    "bop": bop,
    "labels": label_file,
}


def open_dataset(kind: str, root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """A data set on disk; its labels are read when it is iterated over.

    Args:
        kind: One of ``KINDS``.
        root: The data set's folder; for ``labels`` the file.
        split: Only this split.
        published: Only the objects that published figures count.

    Raises:
        InputError: there is no such kind or split, or the folder holds no such data set.
    """
    if kind not in KINDS:
        raise InputError(f"there is no data set {kind!r}: choose {', '.join(KINDS)}")
    return KINDS[kind](root, split, published)
