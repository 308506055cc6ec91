"""Labelled photos and renders of CAD models as the encoders see them."""

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

from cadpose.datasets.labels import Label, mask_in_photo, object_in_photo, read_labels
from cadpose.errors import InputError
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.photos import crop_square
from cadpose.records import CadModel
from cadpose.rendering import Renderer, for_several_threads
from cadpose.similarity.triplet_framing import Framing

#: Side of crops and renders before they are framed, that of the pipeline.
SIDE = 224
#: Photos that are read while the network works.
_AHEAD = 12


@dataclass(frozen=True, eq=False)
class Example:
    """A labelled photo whose CAD model and rotation are known.

    Attributes:
        label: What is true of the photo.
        cad: The true model.
        R_cv_from_s: (3, 3) the true rotation.
    """

    label: Label
    cad: CadModel
    R_cv_from_s: FloatArray


@dataclass(frozen=True, eq=False)
class Shown:
    """One photo with its renders.

    Attributes:
        index: Which example it is.
        models: Numbers of the negatives' models, in order.
        photo: (1, S, S, 3) uint8.
        renders: (1 + N, S, S, 3) uint8, the positive first.
    """

    index: int
    models: tuple[int, ...]
    photo: NDArray[np.uint8]
    renders: NDArray[np.uint8]


def training_examples(path: Path, library: Library) -> list[Example]:
    """The labels that are trained on: with CAD model and rotation, not difficult, of no other split.

    Raises:
        InputError: the file cannot be used, nothing is left, or the library lacks a model.
    """
    return _examples(
        path,
        library,
        [x for x in read_labels(path) if x.split in (None, "train")],
        "trained on: none has cad, azimuth and elevation, is not difficult, and of split train if it has one",
    )


def validation_examples(path: Path, library: Library) -> list[Example]:
    """The labels that are measured on: likewise, but whole, unoccluded, and not of split ``train``.

    Raises:
        InputError: as :func:`training_examples`.
    """
    whole = [x for x in read_labels(path) if not (x.occluded or x.truncated) and x.split != "train"]
    return _examples(
        path,
        library,
        whole,
        "measured on: none has cad, azimuth and elevation, is neither difficult, occluded nor truncated, "
        "and of another split than train",
    )


def _examples(path: Path, library: Library, labels: Sequence[Label], purpose: str) -> list[Example]:
    known = {model.id: model for model in library.models()}
    usable = [x for x in labels if x.cad is not None and x.rotation is not None and not x.difficult]
    if not usable:
        raise InputError(f"{path}: holds nothing that can be {purpose}")
    missing = sorted({x.cad for x in usable if x.cad is not None} - set(known))
    if missing:
        raise InputError(
            f"{path}: names {len(missing)} CAD models that the library {library.path} lacks, as "
            f"{missing[0]!r}: add them, or name the library that was labelled with --library"
        )
    return [
        Example(x, known[x.cad], x.rotation.to_matrix())
        for x in usable
        if x.cad is not None and x.rotation is not None
    ]


def digest(examples: Sequence[Example]) -> str:
    """What tells one training set from another: photos' names, boxes, CAD models, rotations."""
    told = [(x.label.photo.name, x.label.box, x.cad.id, x.label.rotation) for x in examples]
    return hashlib.sha256(repr(told).encode("utf-8", "backslashreplace")).hexdigest()


class Pictures:
    """Draws what the encoders see.

    Args:
        library: Gives meshes; they stay in memory, some 2 MB each, up to a thousand.
        renderer: Draws them.
        framing: How both are shown.
    """

    def __init__(self, library: Library, renderer: Renderer, framing: Framing) -> None:
        library.cache_size = max(library.cache_size, min(len(library.models()), 1000))
        self.library = library
        self.renderer = renderer
        self.framing = framing

    def photo(self, label: Label) -> NDArray[np.uint8]:
        """(S, S, 3) of a labelled photo; its background is there where the label has no mask.

        Raises:
            InputError: photo, mask or box cannot be used.
        """
        photo, box = object_in_photo(label)
        crop = crop_square(photo.rgb, box, SIDE, fill=0)
        mask = mask_in_photo(label, photo) if self.framing.masked else None
        return self.framing.photo(crop, None if mask is None else crop_square(mask, box, SIDE))

    def renders(self, models: Sequence[CadModel], R_cv_from_s: FloatArray) -> NDArray[np.uint8]:
        """(N, S, S, 3) of N models at one (3, 3) rotation.

        Raises:
            LibraryError: a mesh is damaged.
        """
        drawn = []
        for model in models:
            mesh = self.library.mesh(model)
            camera = Cameras.framing(R_cv_from_s, mesh.hull, size=SIDE)
            drawn.append(self.framing.renders(self.renderer.render(mesh, camera)))
        return np.concatenate(drawn)

    def workers(self, wanted: int) -> int:
        """Threads that may draw at once: Blender's worker draws one view at a time."""
        if not for_several_threads(self.renderer.name):
            return 1
        return wanted or os.cpu_count() or 1


def shown(
    examples: Sequence[Example],
    order: Sequence[int],
    negatives: Sequence[Sequence[int]],
    models: Sequence[CadModel],
    pictures: Pictures,
    workers: int,
) -> Iterator[Shown]:
    """Photos with the positive and the negatives, all at the photo's rotation, in order.

    Args:
        examples: Photos.
        order: Which of them, in which order.
        negatives: Of each example, numbers of models.
        models: The library's models by number.
        pictures: Draws them.
        workers: Threads, 0 for one a core.

    Raises:
        InputError: a photo cannot be used.
        LibraryError: a mesh is damaged.
    """

    def one(index: int) -> Shown:
        example, chosen = examples[index], negatives[index]
        cads = [example.cad, *(models[i] for i in chosen)]
        renders = pictures.renders(cads, example.R_cv_from_s)
        return Shown(index, tuple(chosen), pictures.photo(example.label)[None], renders)

    with ThreadPoolExecutor(pictures.workers(workers)) as pool:
        coming, waiting = iter(order), deque[Future[Shown]]()
        try:
            for _ in order:
                for index in itertools.islice(coming, _AHEAD + 1 - len(waiting)):
                    waiting.append(pool.submit(one, index))
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
