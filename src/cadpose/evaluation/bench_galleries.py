"""Templates of CAD models made from nothing: models a minute of one core."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import Lite0
from cadpose.pipeline import Annotator
from cadpose.rotation.gallery import GalleryStore
from cadpose.rotation.grid import grid_rotations


@dataclass(frozen=True)
class GalleriesTiming:
    """How quickly galleries are made.

    Attributes:
        models: How many were made.
        views: Of each.
        per_minute: Models a minute of one core's time.
        encoding: Share of that time which the encoder takes.
    """

    models: int
    views: int
    per_minute: float
    encoding: float


class _Timed(Lite0):
    """Adds up its own CPU time."""

    def __init__(self) -> None:
        super().__init__(threads=1)
        self.seconds = 0.0

    def stride16(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """As Lite0's."""
        start = time.thread_time()
        try:
            return super().stride16(images)
        finally:
            self.seconds += time.thread_time() - start

    def stride32(self, stride16: NDArray[np.float32]) -> NDArray[np.float32]:
        """As Lite0's."""
        start = time.thread_time()
        try:
            return super().stride32(stride16)
        finally:
            self.seconds += time.thread_time() - start


def bench_galleries(annotator: Annotator, models: int) -> GalleriesTiming:
    """Make galleries in a temporary folder; loading the meshes is not counted.

    The models are evenly spread over the library. Time is this process's on a core and not the clock's, so
    that other work counts less.

    Raises:
        ValueError: ``models`` is below 1.
        LibraryError: a model cannot be read.
    """
    if models < 1:
        raise ValueError(f"models must be at least 1, got {models}")
    library = annotator.library
    every = library.models()
    chosen = every[:: -(-len(every) // models)]
    for cad in chosen:
        annotator.render_framed(cad, grid_rotations()[:1])
    encoder = _Timed()
    with tempfile.TemporaryDirectory() as folder:
        store = GalleryStore(Path(folder), encoder, annotator.render_framed, annotator.renderer.name)
        store.get(chosen[0])
        store.path(chosen[0]).unlink()
        encoder.seconds, start = 0.0, time.process_time()
        for cad in chosen:
            store.get(cad)
        seconds = time.process_time() - start
    return GalleriesTiming(
        len(chosen), len(grid_rotations()), 60.0 * len(chosen) / seconds, encoder.seconds / seconds
    )
