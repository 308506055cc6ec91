"""Cached views of made-up maps, and of the small library's models on a coarse grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import lite0
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.records import CadModel, Views
from cadpose.rendering.raster import Rasteriser
from cadpose.rotation.features import cell_statistics, describe
from cadpose.similarity.joint.templates import TemplateViews


def random_views(rng: np.random.Generator, n: int) -> TemplateViews:
    cells = rng.integers(-60, 60, (n, 196, 112), dtype=np.int8)
    cover = np.where(rng.random((n, 196)) < 0.6, rng.random((n, 196)), 0.0).astype(np.float32)
    return TemplateViews(cells, cover, rng.uniform(0.5, 2.0, n))


class SmallSource:
    """Every 20 degrees of azimuth between ±60 degrees, at two elevations."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.angles = [(a, e, 0.0) for e in (5.0, 20.0) for a in range(-60, 61, 20)]
        self.asked: list[str] = []
        self._kept: dict[str, TemplateViews] = {}

    @property
    def rotations(self) -> FloatArray:
        return rotation_from_angles(*np.array(self.angles).T)

    @property
    def spread(self) -> NDArray[np.float32]:
        return cell_statistics()["stride16"][1]

    def render(self, cad: CadModel, R_cv_from_s: FloatArray) -> Views:
        mesh = self.library.mesh(cad)
        return Rasteriser().render(mesh, Cameras.framing(R_cv_from_s, mesh.hull, size=224))

    def views(self, cad: CadModel) -> TemplateViews:
        self.asked.append(cad.id)
        if cad.id not in self._kept:
            drawn = self.render(cad, self.rotations)
            seen = describe(lite0(), drawn.over(255), drawn.alpha)
            boxes = [np.argwhere(mask) for mask in drawn.mask]
            aspect = np.array([np.ptp(b[:, 1]) / np.ptp(b[:, 0]) for b in boxes])
            self._kept[cad.id] = TemplateViews(seen.cells[0], seen.cover[0], aspect)
        return self._kept[cad.id]

    def describe(self, crop: NDArray[np.uint8]) -> NDArray[np.int8]:
        cells: NDArray[np.int8] = describe(lite0(), crop[None]).cells[0][0]
        return cells
