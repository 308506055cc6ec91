"""What a model looks like without light: colour, normals and coverage, by the rasteriser."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.rendering.lights import Lights
from cadpose.rendering.raster import Rasteriser
from cadpose.rendering.scene import MEAN_TEXEL, TEXTURED, Scene

_EVEN = Lights(key_strength=0.0, fill_strength=0.0, ambient=1.0, sky=0.0)
_WHITE = 255.0


@dataclass(frozen=True, eq=False)
class Surface:
    """A model seen by one camera.

    Attributes:
        rgb: (H, W, 3) uint8 sRGB, the materials' own colour.
        coverage: (H, W) float in [0, 1].
        normals: (H, W, 3) float32, towards the viewer, camera frame (x right, y down, z forward); zeros where
            nothing was drawn.
    """

    rgb: NDArray[np.uint8]
    coverage: NDArray[np.float32]
    normals: NDArray[np.float32]


def surface_of(mesh: Mesh, cameras: Cameras, renderer: Rasteriser) -> Surface:
    """Draw a model's colour and normals from the first of the cameras.

    The rasteriser shows sqrt(n · l) of a white surface under one lamp l. Lamps along +x, -x, +y and -y give
    two components of the normal, and a lamp at the camera the third.
    """
    scene = renderer.scene(mesh)
    plain = renderer.render_scene(scene, cameras, _EVEN)
    white = np.full_like(scene.rgba, _WHITE)
    white[:, 3] = 1.0
    opaque = replace(scene, rgba=white, look=scene.look & ~np.uint8(TEXTURED | MEAN_TEXEL))
    sides = [
        _lit(renderer, opaque, cameras, direction)
        for direction in (
            (1.0, 0.0, 0.0),
            (-1.0, 0.0, 0.0),
            (0.0, 1.0, 0.0),
            (0.0, -1.0, 0.0),
            (0.0, 0.0, -1.0),
        )
    ]
    normals = np.stack([sides[0] - sides[1], sides[2] - sides[3], -sides[4]], axis=-1)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit = np.where(length > 0.2, normals / np.maximum(length, 1e-6), 0.0)
    return Surface(plain.rgb[0], plain.alpha[0] / np.float32(255.0), unit.astype(np.float32))


def _lit(
    renderer: Rasteriser, scene: Scene, cameras: Cameras, towards: tuple[float, float, float]
) -> NDArray[np.float32]:
    """(H, W) cosine between the normals and one direction, 0 where it is negative."""

    lamp = Lights(key=towards, key_strength=1.0, fill_strength=0.0, ambient=0.0, sky=0.0)
    seen = renderer.render_scene(scene, cameras, lamp)
    return np.asarray((seen.rgb[0, ..., 0] / np.float32(_WHITE)) ** 2)
