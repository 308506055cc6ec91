"""What draws a shape: the rasteriser, fast, or Blender, like a photo. Both see through the same camera."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import angles_from_rotation
from cadpose.geometry.camera import Cameras
from cadpose.rendering.blender_photo import BlenderPhotographer, Surface
from cadpose.rendering.lights import Lights
from cadpose.rendering.raster import Rasteriser
from cadpose.training.synth.environments import hdri_files, made_up
from cadpose.training.synth.shapes import Shape

#: Below this height of the camera, in degrees, the ground is seen edge on or from below, and left out.
_LOWEST = 1.0
_LIGHT, _TURN, _SURFACE = 10, 11, 12


@dataclass(frozen=True, eq=False)
class Drawn:
    """A shape as drawn.

    Attributes:
        rgb: (H, W, 3) uint8, not multiplied by alpha.
        alpha: (H, W) uint8 coverage.
        light: (H, W, 3) float32, what the backdrop is to be multiplied by in linear light, None where the
            drawer knows of no shadow.
    """

    rgb: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    light: NDArray[np.float32] | None = None


class Drawer(Protocol):
    """Draws shapes."""

    def begin(self, seed: int, series: int, index: int) -> None:
        """A photo begins; what is random from here on depends on these numbers alone."""

    def draw(self, shape: Shape, camera: Cameras, lights: Lights) -> Drawn:
        """A shape through one camera."""


class RasterDrawer:
    """The rasteriser with 2 x 2 samples a pixel."""

    def __init__(self) -> None:
        self._raster = Rasteriser(supersample=2)

    def begin(self, seed: int, series: int, index: int) -> None:
        """Nothing here is random."""

    def draw(self, shape: Shape, camera: Cameras, lights: Lights) -> Drawn:
        """A shape in the photo's own light."""
        views = self._raster.render_scene(shape.scene, camera, lights)
        return Drawn(views.rgb[0], views.alpha[0])


class BlenderDrawer:
    """Blender in a worker process. The photos of a series share their environment, turned for each.

    Args:
        hdri: Folder of panoramas, None for made-up light.
        samples: Camera rays a pixel.
        threads: Threads of the worker.

    Raises:
        DependencyError: Blender is not set up.
        InputError: ``hdri`` holds no panorama.
    """

    def __init__(self, hdri: Path | None = None, samples: int = 16, threads: int = 1) -> None:
        self._files = [] if hdri is None else hdri_files(hdri)
        self._blender = BlenderPhotographer(samples, threads=threads)
        self._series: tuple[int, int] | None = None
        self._turn, self._exposure = 0.0, 1.0

    def begin(self, seed: int, series: int, index: int) -> None:
        """Another environment for another series; each photo turns it and is exposed anew."""
        if self._series != (seed, series):
            rng = np.random.default_rng((seed, _LIGHT, series))
            light = self._files[rng.integers(len(self._files))] if self._files else made_up(rng)
            self._blender.light(light)
            self._series = seed, series
        rng = np.random.default_rng((seed, _TURN, index))
        self._turn = float(rng.uniform(0.0, 360.0))
        self._exposure = float(np.exp(rng.normal(0.1, 0.3)))

    def draw(self, shape: Shape, camera: Cameras, lights: Lights) -> Drawn:
        """A shape in the environment's light, with its shadow where the camera is above the ground."""
        assert self._series is not None, "begin comes first"
        seed, series = self._series
        azimuth, elevation, _ = (float(a) for a in angles_from_rotation(camera.R_cv_from_s[0]))
        rng = np.random.default_rng((seed, _SURFACE, series, zlib.crc32(shape.cad.id.encode())))
        view = self._blender.view(
            shape.scene,
            [random_surface(rng) for _ in range(len(shape.scene.rgba))],
            camera,
            # The environment stays where it is in the photo, whichever side the object shows.
            turn=self._turn - azimuth,
            exposure=self._exposure,
            ground=float(shape.scene.coordinates[1].min()) if elevation > _LOWEST else None,
        )
        return Drawn(view.rgb, view.alpha, view.light)

    def close(self) -> None:
        """End the worker."""
        self._blender.close()


def random_surface(rng: np.random.Generator) -> Surface:
    """Matt more often than glossy, seldom a metal, sometimes lacquered."""
    metal = rng.random() < 0.12
    return Surface(
        roughness=float(rng.uniform(0.15, 0.55) if metal else rng.beta(3.0, 2.0) * 0.9 + 0.1),
        metallic=1.0 if metal else 0.0,
        coat=float(rng.uniform(0.3, 1.0)) if not metal and rng.random() < 0.2 else 0.0,
    )
