"""What a retrieval evaluation starts from: which photos, which candidates, whose boxes, whose rotations."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cadpose.datasets.gallery import Gallery
from cadpose.datasets.labels import Label, iter_labels, read_labels
from cadpose.datasets.registry import open_dataset
from cadpose.errors import CadposeError, InputError
from cadpose.evaluation.perturbations import Perturbation
from cadpose.geometry.boxes import Box, box_iou
from cadpose.library.catalogue import Library
from cadpose.library.class_map import category_from_name
from cadpose.pipeline import Annotator
from cadpose.records import CadModel, Photo, Rotation

#: Words of ``--split`` that no label has to name.
HALVES = ("all", "odd", "even")
#: A detection is the labelled object from this IoU of the two boxes.
SAME_OBJECT = 0.5
#: By how many pixels the sides of two boxes of the same object may differ in two files.
_SAME_BOX_PX = 1.0

Candidates = Callable[[Label], Sequence[CadModel]]
Boxes = Callable[[Label, Photo, Box], Box]
Rotations = Callable[[Label, Photo, Box, Sequence[CadModel]], Rotation]


class RejectedError(CadposeError):
    """A photo leaves the way as a measured outcome, not because something is broken."""


def choose_labels(
    path: Path,
    category: str | None = None,
    split: str = "all",
    limit: int | None = None,
    kind: str = "labels",
) -> list[Label]:
    """The labels of a file, or of a data set, that name a CAD model.

    Args:
        path: Label file, or the data set's folder.
        category: Only this one, or what a word means.
        split: ``"odd"`` and ``"even"`` are the 1st, 3rd, 5th ... and the 2nd, 4th, 6th ... of each category
            in the file's order; ``"all"`` leaves none out; another word is a split that the labels name.
        limit: At most so many of each category, evenly spread.
        kind: One of :data:`cadpose.datasets.registry.KINDS`.

    Raises:
        InputError: the file cannot be read, nothing is left, or it holds real and synthetic photos.
    """
    part = None if split in HALVES else split
    if kind == "labels":
        read = read_labels(path, category, part)
    else:
        wanted = category and (category_from_name(category) or category)
        read = [
            label for label in open_dataset(kind, path, part) if wanted is None or label.category == wanted
        ]
    named = [label for label in read if label.cad is not None]
    if not named:
        raise InputError(f"{path}: no label names its cad")
    is_synthetic(named, str(path))
    chosen: list[tuple[int, Label]] = []
    for name in sorted({label.category for label in named}):
        own = [(i, label) for i, label in enumerate(named) if label.category == name]
        if split in ("odd", "even"):
            own = own[split == "even" :: 2]
        if limit is not None and len(own) > limit:
            own = [own[int(i)] for i in np.linspace(0, len(own) - 1, limit).round()]
        chosen += own
    if not chosen:
        raise InputError(f"{path}: no label is left, a category with one photo has no even half")
    return [label for _, label in sorted(chosen, key=lambda pair: pair[0])]


def is_synthetic(labels: Sequence[Label], where: str) -> bool:
    """Whether the photos were drawn.

    Raises:
        InputError: some were and others were taken; ``where`` names them.
    """
    drawn = sum(label.synthetic for label in labels)
    if 0 < drawn < len(labels):
        raise InputError(
            f"{where}: holds {drawn} synthetic and {len(labels) - drawn} real photos, which never share a "
            "table: evaluate them apart"
        )
    return drawn > 0


def gallery_candidates(library: Library, gallery: Gallery) -> Candidates:
    """The models that a gallery file names for a label's category, in the file's order.

    Raises:
        InputError: the file names a model under a category that is not its own.
        LibraryError: the library lacks a model of the file.
    """
    by_category: dict[str, list[CadModel]] = {}
    for cad_id in gallery.ids:
        cad = library.get(cad_id)
        named = gallery.category_of.get(cad_id, cad.category)
        if named != cad.category:
            raise InputError(f"{gallery.path}: names {cad_id} under {named}, the library as {cad.category}")
        by_category.setdefault(named, []).append(cad)

    def of(label: Label) -> Sequence[CadModel]:
        found = by_category.get(label.category)
        if not found:
            raise InputError(f"{label.photo}: the gallery has no CAD model of category {label.category!r}")
        return found

    return of


def library_candidates(library: Library, count: int) -> Candidates:
    """The category's representatives, and the true model after them where it is none of them."""

    def of(label: Label) -> Sequence[CadModel]:
        pool = library.representatives(label.category, count)
        if label.cad is None or any(cad.id == label.cad for cad in pool):
            return pool
        true = library.get(label.cad)
        if true.category != label.category:
            raise InputError(f"{label.photo}: is labelled {label.category}, its model {true.category}")
        return (*pool, true)

    return of


def shuffled(cads: Sequence[CadModel], label: Label, seed: int) -> list[CadModel]:
    """The models in an order drawn from the seed and the photo's name, so that equal scores favour nobody."""
    name = zlib.crc32(label.photo.name.encode(errors="backslashreplace"))
    ordered = sorted(cads, key=lambda cad: cad.id)
    return [ordered[i] for i in np.random.default_rng((seed, name)).permutation(len(ordered))]


def labelled_box(label: Label, photo: Photo, box: Box) -> Box:
    """The label's own."""
    return box


def detected_box(annotator: Annotator) -> Boxes:
    """The detector's box of the labelled object, of those in the right place the surest.

    The function raises RejectedError where nothing is found there, or something of another category.
    """

    def of(label: Label, photo: Photo, box: Box) -> Box:
        found = [
            (detection, clipped)
            for detection in annotator.detector.detect(photo)
            if (clipped := detection.box.clipped(photo.width, photo.height)) is not None
            and box_iou(np.array(clipped.to_tuple()), np.array(box.to_tuple())) >= SAME_OBJECT
        ]
        if not found:
            raise RejectedError("no object was found at the labelled box")
        right = [pair for pair in found if pair[0].category == label.category]
        if not right:
            taken = max(found, key=lambda pair: pair[0].score)[0].category
            raise RejectedError(f"{label.category} taken for {taken}")
        return max(right, key=lambda pair: pair[0].score)[1]

    return of


def boxes_in_photos(
    perturbation: Perturbation, boxes: Boxes | None = None
) -> Callable[[Label], tuple[Photo, Box]]:
    """The photo of a label and the box to look at.

    Args:
        perturbation: What is done to photo and labelled box.
        boxes: Takes another box than the labelled one, see `detected_box`; asked once a label.
    """
    kept: dict[tuple[Path, Box | None], Box] = {}

    def of(label: Label) -> tuple[Photo, Box]:
        photo, box = perturbation.object_in_photo(label)
        if boxes is None:
            return photo, box
        key = label.photo, label.box
        if key not in kept:
            kept[key] = boxes(label, photo, box)
        return photo, kept[key]

    return of


def true_rotation(label: Label, photo: Photo, box: Box, cads: Sequence[CadModel]) -> Rotation:
    """The label's own.

    Raises:
        InputError: it has none.
    """
    if label.rotation is None:
        raise InputError(f"{label.photo}: has no labelled rotation, use --rotation predicted")
    return label.rotation


def predicted_rotation(annotator: Annotator, reject_flagged: bool = False) -> Rotations:
    """The estimator's first hypothesis, over the candidates.

    With ``reject_flagged`` the function raises RejectedError where the estimator asks for a review.
    """

    def of(label: Label, photo: Photo, box: Box, cads: Sequence[CadModel]) -> Rotation:
        first = annotator.estimate_rotation(photo, box, label.category, cads)[0]
        if reject_flagged and first.needs_review:
            raise RejectedError("the estimated rotation was flagged for review")
        return first.rotation

    return of


def rotations_of_file(path: Path) -> Rotations:
    """Rotations that a label file names, found by photo, category and box.

    An entry without a box is taken for a label with one if it is the only one of its photo and category.
    The function raises InputError where the file has no rotation for a label's photo.

    Raises:
        InputError: the file cannot be read or is no label file.
    """
    told: dict[Path, list[Label]] = {}
    for entry in iter_labels(path):
        told.setdefault(entry.photo.resolve(), []).append(entry)

    def of(label: Label, photo: Photo, box: Box, cads: Sequence[CadModel]) -> Rotation:
        entries = [e for e in told.get(label.photo.resolve(), []) if e.category == label.category]
        if len(entries) != 1 or entries[0].box is not None:
            entries = [entry for entry in entries if _same(entry.box, label.box)]
        if not entries or (rotation := entries[0].rotation) is None:
            raise InputError(f"{label.photo}: {path.name} has no rotation for it")
        return rotation

    return of


def _same(a: Box | None, b: Box | None) -> bool:
    if a is None or b is None:
        return a is b
    return bool(np.abs(np.subtract(a.to_tuple(), b.to_tuple())).max() <= _SAME_BOX_PX)
