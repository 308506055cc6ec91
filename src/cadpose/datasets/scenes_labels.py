"""Label files of the project's own, and data sets that are read into its labels, photo by photo.

Their boxes may be of whole objects, hidden parts included; where run lengths tell what is seen of an
object, as in those of ``cadpose synth``, its box is that of the mask.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from cadpose.datasets.label import Label, RunLengths, mask_in_photo
from cadpose.datasets.scenes import Scene, SceneSet, TrueObject, whole_box
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Mask, Photo


def label_scenes(labels: Iterable[Label], kind: str, name: str) -> SceneSet:
    """Labels gathered by photo, in their order; the data set labels the categories that occur.

    Args:
        labels: Of any photos; those of one photo need not stand together.
        kind: Of the data set.
        name: What to call it.

    Raises:
        InputError: there is no label, or real and synthetic photos are mixed.
    """
    by_photo: dict[Path, list[Label]] = {}
    for label in labels:
        by_photo.setdefault(label.photo, []).append(label)
    if not by_photo:
        raise InputError(f"{name}: holds no label")
    every = [label for own in by_photo.values() for label in own]
    drawn = sum(label.synthetic for label in every)
    if 0 < drawn < len(every):
        raise InputError(
            f"{name}: holds synthetic and real photos, which never share a table: evaluate them apart"
        )
    scenes = [Scene(photo, partial(_objects, own)) for photo, own in by_photo.items()]
    return SceneSet(kind, name, scenes, frozenset(label.category for label in every), drawn > 0)


def _objects(labels: Sequence[Label], photo: Photo) -> list[TrueObject]:
    found = []
    for label in labels:
        box: Box | None = label.box or whole_box(photo)
        if isinstance(label.mask, RunLengths):
            box = Box.from_mask(_mask(label, photo))
        box = None if box is None else box.clipped(photo.width, photo.height)
        if box is None:
            raise InputError(
                f"{label.photo}: a labelled box lies outside the photo, give pixels of this photo"
            )
        found.append(
            TrueObject(
                box,
                label.category,
                box.area,
                ignored=label.difficult,
                mask=None if label.mask is None else partial(_mask, label),
            )
        )
    return found


def _mask(label: Label, photo: Photo) -> Mask:
    mask = mask_in_photo(label, photo)
    assert mask is not None
    return mask
