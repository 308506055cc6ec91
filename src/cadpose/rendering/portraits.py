"""Pictures of CAD models for people: one view each, framed with a margin, on white."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.records import CadModel
from cadpose.rendering import Renderer
from cadpose.rendering.raster import Rasteriser


def portraits(
    library: Library,
    models: Iterable[CadModel],
    azimuth: float = 30.0,
    elevation: float = 15.0,
    *,
    size: int = 176,
    renderer: Renderer | None = None,
) -> Iterator[tuple[CadModel, NDArray[np.uint8]]]:
    """Each model with a (size, size, 3) uint8 picture from the given angles in degrees.

    Raises:
        LibraryError: a model's file is missing or damaged.
    """
    draw = renderer or Rasteriser()
    R = rotation_from_angles(azimuth, elevation)
    for model in models:
        mesh = library.mesh(model)
        yield model, draw.render(mesh, Cameras.framing(R, mesh.hull, size=size, margin=0.04)).over(255)[0]
