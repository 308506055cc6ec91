"""Everything that ``cadpose bench`` measures, as one JSON object."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import cadpose
from cadpose.errors import CadposeError
from cadpose.evaluation.bench_candidates import bench_candidates
from cadpose.evaluation.bench_floors import Floor, measure_floors, measure_machine
from cadpose.evaluation.bench_galleries import bench_galleries
from cadpose.evaluation.bench_ranking import bench_ranking
from cadpose.evaluation.bench_rendering import bench_renderers
from cadpose.evaluation.bench_rotation import bench_rotation
from cadpose.evaluation.bench_stages import STAND_IN_BOX, bench_meshes, bench_stages, stand_in_photo
from cadpose.evaluation.bench_synth import bench_synth
from cadpose.pipeline import Annotator
from cadpose.records import Photo
from cadpose.threads import threads

#: Of the parts, as the object names them.
PARTS = ("renderers", "galleries", "synth")
#: Models whose galleries are made.
_GALLERIES = 6


def bench(
    annotator: Annotator,
    photos: Sequence[Photo],
    repeats: int,
    parts: Sequence[str] = PARTS,
    progress: Callable[[str], None] = lambda line: None,
    device: str = "cpu",
) -> dict[str, Any]:
    """Measure.

    Args:
        annotator: What is measured.
        photos: Photographs for the stages; the stand-in photo where there is none.
        repeats: Timed runs.
        parts: Which of :data:`PARTS` to measure too.
        progress: Told one line before each longer part.
        device: Where the annotator's networks run.

    Returns:
        ``cadpose``, ``device`` and ``threads``; ``machine``: ``gflops``, ``gflops_one_core``, ``gbytes``;
        ``stages``: milliseconds a photo; ``floors``: for each stage ``gflop``, ``mbytes``, ``ms``, empty for
        several photos or objects and on a GPU; ``rotation`` and ``ranking``: milliseconds of their parts;
        ``candidates``, ``renderers``, ``galleries`` and ``synth``, None where not asked for.

    Raises:
        ValueError: stages of other kinds than the default ones.
        LibraryError: the library has no models to measure with.
    """
    stand_in = stand_in_photo(annotator)
    pictures = list(photos) or [stand_in]
    machine = measure_machine()
    stages = bench_stages(annotator, pictures, repeats)
    floors: dict[str, Floor] = {}
    try:
        # Of several photos or objects the stages' times are sums and medians that no one floor belongs to.
        if device == "cpu" and len(pictures) == 1:
            floors = measure_floors(annotator, pictures[0])
    except (ValueError, CadposeError) as error:
        progress(f"no floors: {error}")
    told: dict[str, Any] = {
        "cadpose": cadpose.__version__,
        "device": device,
        "threads": threads(),
        "machine": dataclasses.asdict(machine),
        "stages": stages,
        "floors": {
            stage: {**dataclasses.asdict(floor), "ms": floor.ms(machine)} for stage, floor in floors.items()
        },
        "rotation": bench_rotation(annotator, stand_in, STAND_IN_BOX, max(repeats, 5)),
        "ranking": bench_ranking(annotator, stand_in, STAND_IN_BOX, max(repeats, 5)),
        "candidates": None,
        "renderers": None,
        "galleries": None,
        "synth": None,
    }
    if "renderers" in parts:
        progress("ten candidates")
        told["candidates"] = [dataclasses.asdict(t) for t in bench_candidates(annotator, max(repeats, 3))]
        timed = bench_renderers(bench_meshes(annotator.library), progress=progress)
        told["renderers"] = [dataclasses.asdict(t) for t in timed]
    if "galleries" in parts:
        progress("galleries")
        told["galleries"] = dataclasses.asdict(bench_galleries(annotator, _GALLERIES))
    if "synth" in parts:
        progress("synthetic photos")
        told["synth"] = dataclasses.asdict(bench_synth(annotator.library))
    return told
