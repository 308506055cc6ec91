"""What workers of a run need to know, small and picklable: each makes its own annotator of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from cadpose.annotations.store import Store
from cadpose.backends import encoder_on
from cadpose.batch.told import ToldObjects
from cadpose.batch.worker import PhotoWorker
from cadpose.intrinsics import Intrinsics
from cadpose.pipeline import Annotator
from cadpose.similarity.embedding import ViewEmbedder, embedding_network
from cadpose.similarity.index.library_index import LibraryIndex


class Job(Protocol):
    """Makes the workers of a run; pickled into their processes."""

    def open(self) -> PhotoWorker:
        """Load the models and open the store."""
        ...

    def open_store(self) -> Store | None:
        """The store alone, where one is kept."""
        ...


@dataclass(frozen=True)
class AnnotatorOptions:
    """An :class:`Annotator` as the options that make it.

    Attributes:
        library: Its folder; None for the default one.
        index: Folder of a view index that chooses the candidates; None for the representatives.
        embedding: The network that the index was made with; None for the usual one.
        device: ``"cpu"`` or ``"cuda"``.
        detector, masks, estimator, similarity, renderer, align_to, refine, intrinsics, candidates,
            categories, seed: As the annotator's; ``estimator`` is its ``rotation``.
    """

    library: Path | None = None
    detector: str = "embedded"
    masks: str = "network"
    estimator: str = "embedded"
    similarity: str = "joint"
    renderer: str = "raster"
    align_to: str = "box"
    refine: str = "fast"
    intrinsics: Intrinsics | None = None
    candidates: int = 10
    categories: tuple[str, ...] | None = None
    index: Path | None = None
    embedding: Path | None = None
    device: str = "cpu"
    seed: int = 0

    def make(self) -> Annotator:
        """The annotator.

        Raises:
            CadposeError: the library, the index, or something that a stage needs is missing.
        """
        return Annotator(
            self.library,
            detector=self.detector,
            masks=self.masks,
            rotation=self.estimator,
            similarity=self.similarity,
            renderer=self.renderer,
            align_to=self.align_to,
            refine=self.refine,
            intrinsics=self.intrinsics,
            candidates=self.candidates,
            categories=self.categories,
            index=None if self.index is None else self._view_index(self.index),
            device=self.device,
            seed=self.seed,
        )

    def _view_index(self, folder: Path) -> LibraryIndex:
        encoder_on(self.device)  # refuses a device that is not there
        network = ViewEmbedder(embedding_network(self.embedding), self.device)
        return LibraryIndex.open(folder, network, self.device)


@dataclass(frozen=True)
class AnnotateJob:
    """Annotating photos as the command line tells.

    Attributes:
        annotator: How to make the annotator.
        told: The objects that are told in place of the detector.
        store: URL of the store.
    """

    annotator: AnnotatorOptions
    told: ToldObjects | None = None
    store: str | None = None

    def open(self) -> PhotoWorker:
        """Load the models and open the store."""
        annotator = self.annotator.make()
        if self.told is None:
            return PhotoWorker(annotator, store=self.open_store())
        return PhotoWorker(
            annotator,
            detections=self.told.open().detect,
            told=self.told.digest(),
            store=self.open_store(),
        )

    def open_store(self) -> Store | None:
        """The store alone, where one is kept."""
        return None if self.store is None else Store(self.store)
