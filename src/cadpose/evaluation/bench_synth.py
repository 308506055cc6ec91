"""Synthetic photos a second of one core's time: drawing alone, and with encoding and writing."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2

from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.training.synth.labels import object_to_json
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.writer import encoded

#: Models that are drawn, spread over the library.
_MODELS = 60


@dataclass(frozen=True)
class SynthTiming:
    """Photos a second of CPU time on one thread.

    Attributes:
        size: Side of the photos in pixels.
        photos: How many were drawn.
        models: How many models were drawn from.
        drawing: Photos a second, drawing alone.
        writing: Photos a second, with labels, JPEG and writing to a temporary folder.
    """

    size: int
    photos: int
    models: int
    drawing: float
    writing: float


def bench_synth(library: Library, photos: int = 240, size: int = 224) -> SynthTiming:
    """Time the rasteriser's photos, every mesh loaded and every kernel compiled before.

    Time of this thread on a core and not the clock's, so that other work counts less; it does all the work.

    Args:
        library: Its models are drawn, sixty at most.
        photos: How many to draw; whole series of twelve are typical.
        size: Side of a photo.

    Raises:
        ValueError: ``photos`` is below 1.
        LibraryError: a model cannot be read.
    """
    if photos < 1:
        raise ValueError(f"photos must be at least 1, got {photos}")
    models = library.models()
    chosen = tuple(m.id for m in models[:: -(-len(models) // _MODELS)])
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        generator = Recipe(library.path, chosen, options=SynthOptions(size=size)).generator()
        for i in range(photos):
            generator.photo(i)
        start = time.thread_time()
        for i in range(photos):
            generator.photo(i)
        drawing = time.thread_time() - start
        with tempfile.TemporaryDirectory(prefix="cadpose-bench-") as folder:
            start = time.thread_time()
            for i in range(photos):
                photo = generator.photo(i)
                write_atomic(Path(folder) / f"{i}.jpg", encoded(photo.rgb, "jpg"))
                for found in photo.objects:
                    object_to_json(found)
            writing = time.thread_time() - start
    finally:
        cv2.setNumThreads(threads)
    return SynthTiming(size, photos, len(chosen), photos / drawing, photos / writing)
