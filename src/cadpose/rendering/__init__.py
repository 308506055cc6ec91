"""Renderers behind one protocol: the CPU rasteriser (default) and Blender in a worker process."""

from __future__ import annotations

from typing import Protocol

from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.records import Views


def for_several_threads(name: str) -> bool:
    """Whether several threads may call the renderer of that name at once."""
    return name.startswith("raster")


class Renderer(Protocol):
    """Draws one mesh from many cameras in one call.

    Examples:
        >>> import numpy as np
        >>> from cadpose import Rotation
        >>> from cadpose.geometry.camera import Cameras
        >>> from cadpose.library.parametric.registry import make
        >>> from cadpose.records import Views
        >>> from cadpose.rendering.raster import Rasteriser
        >>> class Clay:
        ...     name = "raster-clay"
        ...
        ...     def __init__(self):
        ...         self.inner = Rasteriser()
        ...
        ...     def render(self, mesh, cameras):
        ...         views = self.inner.render(mesh, cameras)
        ...         grey = views.rgb.mean(axis=-1, keepdims=True).astype(np.uint8)
        ...         return Views(np.repeat(grey, 3, axis=-1), views.alpha, views.depth)
        >>> chair = make("chair", 7)  # a mesh by formula
        >>> cameras = Cameras.framing([Rotation(a, 20).to_matrix() for a in (0, 90)], chair.hull, size=64)
        >>> views = Clay().render(chair, cameras)
        >>> len(views), views.rgb.shape, bool(views.mask.any())
        (2, (2, 64, 64, 3), True)

        ``Annotator(renderer=Clay())`` uses it. What is kept of its pictures goes by ``name``: renderers that
        draw differently need different names. One whose name starts with ``raster`` may be called by several
        threads at once.
    """

    #: Tells apart renderers that draw differently: part of the key of everything made from renders.
    name: str

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        """N views of ``mesh``, one a camera, background transparent."""
        ...
