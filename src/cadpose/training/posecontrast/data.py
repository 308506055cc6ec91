"""Labelled photos to batches: which labels the method uses, in which order, cropped by several threads."""

from __future__ import annotations

import hashlib
import itertools
import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.datasets.labels import Label, object_in_photo, read_labels
from cadpose.errors import InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.rotation.bins import angles_from_labels
from cadpose.training.posecontrast.augment import Views, plain_view, training_views

#: Batches that are read while the network works.
_AHEAD = 2


@dataclass(frozen=True, eq=False)
class Batch:
    """One step's crops of B photos.

    Attributes:
        images: (4, B, 224, 224, 3) uint8: query, turned, mirrored, positive.
        lighting: (4, B, 3) float32, to be added to the normalised channels.
        labels: (3, B, 3) int64 of query, turned and mirrored.
    """

    images: NDArray[np.uint8]
    lighting: NDArray[np.float32]
    labels: NDArray[np.int64]

    def rotations(self) -> FloatArray:
        """(B, 3, 3) ``R_cv_from_s`` of the queries."""
        return rotation_from_angles(*angles_from_labels(self.labels[0]).T)


def training_labels(path: Path) -> list[Label]:
    """The labels that are trained on, as the method chooses them.

    Left out are those without a rotation, those seen from straight above, those marked difficult, and
    those of another split than ``train``.

    Raises:
        InputError: the file cannot be used, or fewer than two labels are left.
    """
    labels = [
        label
        for label in read_labels(path)
        if label.rotation is not None
        and label.rotation.elevation < 90.0
        and not label.difficult
        and label.split in (None, "train")
    ]
    if len(labels) < 2:
        raise InputError(
            f"{path}: {len(labels)} labels can be trained on; at least 2 must have azimuth and elevation, "
            "not be difficult, and be of split train if they have one"
        )
    return labels


def validation_labels(path: Path) -> list[Label]:
    """The labels that are measured on: with a rotation, whole, unoccluded, not of split ``train``.

    Raises:
        InputError: the file cannot be used, or nothing is left.
    """
    labels = [
        label
        for label in read_labels(path)
        if label.rotation is not None
        and not (label.difficult or label.occluded or label.truncated)
        and label.split != "train"
    ]
    if not labels:
        raise InputError(
            f"{path}: holds nothing to measure on: no label has azimuth and elevation, is neither difficult, "
            "occluded nor truncated, and is of another split than train"
        )
    return labels


def digest(labels: Sequence[Label]) -> str:
    """What tells one training set from another: names of photos, boxes, rotations."""
    told = [(label.photo.name, label.category, label.box, label.rotation) for label in labels]
    return hashlib.sha256(repr(told).encode("utf-8", "backslashreplace")).hexdigest()


def training_batches(
    labels: Sequence[Label], batch_size: int, seed: int, epoch: int, workers: int
) -> Iterator[Batch]:
    """The batches of one epoch in random order, what does not fill a batch left out.

    Order and augmentation depend on seed, epoch and the label's place alone, not on threads or on where
    a training was interrupted.

    Raises:
        InputError: a photo cannot be used.
    """
    order = np.random.default_rng((seed, epoch)).permutation(len(labels))

    def views(index: int) -> Views:
        label = labels[index]
        photo, box = object_in_photo(label)
        assert label.rotation is not None  # training_labels left the others out
        return training_views(photo.rgb, box, label.rotation, np.random.default_rng((seed, epoch, index)))

    steps = [order[i : i + batch_size].tolist() for i in range(0, len(order) - batch_size + 1, batch_size)]
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        waiting: deque[list[Future[Views]]] = deque()
        coming = iter(steps)
        try:
            for _ in steps:
                for step in itertools.islice(coming, _AHEAD + 1 - len(waiting)):
                    waiting.append([pool.submit(views, i) for i in step])
                done = [future.result() for future in waiting.popleft()]
                yield Batch(
                    np.stack([v.images for v in done], axis=1),
                    np.stack([v.lighting for v in done], axis=1),
                    np.stack([v.labels for v in done], axis=1),
                )
        finally:
            for future in itertools.chain.from_iterable(waiting):
                future.cancel()


def plain_batches(labels: Sequence[Label], batch_size: int, workers: int) -> Iterator[NDArray[np.uint8]]:
    """(B, 224, 224, 3) crops in the labels' order, unchanged.

    Raises:
        InputError: a photo cannot be used.
    """

    def view(label: Label) -> NDArray[np.uint8]:
        photo, box = object_in_photo(label)
        return plain_view(photo.rgb, box)

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        for i in range(0, len(labels), batch_size):
            yield np.stack(list(pool.map(view, labels[i : i + batch_size])))
