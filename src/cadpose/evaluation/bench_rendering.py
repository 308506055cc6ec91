"""Milliseconds a view of the renderers that are installed, side by side in one run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from cadpose.errors import CadposeError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.rendering import Renderer

#: Twelve views around an object, three heights.
_POSES = rotation_from_angles(np.arange(12) * 30.0 + 5.0, np.tile([5.0, 20.0, 40.0], 4), 0.0)


@dataclass(frozen=True)
class RendererTiming:
    """One renderer's line of the table.

    Attributes:
        name: What was timed.
        ms_per_view: Median over the meshes; None where it was skipped.
        ratio: ``ms_per_view`` over the first renderer's.
        by_mesh: Milliseconds a view for each mesh, median over the repeats.
        skipped: Why it was not timed, empty if it was.
    """

    name: str
    ms_per_view: float | None = None
    ratio: float | None = None
    by_mesh: dict[str, float] = field(default_factory=dict)
    skipped: str = ""


def raster(supersample: int) -> Renderer:
    """The rasteriser, with samples a side of a pixel."""
    from cadpose.rendering.raster import Rasteriser

    return Rasteriser(supersample)


def blender(samples: int, *, denoise: bool = True) -> Renderer:
    """Blender's Cycles on the CPU.

    Raises:
        DependencyError: Blender is not set up.
    """
    from cadpose.rendering.blender import BlenderRenderer

    return BlenderRenderer(samples, denoise=denoise)


def _panda3d() -> Renderer:
    from cadpose.evaluation.bench_contestants import Panda3d

    return Panda3d()


def _pyrender() -> Renderer:
    from cadpose.evaluation.bench_contestants import Pyrender

    return Pyrender()


#: Name to maker; the ratios refer to the first.
CONTESTANTS: Mapping[str, Callable[[], Renderer]] = {
    "rasteriser, 1 sample": lambda: raster(1),
    "rasteriser, 2x2 samples": lambda: raster(2),
    "Panda3D tinydisplay": _panda3d,
    "pyrender": _pyrender,
    "Blender Cycles, 4 samples": lambda: blender(4),
}


def bench_renderers(
    meshes: Mapping[str, Mesh],
    *,
    size: int = 256,
    views: int = 12,
    repeats: int = 5,
    contestants: Mapping[str, Callable[[], Renderer]] = CONTESTANTS,
    progress: Callable[[str], None] = lambda line: None,
) -> list[RendererTiming]:
    """Time every renderer on every mesh.

    One call draws all views of a mesh. For every mesh the renderers take turns, after one view each that is
    not counted (compiling, uploading); slow renderers (over 50 ms a view) do one repeat.

    Args:
        meshes: Name to mesh.
        size: Side of the square image in pixels; the object fills it up to a margin of 4 %.
        views: Poses a mesh, at most 12.
        repeats: How often the poses are drawn.
        contestants: Name to maker.
        progress: Told one line before each mesh.

    Returns:
        One row a contestant, in their order.

    Raises:
        ValueError: there is no mesh, or ``views`` or ``repeats`` is out of range.
    """
    if not meshes or not 1 <= views <= len(_POSES) or repeats < 1:
        raise ValueError(f"need a mesh, 1 to {len(_POSES)} views and at least one repeat")
    skipped: dict[str, str] = {}
    ready: dict[str, Renderer] = {}
    for name, make in contestants.items():
        try:
            ready[name] = make()
        except (CadposeError, ImportError, RuntimeError, OSError) as error:
            skipped[name] = reason_of(error)
    times: dict[str, dict[str, float]] = {name: {} for name in ready}
    try:
        for label, mesh in meshes.items():
            progress(label)
            cameras = Cameras.framing(_POSES[:views], mesh.hull, size=size, margin=0.04)
            for name, renderer in list(ready.items()):
                try:
                    times[name][label] = _time(renderer, mesh, cameras, repeats)
                except Exception as error:  # another library's failure is a row of the table, not ours
                    skipped[name] = reason_of(error)
                    del ready[name]
    finally:
        for renderer in ready.values():
            if callable(close := getattr(renderer, "close", None)):
                close()
    medians = {name: float(np.median(list(times[name].values()))) for name in ready}
    first = medians.get(next(iter(contestants)))
    return [
        RendererTiming(
            name=name,
            ms_per_view=medians.get(name),
            ratio=medians[name] / first if first and name in medians else None,
            by_mesh=times[name] if name in medians else {},
            skipped=skipped.get(name, ""),
        )
        for name in contestants
    ]


def _time(renderer: Renderer, mesh: Mesh, cameras: Cameras, repeats: int) -> float:
    renderer.render(mesh, cameras[0])
    milliseconds: list[float] = []
    for repeat in range(repeats):
        if repeat and milliseconds[0] > 50.0:
            break
        start = time.perf_counter()
        renderer.render(mesh, cameras)
        milliseconds.append((time.perf_counter() - start) * 1e3 / len(cameras))
    return float(np.median(milliseconds))


def reason_of(error: Exception) -> str:
    """The first line of what went wrong."""
    text = str(error).strip().splitlines()
    return text[0] if text else type(error).__name__
