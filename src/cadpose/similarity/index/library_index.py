"""The view index of a library: which models look most like the object in a photo, among all of them."""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import lite0
from cadpose.errors import InputError, LibraryError
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.library.class_map import category_from_name
from cadpose.library.storage import sha256_of
from cadpose.photos import crop_square
from cadpose.records import CadModel, Detection, Photo, Rotation, RotationHypothesis
from cadpose.rendering.raster import Rasteriser
from cadpose.similarity.embedding import SIDE, ViewEmbedder
from cadpose.similarity.index.build import IndexReport, LibrarySource, build_index
from cadpose.similarity.index.describe import ViewDescriber, made_with
from cadpose.similarity.index.grid import ViewGrid
from cadpose.similarity.index.segments import Entry, Segment, SegmentStore
from cadpose.similarity.index.vectors import VectorIndex
from cadpose.similarity.local_features import BACKGROUND
from cadpose.similarity.small_maps import SmallMaps, compare, describe_crop

log = logging.getLogger(__name__)

#: What the cosine of the embeddings counts beside the score of the small maps.
COSINE_WEIGHT = 1.0
#: Views of a model whose small maps are compared, where the rotation is not known.
_VIEWS_COMPARED = 4
#: So many models are ranked again, however few are wanted.
_TOP = 50
#: How many rotations a search takes at most, and how probable they are together before it takes no more.
_MOST_ROTATIONS, _ENOUGH = 3, 0.9


@dataclass(frozen=True, slots=True)
class Match:
    """One model that was found.

    Attributes:
        cad: Its id.
        category: Library category.
        score: What the matches are ranked by; comparable within one query only.
        cosine: Of the embeddings, best view.
        rotation: The view that matches best.
    """

    cad: str
    category: str
    score: float
    cosine: float
    rotation: Rotation


class LibraryIndex:
    """An index that is there, ready to be asked. Make one with `open`, after `build` or by it.

    Attributes:
        folder: Where it is.
        grid: From where its models are seen.
        vectors: Its embeddings.
    """

    def __init__(
        self, folder: Path, store: SegmentStore, embedder: ViewEmbedder, device: str = "cpu"
    ) -> None:
        self.folder = folder
        self._embedder = embedder
        self._encoder = lite0(device)
        try:
            told = self._settings = store.settings
            self.grid = ViewGrid(int(told["azimuths"]), tuple(map(float, told["elevations"])))
        except (KeyError, TypeError, ValueError) as error:
            raise LibraryError(
                f"The view index {folder} does not tell how it was made; delete it and run "
                "`cadpose library index`."
            ) from error
        now = made_with(embedder, Rasteriser())
        other = sorted(key for key, value in now.items() if told.get(key) != value)
        if other and other != ["embedding"]:
            raise LibraryError(
                f"The view index {folder} was made with other settings ({', '.join(other)}); delete it and "
                "run `cadpose library index`."
            )
        if other:
            raise LibraryError(
                f"The view index {folder} was made with another network; delete it and run "
                "`cadpose library index`, or name that network with --embedding."
            )
        self._segments: list[Segment] = store.read_all()
        self._entries = [entry for segment in self._segments for entry in segment.entries]
        self._starts = np.cumsum([0, *(len(segment.entries) for segment in self._segments)])
        self.vectors = VectorIndex(
            [segment.embeddings for segment in self._segments], [entry.category for entry in self._entries]
        )

    def __len__(self) -> int:
        return len(self._entries)

    @cached_property
    def digest(self) -> str:
        """Changes whenever a model is added, changed or leaves, or views are kept in another way."""
        told = [json.dumps(self._settings, sort_keys=True)]
        told += sorted(f"{e.id}\t{e.category}\t{e.sha256}" for e in self._entries)
        return sha256_of("\n".join(told).encode())

    @property
    def categories(self) -> set[str]:
        """Those of its models."""
        return {entry.category for entry in self._entries}

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Its models, in the order of their rows."""
        return tuple(self._entries)

    @classmethod
    def open(cls, folder: Path, embedder: ViewEmbedder, device: str = "cpu") -> Self:
        """Open an index.

        Raises:
            LibraryError: there is none, it is damaged, or it was made with another network or settings.
            DependencyError: FAISS is not installed.
        """
        return cls(folder, SegmentStore.open(folder), embedder, device)

    @staticmethod
    def build(
        library: Library,
        embedder: ViewEmbedder,
        folder: Path | None = None,
        *,
        grid: ViewGrid | None = None,
        categories: Collection[str] | None = None,
        workers: int = 1,
        device: str = "cpu",
    ) -> IndexReport:
        """Make the index of a library, or bring it up to date; see :func:`build_index`."""
        describer = ViewDescriber(embedder, grid, device)
        return build_index(
            folder or index_folder(library),
            LibrarySource(library),
            describer,
            categories=categories,
            workers=workers,
        )

    def query(
        self,
        rgb: NDArray[np.uint8],
        box: Box,
        *,
        category: str | None = None,
        rotations: Sequence[Rotation] = (),
        top: int = 50,
        rerank: bool = True,
    ) -> list[Match]:
        """The models most like the object in a box of a photo, best first.

        The embeddings choose ``top`` models, the small maps of their views rank them.

        Args:
            rgb: (H, W, 3) uint8 photo.
            box: The object.
            category: Only models of this category; of all if None.
            rotations: How the object may be turned: only views near one of these take part; all if empty.
            top: How many models at most.
            rerank: Rank them by their small maps too, not by the embeddings alone.

        Raises:
            InputError: the box lies outside the photo.
            ValueError: ``top`` is below 1.
        """
        if top < 1:
            raise ValueError(f"top must be at least 1, got {top}")
        try:
            query = self._embedder.crop(rgb, box)
        except ValueError as error:
            raise InputError(str(error)) from None
        views = self.grid.nearest(rotations)
        rows, cosines = self.vectors.search(query, views, category, top)
        if not len(rows):
            return []
        best, scores = cosines.argmax(axis=1), cosines.max(axis=1).astype(np.float64)
        if rerank:
            # Without a rotation, or with several, a model's views that look most alike stand for the others.
            shown = np.argsort(-cosines, axis=1, kind="stable")[:, :_VIEWS_COMPARED]
            photo = describe_crop(crop_square(rgb, box, SIDE, fill=BACKGROUND), self._encoder)
            maps = self._maps(rows, views[shown])
            alike = compare(photo, maps, box.width / box.height).reshape(shown.shape)
            best = np.take_along_axis(shown, alike.argmax(axis=1)[:, None], axis=1)[:, 0]
            scores = alike.max(axis=1) + COSINE_WEIGHT * scores
        order = np.argsort(-scores, kind="stable")
        return [
            Match(
                self._entries[rows[i]].id,
                self._entries[rows[i]].category,
                float(scores[i]),
                float(cosines[i].max()),
                Rotation(*self.grid.angles[views[best[i]]]),
            )
            for i in order
        ]

    def candidates(
        self,
        library: Library,
        photo: Photo,
        detection: Detection,
        hypotheses: Sequence[RotationHypothesis],
        count: int,
    ) -> tuple[CadModel, ...]:
        """The models of an object's category that look most like it; what cannot be read is passed over.

        Args:
            library: The library that the index was made of; models that have left it since are left out.
            photo: The photo.
            detection: Box and category of the object.
            hypotheses: How it may be turned, best first.
            count: How many models at most.

        Raises:
            InputError: the box lies outside the photo.
            LibraryError: the index has no model of the category, or none that can be read.
        """
        told = detection.category
        category = told if told in self.categories else category_from_name(told) or told
        rotations = self.likely_rotations(hypotheses)
        matches = self.query(
            photo.rgb, detection.box, category=category, rotations=rotations, top=max(_TOP, count)
        )
        kept: list[CadModel] = []
        for match in matches:
            if len(kept) == count:
                break
            try:
                cad = library.get(match.cad)
                library.mesh(cad)
                kept.append(cad)
            except LibraryError as error:
                log.warning("%s is passed over: %s", match.cad, error)
        if not kept:
            raise LibraryError(
                f"The view index {self.folder} has no CAD model of category {category!r} that can be read; "
                "run `cadpose library index`."
            )
        return tuple(kept)

    @staticmethod
    def likely_rotations(hypotheses: Sequence[RotationHypothesis]) -> list[Rotation]:
        """The rotations to search at: the first ones, until together they are right nine times in ten."""
        kept: list[Rotation] = []
        chance = 0.0
        for hypothesis in hypotheses[:_MOST_ROTATIONS]:
            kept.append(hypothesis.rotation)
            chance += hypothesis.probability
            if chance >= _ENOUGH:
                break
        return kept

    def _maps(self, rows: NDArray[np.int64], views: NDArray[np.int64]) -> SmallMaps:
        """The small maps of (K,) models at (K, k) views, K x k of them."""
        cells, aspects = [], []
        for row, wanted in zip(rows, views, strict=True):
            number = int(np.searchsorted(self._starts, row, side="right")) - 1
            segment, at = self._segments[number], int(row - self._starts[number])
            cells.append(segment.cells[at, wanted])
            aspects.append(segment.aspects[at, wanted])
        return SmallMaps(np.concatenate(cells), np.concatenate(aspects))


def index_folder(library: Library) -> Path:
    """Where a library's index is kept unless told otherwise."""
    return library.path / "view-index"
