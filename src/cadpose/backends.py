"""Names to stages: which detector, mask estimator, rotation estimator, measure and renderer to use.

Imports happen when a backend is asked for, so that an optional one costs nothing until then.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping, Sequence
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
from cadpose.rendering import Renderer, for_several_threads
from cadpose.rotation import RotationEstimator
from cadpose.rotation.features import LEVELS, cell_statistics, standardised
from cadpose.rotation.gallery import GalleryStore, RenderFramed
from cadpose.rotation.grid import grid_rotations
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.joint.templates import TemplateViews
from cadpose.threads import threads
from cadpose.weights import cache_folder

if TYPE_CHECKING:
    from cadpose.alignment.refinement.refine import Refiner
    from cadpose.rotation.render_and_compare import RenderAndCompare
    from cadpose.similarity.joint.ranker import JointRanker

#: Detectors by name; what may follow a colon, or has to.
DETECTORS = ("embedded", "ssd", "ssd:tiles", "detectors", "rfdetr", "rfdetr:SIZE", "onnx:FILE.json")
#: Box-to-mask methods by name; ``none`` takes the whole box.
MASKS = ("network", "grabcut", "none")
#: RF-DETR's size where none is named.
RFDETR_SIZE = "s"


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
        if not isinstance(which, str):
            return cast(Detector, which)
        return make_detector(which, categories, self.device)

    def masks(self, which: object) -> MaskEstimator:
        """A box-to-mask method by name."""
        if not isinstance(which, str):
            return cast(MaskEstimator, which)
        return make_masks(which, self.device, self.seed)

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

    def refiner(self, mode: str) -> Refiner | None:
        """What refines a pose; None for the mode ``off``."""
        if mode == "off":
            return None
        from cadpose.alignment.refinement.network import RefinementNetwork
        from cadpose.alignment.refinement.refine import Refiner

        return Refiner(encoder_on(self.device), RefinementNetwork(self.device))

    def galleries(self, renderer_name: str) -> GalleryStore:
        """The models' cached views."""
        folder = self.cache or cache_folder() / "galleries"
        # Blender's worker draws one view at a time; the rasteriser may be shared by threads.
        workers = threads() if for_several_threads(renderer_name) else 1
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
        shared = for_several_threads(renderer_name)
        return JointRanker(source, self.render_framed, encoder, self.seed, shared=shared)

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
        cells: NDArray[np.int8] = standardised(self.encoder.stride16(crop[None]), LEVELS[0])[0]
        return cells


def _choose(stage: str, which: object, makers: Mapping[str, Callable[[], Any]]) -> object:
    if not isinstance(which, str):
        return which
    if which not in makers:
        raise _unknown(stage, which, makers)
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


def embedded_detector(device: str = "cpu", categories: Collection[str] | None = None) -> Detector:
    """The default detector, looking for the given library categories or all that it knows."""
    from cadpose.detection.embedded import EmbeddedDetector

    return EmbeddedDetector(categories, encoder=encoder_on(device))


def make_detector(name: str, categories: Collection[str] | None = None, device: str = "cpu") -> Detector:
    """A detector by its name on the command line.

    Args:
        name: One of ``DETECTORS``; ``SIZE`` is one of RF-DETR's, ``FILE.json`` describes an ONNX file.
        categories: Library categories to look for; None means all that it knows.
        device: ``"cpu"`` or ``"cuda"``.

    Raises:
        CadposeError: the name is unknown.
        DependencyError: an extra, a device or weights are missing; the message says how to get them.
        InputError: the file that ``onnx:`` names cannot be used.
    """
    kind, rest = detector_kind(name)

    def ssd() -> Detector:
        from cadpose.detection.ssd_detector import SsdDetector

        return SsdDetector(categories, tiles=bool(rest))

    def detectors() -> Detector:
        from cadpose.detection.mmdet.detector import DetectorsDetector

        return DetectorsDetector(categories, device)

    def rfdetr() -> Detector:
        from cadpose.detection.rfdetr.detector import RfDetrDetector

        return RfDetrDetector(rest or RFDETR_SIZE, categories, device)

    def onnx() -> Detector:
        from cadpose.detection.onnx_detector import OnnxDetector

        return OnnxDetector(Path(rest), categories, device)

    makers: dict[str, Callable[[], Any]] = {
        "embedded": lambda: embedded_detector(device, categories),
        "ssd": ssd,
        "detectors": detectors,
        "rfdetr": rfdetr,
        "onnx": onnx,
    }
    return cast(Detector, makers[kind]())


def detector_kind(name: str) -> tuple[str, str]:
    """A detector's name as it is and what follows its colon, empty where nothing does.

    Raises:
        CadposeError: there is no such detector, or it takes no such word.
    """
    kind, colon, rest = name.partition(":")
    # What may follow; None is any word, and an empty one stands for no colon.
    words: dict[str, tuple[str, ...] | None] = {
        "embedded": ("",), "ssd": ("", "tiles"), "detectors": ("",), "rfdetr": None, "onnx": None,
    }  # fmt: skip
    known = kind in words and not (colon and not rest) and not (kind == "onnx" and not rest)
    allowed = words.get(kind)
    if not known or (allowed is not None and rest not in allowed):
        raise _unknown("detector", name, DETECTORS)
    return kind, rest


def make_masks(name: str, device: str = "cpu", seed: int = 0) -> MaskEstimator:
    """A box-to-mask method by its name on the command line.

    Raises:
        CadposeError: the name is none of ``MASKS``.
        DependencyError: something that it needs is missing.
    """

    def grabcut() -> MaskEstimator:
        from cadpose.detection.masks import GrabCutMasks

        return GrabCutMasks(seed=seed)

    def network() -> MaskEstimator:
        from cadpose.detection.mask_network import NetworkMasks

        return NetworkMasks(device=device)

    def none() -> MaskEstimator:
        from cadpose.detection.box_masks import BoxMasks

        return BoxMasks()

    makers: dict[str, Callable[[], Any]] = {"network": network, "grabcut": grabcut, "none": none}
    return cast(MaskEstimator, _choose("masks", name, makers))


def _unknown(stage: str, name: object, known: Collection[str]) -> CadposeError:
    return CadposeError(f"unknown {stage} {name!r}, choose one of: {', '.join(known)}")
