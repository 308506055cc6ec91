"""What an index keeps of one model: each view's embedding and its small map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import lite0
from cadpose.geometry.camera import T_Z, Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.jit import kernel
from cadpose.rendering.raster import Rasteriser
from cadpose.rendering.scene import Scene
from cadpose.similarity.embedding import SIDE, ViewEmbedder
from cadpose.similarity.index.grid import ViewGrid
from cadpose.similarity.small_maps import SmallMaps, basis_digest, describe_views
from cadpose.weights import REGISTRY

#: Part of the key of what is kept: change it when views are drawn or described in another way.
_VERSION = 1


@dataclass(frozen=True, eq=False)
class DescribedModel:
    """V views of one model.

    Attributes:
        embeddings: (V, 128) float16 of unit length.
        maps: The small map of each.
    """

    embeddings: NDArray[np.float16]
    maps: SmallMaps


class ViewDescriber:
    """Draws and describes models. One instance may be used from several threads.

    Args:
        embedder: The view embedding; give it one thread where several threads describe.
        grid: From where.
        device: Where the encoder of the small maps runs.
    """

    def __init__(self, embedder: ViewEmbedder, grid: ViewGrid | None = None, device: str = "cpu") -> None:
        self.embedder = embedder
        self.grid = grid or ViewGrid()
        self._raster = Rasteriser()
        self._encoder = lite0(device, 1)

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that decides what is kept of a model, as JSON takes it."""
        return {
            "azimuths": self.grid.azimuths,
            "elevations": list(self.grid.elevations),
            **made_with(self.embedder, self._raster),
        }

    def describe(self, scene: Scene) -> DescribedModel:
        """All views of one model.

        Raises:
            ValueError: it reaches behind the camera, or has no face.
        """
        views = self._raster.render_scene(scene, framing(scene, self.grid.rotations, SIDE))
        embeddings = self.embedder.views(views)
        return DescribedModel(embeddings.astype(np.float16), describe_views(views, self._encoder))


def made_with(embedder: ViewEmbedder, raster: Rasteriser) -> dict[str, Any]:
    """What must be the same for photos to be compared with what is kept, from whatever views it was drawn."""
    return {
        "views": _VERSION,
        "renderer": raster.name,
        "embedding": embedder.sha256,
        "encoder": REGISTRY["lite0-trunk"].sha256,
        "cells": basis_digest(),
    }


def framing(scene: Scene, R_cv_from_s: FloatArray, size: int) -> Cameras:
    """N cameras that see a scene as :meth:`Cameras.framing` has it, found without its convex hull.

    Raises:
        ValueError: the scene has no face, or reaches behind the camera.
    """
    if not len(scene.faces):
        raise ValueError("the model has no face that can be seen")
    used = np.zeros(len(scene.vertices), np.bool_)
    used[scene.faces] = True
    extreme = np.zeros((len(R_cv_from_s), 4), np.int64)
    _extremes(scene.vertices, used, np.ascontiguousarray(R_cv_from_s, np.float64), T_Z, extreme)
    return Cameras.framing(R_cv_from_s, scene.vertices[np.unique(extreme)].astype(np.float64), size=size)


@kernel
def _extremes(
    vertices: NDArray[np.float32],
    used: NDArray[np.bool_],
    R: FloatArray,
    t_z: float,
    extreme: NDArray[np.int64],
) -> None:
    """Which vertices bound the projection: left, right, top, bottom."""
    for n in range(R.shape[0]):
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        for i in range(vertices.shape[0]):
            if not used[i]:
                continue
            a, b, c = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            z = R[n, 2, 0] * a + R[n, 2, 1] * b + R[n, 2, 2] * c + t_z
            # What lies behind the camera is refused by those who ask for it.
            inverse = 1.0 / z if z > 1e-6 else 1e6
            x = (R[n, 0, 0] * a + R[n, 0, 1] * b + R[n, 0, 2] * c) * inverse
            y = (R[n, 1, 0] * a + R[n, 1, 1] * b + R[n, 1, 2] * c) * inverse
            if x < left:
                left = x
                extreme[n, 0] = i
            if x > right:
                right = x
                extreme[n, 1] = i
            if y < top:
                top = y
                extreme[n, 2] = i
            if y > bottom:
                bottom = y
                extreme[n, 3] = i
