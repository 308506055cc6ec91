"""Ten candidates at one rotation, drawn as the pipeline draws them, by the rasteriser and by Blender."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from cadpose.errors import CadposeError
from cadpose.evaluation.bench_rendering import blender, raster, reason_of
from cadpose.evaluation.bench_stages import bench_category
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.pipeline import SIDE, Annotator
from cadpose.rendering import Renderer
from cadpose.threads import spread

#: How a car is often photographed: azimuth and elevation in degrees.
_AZIMUTH, _ELEVATION = 40.0, 12.0


@dataclass(frozen=True)
class CandidatesTiming:
    """One renderer's line.

    Attributes:
        name: What was timed.
        ms: Milliseconds for all candidates, the quickest of the repeats; None where it was skipped.
        ratio: ``ms`` over the first line's.
        skipped: Why it was not timed, empty if it was.
    """

    name: str
    ms: float | None = None
    ratio: float | None = None
    skipped: str = ""


#: Name to maker and to whether threads may share it; the ratios refer to the first. Blender draws with all
#: cores itself, and takes in a mesh each time that it changes.
CONTESTANTS: Mapping[str, tuple[Callable[[], Renderer], bool]] = {
    "rasteriser, 2x2 samples": (lambda: raster(2), True),
    "rasteriser, 1 sample": (lambda: raster(1), True),
    "Blender Cycles, 4 samples, denoised": (lambda: blender(4), False),
    "Blender Cycles, 1 sample, denoised": (lambda: blender(1), False),
    "Blender Cycles, 1 sample, noisy": (lambda: blender(1, denoise=False), False),
}


def bench_candidates(
    annotator: Annotator,
    repeats: int,
    contestants: Mapping[str, tuple[Callable[[], Renderer], bool]] = CONTESTANTS,
) -> list[CandidatesTiming]:
    """Time a view of 224 px of each candidate of one category, all at one rotation, warm.

    The renderers take turns; what the first turn takes is not counted.
    """
    library = annotator.library
    meshes = [library.mesh(cad) for cad in annotator.candidates(bench_category(library))]
    R = rotation_from_angles(_AZIMUTH, _ELEVATION)
    cameras = [Cameras.framing(R, mesh.hull, size=SIDE) for mesh in meshes]
    skipped: dict[str, str] = {}
    ready: dict[str, tuple[Renderer, bool]] = {}
    for name, (make, shared) in contestants.items():
        try:
            ready[name] = make(), shared
        except (CadposeError, ImportError, RuntimeError, OSError) as error:
            skipped[name] = reason_of(error)
    best: dict[str, float] = {}
    try:
        for repeat in range(repeats + 1):
            for name, (renderer, shared) in ready.items():
                start = time.perf_counter()
                pairs = zip(meshes, cameras, strict=True)
                if shared:
                    spread(partial(_draw, renderer), pairs)
                else:
                    for pair in pairs:
                        _draw(renderer, pair)
                ms = 1000.0 * (time.perf_counter() - start)
                if repeat:
                    best[name] = min(ms, best.get(name, ms))
    finally:
        for renderer, _ in ready.values():
            if callable(close := getattr(renderer, "close", None)):
                close()
    first = best.get(next(iter(contestants)), 0.0)
    return [
        CandidatesTiming(
            name,
            ms=best.get(name),
            ratio=best[name] / first if first and name in best else None,
            skipped=skipped.get(name, ""),
        )
        for name in contestants
    ]


def _draw(renderer: Renderer, pair: tuple[Mesh, Cameras]) -> None:
    renderer.render(*pair)
