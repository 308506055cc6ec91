"""Names to stages: which detector, mask estimator, rotation estimator, measure and renderer to use.

Imports happen when a backend is asked for, so that an optional one costs nothing until then.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from cadpose.detection import Detector
from cadpose.detection.masks import MaskEstimator
from cadpose.encoder import SIDE, Lite0, lite0
from cadpose.errors import CadposeError, DependencyError
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel
from cadpose.rendering import Renderer
from cadpose.rotation import RotationEstimator
from cadpose.rotation.features import cell_statistics, describe
from cadpose.rotation.gallery import GalleryStore, RenderFramed
from cadpose.rotation.grid import grid_rotations
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.joint.templates import TemplateViews
from cadpose.weights import cache_folder

if TYPE_CHECKING:
    from cadpose.rotation.render_and_compare import RenderAndCompare
    from cadpose.similarity.joint.ranker import JointRanker


@dataclass(frozen=True)
class Backends:
    """Makes backends by name; anything that is not a string is taken as a backend itself.

    Attributes:
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds what draws random numbers.
        cache: Folder for template galleries, None for the user's cache folder.
        render_framed: Draws a model framed in a 224 px square.
        symmetry: Gives the rotations that leave a model as it looks; None takes every model as having none.
        mesh: Gives a model's mesh; the joint ranking needs it.
    """

    device: str
    seed: int
    cache: Path | None
    render_framed: RenderFramed
    symmetry: Callable[[CadModel], SymmetryGroup] | None = None
    mesh: Callable[[CadModel], Mesh] | None = None

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

        def render_and_compare() -> RenderAndCompare:
            from cadpose.rotation.render_and_compare import RenderAndCompare

            return RenderAndCompare(self.galleries(renderer_name), encoder_on(self.device))

        def embedded() -> RotationEstimator:
            from cadpose.rotation.embedded import EmbeddedRotation
            from cadpose.rotation.network import RotationNetwork

            return EmbeddedRotation(
                render_and_compare(),
                encoder_on(self.device),
                network=RotationNetwork(device=self.device),
                symmetry=self.symmetry,
            )

        def posecontrast() -> RotationEstimator:
            from cadpose.rotation.posecontrast import PoseContrastEstimator

            encoder_on(self.device)  # refuses a device that is not there
            return PoseContrastEstimator(device=self.device)

        makers: dict[str, Callable[[], Any]] = {
            "embedded": embedded,
            "render-and-compare": render_and_compare,
            "posecontrast": posecontrast,
        }
        return cast(RotationEstimator, _choose("rotation", which, makers))

    def galleries(self, renderer_name: str) -> GalleryStore:
        """The models' cached views."""
        folder = self.cache or cache_folder() / "galleries"
        # Blender's worker draws one view at a time; the rasteriser may be shared by threads.
        workers = (os.cpu_count() or 1) if renderer_name.startswith("raster") else 1
        single = encoder_on(self.device, threads=1)
        return GalleryStore(folder, single, self.render_framed, renderer_name, workers)

    def joint(self, renderer_name: str) -> JointRanker:
        """What decides CAD model and rotation together.

        Raises:
            ValueError: these backends know no meshes.
        """
        from cadpose.similarity.joint.ranker import JointRanker

        if self.mesh is None:
            raise ValueError("the joint ranking needs the models' meshes")
        encoder = encoder_on(self.device)
        source = GalleryTemplates(self.galleries(renderer_name), encoder, self.mesh)
        return JointRanker(source, self.render_framed, encoder, self.seed)

    def similarity(self, which: object) -> SimilarityMeasure:
        """A similarity measure by name."""
        return cast(SimilarityMeasure, _choose("similarity", which, self._measures()))

    def ranking(self, which: object, renderer_name: str) -> SimilarityMeasure | JointRanker:
        """What ranks the models: the joint ranking or a similarity measure, by name."""
        makers: dict[str, Callable[[], Any]] = {
            "joint": lambda: self.joint(renderer_name),
            **self._measures(),
        }
        return cast("SimilarityMeasure | JointRanker", _choose("similarity", which, makers))

    def _measures(self) -> dict[str, Callable[[], SimilarityMeasure]]:
        from cadpose.similarity.registry import measures

        return measures(encoder_on(self.device), self.seed)


class GalleryTemplates:
    """The rotation galleries as a :class:`cadpose.similarity.joint.templates.TemplateSource`.

    Args:
        galleries: Where they come from.
        encoder: Describes the crop.
        mesh: Gives a model's mesh.
        memory_bytes: Views kept in memory between photos; those of the last model always are.
    """

    def __init__(
        self,
        galleries: GalleryStore,
        encoder: Lite0,
        mesh: Callable[[CadModel], Mesh],
        memory_bytes: int = 1 << 29,
    ) -> None:
        self.galleries = galleries
        self.encoder = encoder
        self.mesh = mesh
        self.memory_bytes = memory_bytes
        self._kept: OrderedDict[tuple[str, str], TemplateViews] = OrderedDict()

    @property
    def rotations(self) -> FloatArray:
        """(N, 3, 3) rotations of the grid."""
        return grid_rotations()

    @property
    def spread(self) -> NDArray[np.float32]:
        """(112,) standard deviations of the stride-16 channels."""
        return cell_statistics()["stride16"][1]

    def views(self, cad: CadModel) -> TemplateViews:
        """The model's gallery, kept in memory as long as there is room."""
        key = (cad.id, cad.sha256)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        gallery, hull = self.galleries.get(cad), self.mesh(cad).hull
        pixels = Cameras.framing(grid_rotations(), hull, size=SIDE).project(hull)
        size = pixels.max(axis=1) - pixels.min(axis=1)
        # A flat thing seen from its edge has no width to speak of.
        aspect = np.clip(size[:, 0], 1e-3, None) / np.clip(size[:, 1], 1e-3, None)
        self._kept[key] = TemplateViews(gallery.cells[0], gallery.cover[0], aspect)
        while len(self._kept) > 1 and sum(v.nbytes for v in self._kept.values()) > self.memory_bytes:
            self._kept.popitem(last=False)
        return self._kept[key]

    def describe(self, crop: NDArray[np.uint8]) -> NDArray[np.int8]:
        """(224, 224, 3) uint8 crop to (196, 112) cells."""
        cells: NDArray[np.int8] = describe(self.encoder, crop[None]).cells[0][0]
        return cells


def _choose(stage: str, which: object, makers: Mapping[str, Callable[[], Any]]) -> object:
    if not isinstance(which, str):
        return which
    if which not in makers:
        raise CadposeError(f"unknown {stage} {which!r}, choose one of: {', '.join(makers)}")
    return makers[which]()


def encoder_on(device: str, threads: int = 0) -> Lite0:
    """The shared encoder on a device that is there: ONNX Runtime itself would fall back without a word.

    Raises:
        CadposeError: no such device is known.
        DependencyError: the installed ONNX Runtime cannot use it.
    """
    if device not in ("cpu", "cuda"):
        raise CadposeError(f"unknown device {device!r}, choose one of: cpu, cuda")
    if device == "cuda":
        import onnxruntime

        if "CUDAExecutionProvider" not in onnxruntime.get_available_providers():
            raise DependencyError(
                "--device cuda needs onnxruntime-gpu in place of onnxruntime, see `cadpose doctor`"
            )
    return lite0(device, threads)


def embedded_detector(device: str = "cpu", categories: Sequence[str] | None = None) -> Detector:
    """The default detector, looking for the given library categories or all that it knows."""
    from cadpose.detection.embedded import EmbeddedDetector

    return EmbeddedDetector(categories, encoder=encoder_on(device))
