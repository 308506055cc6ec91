"""Renderers behind one protocol: the CPU rasteriser (default) and Blender in a worker process."""

from __future__ import annotations

from typing import Protocol

from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.records import Views


class Renderer(Protocol):
    """Draws one mesh from many cameras in one call."""

    #: Tells apart renderers that draw differently: part of the key of everything made from renders.
    name: str

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        """N views of ``mesh``, one a camera, background transparent."""
        ...
