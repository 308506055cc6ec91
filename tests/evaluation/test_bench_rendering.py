from __future__ import annotations

import time

import pytest

from cadpose.errors import DependencyError
from cadpose.evaluation.bench_rendering import bench_renderers
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.records import Views
from cadpose.rendering import Renderer
from cadpose.rendering.raster import Rasteriser
from tests.rendering.shapes import cube


class Slowed:
    name = "slowed"

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.closed = False

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        time.sleep(self.seconds * len(cameras))
        return Rasteriser(1).render(mesh, cameras)

    def close(self) -> None:
        self.closed = True


class Broken(Slowed):
    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        raise RuntimeError("no display\nmore")


def missing() -> Renderer:
    raise DependencyError("it is not installed")


def test_rows_hold_times_ratios_and_reasons() -> None:
    slow = Slowed(0.02)
    rows = bench_renderers(
        {"cube": cube(), "small": cube(0.1)},
        size=32,
        views=2,
        repeats=2,
        contestants={
            "fast": lambda: Rasteriser(1),
            "slow": lambda: slow,
            "missing": missing,
            "broken": lambda: Broken(0.0),
        },
    )
    assert [row.name for row in rows] == ["fast", "slow", "missing", "broken"]
    fast, slower, gone, broken = rows
    assert fast.ratio == 1.0
    assert slower.ms_per_view is not None
    assert slower.ratio is not None
    assert slower.ms_per_view > 20
    assert slower.ratio > 2
    assert set(slower.by_mesh) == {"cube", "small"}
    assert (gone.ms_per_view, gone.skipped) == (None, "it is not installed")
    assert (broken.ms_per_view, broken.skipped) == (None, "no display")
    assert slow.closed


def test_nothing_to_time_is_refused() -> None:
    with pytest.raises(ValueError, match="need a mesh"):
        bench_renderers({})
