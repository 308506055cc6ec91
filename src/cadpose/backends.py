"""Names to stages: which detector, mask estimator, rotation estimator, measure and renderer to use.

Imports happen when a backend is asked for, so that an optional one costs nothing until then.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import platformdirs

from cadpose.detection import Detector
from cadpose.detection.masks import MaskEstimator
from cadpose.encoder import lite0
from cadpose.errors import CadposeError
from cadpose.rendering import Renderer
from cadpose.rotation import RotationEstimator
from cadpose.rotation.gallery import RenderFramed
from cadpose.similarity import SimilarityMeasure


@dataclass(frozen=True)
class Backends:
    """Makes backends by name; anything that is not a string is taken as a backend itself.

    Attributes:
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds what draws random numbers.
        cache: Folder for template galleries, None for the user's cache folder.
        render_framed: Draws a model framed in a 224 px square.
    """

    device: str
    seed: int
    cache: Path | None
    render_framed: RenderFramed

    def renderer(self, which: object) -> Renderer:
        """A renderer by name."""

        def raster() -> Renderer:
            from cadpose.rendering.raster import Rasteriser

            return Rasteriser()

        def blender() -> Renderer:
            from cadpose.rendering.blender import BlenderRenderer

            return BlenderRenderer()

        return cast(Renderer, _choose("renderer", which, {"raster": raster, "blender": blender}))

    def detector(self, which: object, categories: Sequence[str]) -> Detector:
        """A detector by name, looking for the given library categories."""

        makers = {"embedded": lambda: embedded_detector(self.device, categories)}
        return cast(Detector, _choose("detector", which, makers))

    def masks(self, which: object) -> MaskEstimator:
        """A box-to-mask method by name."""

        def grabcut() -> MaskEstimator:
            from cadpose.detection.masks import GrabCutMasks

            return GrabCutMasks(seed=self.seed)

        return cast(MaskEstimator, _choose("masks", which, {"grabcut": grabcut}))

    def rotation(self, which: object, renderer_name: str) -> RotationEstimator:
        """A rotation estimator by name."""

        def render_and_compare() -> RotationEstimator:
            from cadpose.rotation.gallery import GalleryStore
            from cadpose.rotation.render_and_compare import RenderAndCompare

            folder = self.cache or Path(platformdirs.user_cache_dir("cadpose")) / "galleries"
            encoder = lite0(self.device)
            # Blender's worker draws one view at a time; the rasteriser may be shared by threads.
            workers = (os.cpu_count() or 1) if renderer_name == "raster" else 1
            single = lite0(self.device, threads=1)
            store = GalleryStore(folder, single, self.render_framed, renderer_name, workers)
            return RenderAndCompare(store, encoder)

        return cast(RotationEstimator, _choose("rotation", which, {"render-and-compare": render_and_compare}))

    def similarity(self, which: object) -> SimilarityMeasure:
        """A similarity measure by name."""
        from cadpose.similarity.registry import measures

        return cast(SimilarityMeasure, _choose("similarity", which, measures(lite0(self.device), self.seed)))


def _choose(stage: str, which: object, makers: dict[str, Callable[[], Any]]) -> object:
    if not isinstance(which, str):
        return which
    if which not in makers:
        raise CadposeError(f"unknown {stage} {which!r}, choose one of: {', '.join(makers)}")
    return makers[which]()


def embedded_detector(device: str = "cpu", categories: Sequence[str] | None = None) -> Detector:
    """The default detector, looking for the given library categories or all that it knows."""
    from cadpose.detection.embedded import EmbeddedDetector

    return EmbeddedDetector(categories, encoder=lite0(device))
