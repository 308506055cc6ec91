"""What a rotation estimate is made of: milliseconds by part, warm, spread over no threads."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from cadpose.encoder import SIDE, Lite0
from cadpose.evaluation.bench_stages import bench_category
from cadpose.geometry.boxes import Box
from cadpose.photos import crop_square
from cadpose.pipeline import Annotator
from cadpose.records import Photo
from cadpose.rotation.embedded import EmbeddedRotation
from cadpose.rotation.features import describe
from cadpose.rotation.network import RotationNetwork
from cadpose.threads import on_one_thread


def bench_rotation(annotator: Annotator, photo: Photo, box: Box, repeats: int) -> dict[str, float]:
    """Median milliseconds of the default estimator's parts, one thread, templates cached.

    ``encoder`` describes the crop and its mirror image, ``network`` and ``templates`` are asked about both,
    ``whole`` is one estimate with all of it and what joins them.

    Raises:
        ValueError: the annotator has another estimator.
    """
    if not isinstance(annotator.rotation, EmbeddedRotation):
        raise ValueError(
            f"the parts of the embedded estimator are timed, not those of {annotator.rotation.name}"
        )
    library = annotator.library
    category = bench_category(library)
    cads = library.representatives(category, annotator.candidate_count)
    compare, encoder = annotator.rotation.compare, Lite0(threads=1)
    network = RotationNetwork(threads=1)
    estimator = EmbeddedRotation(compare, encoder, network=network, symmetry=library.symmetry)
    crop = crop_square(photo.rgb, box, SIDE)
    both = np.stack([crop, crop[:, ::-1]])
    described = describe(encoder, both)
    parts: dict[str, Callable[[], object]] = {
        "encoder": lambda: describe(encoder, both),
        "network": lambda: network.look(both, described, category, (False, True)),
        "templates": lambda: compare.cosines_of_each(described, cads),
        "whole": lambda: estimator.estimate(crop, cads),
    }
    with on_one_thread():
        return {name: median_ms(work, repeats) for name, work in parts.items()}


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """Median milliseconds of ``repeats`` runs after one that is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(1000.0 * (time.perf_counter() - start))
    return float(np.median(times))
