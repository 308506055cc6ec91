"""One photo in, 4-DoF annotations out: the only place where the stages meet.

find the objects -> mask each -> guess its rotation -> rank the CAD candidates, each at its best rotation
near a guess -> fit the focal length that lays the best one over the object
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import cadpose
from cadpose.alignment import align, focal_from_mask
from cadpose.annotations.document import Failure
from cadpose.backends import Backends
from cadpose.detection.flags import flagged
from cadpose.errors import CadposeError, DependencyError, InputError, LibraryError
from cadpose.geometry.boxes import Box, box_iou, mask_iou
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.library.class_map import category_from_name
from cadpose.photos import crop_square, read_photo
from cadpose.records import (
    Annotation,
    CadModel,
    Candidate,
    Detection,
    Mask,
    Photo,
    Pose4Dof,
    Rotation,
    RotationHypothesis,
    Views,
)
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.index.library_index import LibraryIndex
from cadpose.similarity.joint.ranker import JointRanker, JointRanking
from cadpose.similarity.local_features import BACKGROUND
from cadpose.similarity.ranking import rank_candidates

log = logging.getLogger(__name__)

#: Side of the square crops and renders that are compared.
SIDE = 224
#: Ways to fit the focal length.
ALIGNMENTS = ("box", "paper", "mask")
#: Side of the raster on which the silhouette is compared with the mask.
_MASK_SIDE = 256


@dataclass(frozen=True, eq=False)
class PhotoResult:
    """Everything that came of one photo.

    Attributes:
        photo: The decoded photo.
        annotations: One an object.
        failures: Objects without an annotation.
        seconds: Time by stage, summed over the objects.
    """

    photo: Photo
    annotations: tuple[Annotation, ...]
    failures: tuple[Failure, ...]
    seconds: dict[str, float] = field(default_factory=dict)


class Stopwatch:
    """Adds up seconds by stage and knows the stage begun last."""

    def __init__(self, stage: str = "") -> None:
        self.seconds: dict[str, float] = {}
        self.stage = stage

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Time what is done inside."""
        start = time.perf_counter()
        self.stage = stage
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start


class Annotator:
    """Photo to 4-DoF annotations; this class is the whole inference API.

    Args:
        library: CAD library, its folder, or None for the default one (``cadpose library add``).
        detector, masks, rotation, similarity, renderer: Names of backends (see
            :mod:`cadpose.backends`) or objects that satisfy the stage's protocol.
        candidates: CAD models compared with each object.
        index: Chooses them by what the object looks like; the category's representatives if None.
        categories: Library categories to look for; None means all that the library holds.
        align_to: ``"box"`` fits the focal length to the detection box with the middles of box and projected
            rectangle together; ``"paper"`` keeps the principal point at the box's middle as the paper does;
            ``"mask"`` fits the silhouette to the mask. See docs/alignment.md.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds everything that draws random numbers.
        cache: Folder of template galleries; None for the user's cache folder.

    Raises:
        LibraryError: the library is missing or empty, or has no model of a category asked for.
        CadposeError: a backend's name is unknown or its dependency is missing.
    """

    def __init__(
        self,
        library: Library | Path | str | None = None,
        *,
        detector: object = "embedded",
        masks: object = "network",
        rotation: object = "embedded",
        similarity: object = "joint",
        renderer: object = "raster",
        candidates: int = 10,
        index: LibraryIndex | None = None,
        categories: Sequence[str] | None = None,
        align_to: str = "box",
        device: str = "cpu",
        seed: int = 0,
        cache: Path | None = None,
    ) -> None:
        if candidates < 1:
            raise ValueError(f"candidates must be at least 1, got {candidates}")
        if align_to not in ALIGNMENTS:
            raise ValueError(f"align_to must be one of {', '.join(ALIGNMENTS)}, got {align_to!r}")
        self.library = library if isinstance(library, Library) else Library.open(_path(library))
        self.categories = tuple(self._known(name) for name in categories or self.library.categories())
        self.candidate_count = candidates
        self.align_to, self.seed, self.index = align_to, seed, index
        backends = Backends(device, seed, cache, self.render_framed, self.library.symmetry, self.library.mesh)
        self.renderer = backends.renderer(renderer)
        self.detector = backends.detector(detector, self.categories)
        self.masks = backends.masks(masks)
        self.rotation = backends.rotation(rotation, self.renderer.name)
        self.chooser = backends.similarity("aligned")
        self._backends = backends
        self.similarity: SimilarityMeasure | JointRanker = (
            self.chooser if similarity == "aligned" else backends.ranking(similarity, self.renderer.name)
        )

    @cached_property
    def joint(self) -> JointRanker:
        """What decides CAD model and rotation together: the one chosen, else the default."""
        own = self.similarity
        return own if isinstance(own, JointRanker) else self._backends.joint(self.renderer.name)

    def annotate(
        self, photo: Photo | NDArray[np.uint8] | Path | str, detections: Sequence[Detection] | None = None
    ) -> list[Annotation]:
        """The 4-DoF annotations of a photo, one an object; objects that fail are logged.

        Args:
            photo: A path, a decoded :class:`Photo`, or (H, W, 3) uint8 RGB.
            detections: Objects known from outside; None runs the detector.

        Raises:
            InputError: the photo cannot be used.
            DependencyError: weights or programs are missing.
        """
        result = self.run(photo, detections)
        for failure in result.failures:
            log.warning("%s: %s left out: %s", result.photo.name, failure.detection.category, failure.reason)
        return list(result.annotations)

    def run(
        self, photo: Photo | NDArray[np.uint8] | Path | str, detections: Sequence[Detection] | None = None
    ) -> PhotoResult:
        """As :meth:`annotate`, with the failures and the time each stage took."""
        clock = Stopwatch()
        with clock.time("read"):
            picture = _photo(photo)
        if detections is None:
            with clock.time("detect"):
                detections = self.detector.detect(picture)
        annotations, failures = [], []
        for detection in (flagged(d, picture.width, picture.height) for d in detections):
            own = Stopwatch("detect")
            try:
                annotations.append(self._annotate_object(picture, detection, own))
            except DependencyError:
                raise
            except CadposeError as error:
                failures.append(Failure(detection, str(error), own.stage))
            for stage, seconds in own.seconds.items():
                clock.seconds[stage] = clock.seconds.get(stage, 0.0) + seconds
        return PhotoResult(picture, tuple(annotations), tuple(failures), clock.seconds)

    def estimate_rotation(
        self, photo: Photo, box: Box, category: str, cads: Sequence[CadModel] | None = None
    ) -> list[RotationHypothesis]:
        """Rotation hypotheses of the object in a box, best first."""
        pool = self._pool(category) if cads is None else cads
        return self.rotation.estimate(crop_square(photo.rgb, box, SIDE), pool)

    def rank(
        self,
        photo: Photo,
        box: Box,
        cads: Sequence[CadModel],
        rotations: Sequence[Rotation],
        mask: Mask | None = None,
    ) -> list[Candidate]:
        """CAD models ranked by similarity at the given rotations, best first.

        The joint ranking takes one rotation as it is, and several as guesses, the best first.
        """
        if isinstance(self.similarity, JointRanker):
            guesses = [RotationHypothesis(rotation, 0.0, 1.0) for rotation in rotations]
            return list(self.rank_jointly(photo, box, cads, guesses, fixed=len(guesses) == 1).candidates)
        return rank_candidates(
            crop_square(photo.rgb, box, SIDE, fill=BACKGROUND),
            None if mask is None else crop_square(mask, box, SIDE),
            box.width / box.height,
            cads,
            [rotations] * len(cads),
            render=self.render_framed,
            chooser=self.chooser,
            measure=self.similarity,
        )

    def rank_jointly(
        self,
        photo: Photo,
        box: Box,
        cads: Sequence[CadModel],
        hypotheses: Sequence[RotationHypothesis],
        *,
        fixed: bool = False,
    ) -> JointRanking:
        """CAD models, each at the rotation near a hypothesis at which it is most like the photo.

        ``fixed`` sees all at the first hypothesis.
        """
        crop = crop_square(photo.rgb, box, SIDE, fill=BACKGROUND)
        cached = crop_square(photo.rgb, box, SIDE)
        return self.joint.rank(crop, cached, box.width / box.height, cads, hypotheses, fixed=fixed)

    def render_framed(self, cad: CadModel, R_cv_from_s: FloatArray) -> Views:
        """N views of a model whose longer side fills a 224 px square."""
        mesh = self.library.mesh(cad)
        return self.renderer.render(mesh, Cameras.framing(R_cv_from_s, mesh.hull, size=SIDE))

    def render_pose(self, cad: CadModel, pose: Pose4Dof, width: int, height: int) -> Views:
        """The model over a photo of that size."""
        return self.renderer.render(self.library.mesh(cad), pose.to_cameras(width, height))

    def _known(self, category: str) -> str:
        """The library's name of a category."""
        known = self.library.categories()
        name = category if category in known else category_from_name(category) or category
        if name not in known:
            raise LibraryError(
                f"the library has no CAD model of category {name!r}: add one with `cadpose library add`, or "
                f"see `cadpose library list`"
            )
        return name

    def _pool(self, category: str) -> tuple[CadModel, ...]:
        """The candidates of a category; models whose file is damaged are passed over."""
        pool, reason = [], None
        for cad in self.library.representatives(self._known(category), self.candidate_count):
            try:
                self.library.mesh(cad)
                pool.append(cad)
            except LibraryError as error:
                log.warning("%s is passed over: %s", cad.id, error)
                reason = error
        if not pool:
            raise LibraryError(f"no CAD model of category {category!r} can be read") from reason
        return tuple(pool)

    def _annotate_object(self, photo: Photo, detection: Detection, clock: Stopwatch) -> Annotation:
        box = detection.box.clipped(photo.width, photo.height)
        if box is None:
            raise InputError(f"the box {detection.box.to_tuple()} lies outside the photo")
        if detection.mask is not None and detection.mask.shape != (photo.height, photo.width):
            raise InputError(
                f"the mask of {detection.mask.shape[1]} x {detection.mask.shape[0]} pixels does not fit the "
                f"photo of {photo.width} x {photo.height}"
            )
        detection = replace(detection, box=box)
        with clock.time("library"):
            cads = self._pool(detection.category)
        if detection.mask is None:
            with clock.time("mask"):
                detection = replace(detection, mask=self.masks.mask(photo, box))
        with clock.time("rotation"):
            if detection.rotation is not None:
                hypotheses = [RotationHypothesis(detection.rotation, 1.0, 1.0)]
            else:
                hypotheses = self.estimate_rotation(photo, box, detection.category, cads)
        with clock.time("similarity"):
            if self.index is not None:
                cads = self.index.candidates(self.library, photo, detection, hypotheses, self.candidate_count)
            joint = None
            if isinstance(self.similarity, JointRanker):
                joint = self.rank_jointly(photo, box, cads, hypotheses, fixed=detection.rotation is not None)
                candidates = joint.candidates
            else:
                rotation = hypotheses[0].rotation
                candidates = tuple(self.rank(photo, box, cads, [rotation], detection.mask))
        best = candidates[0]
        with clock.time("alignment"):
            pose, box_iou = self._align(best, box, detection.mask)
            overlap = None if detection.mask is None else self._mask_iou(best.cad, pose, box, detection.mask)
        return Annotation(
            photo_name=photo.name,
            photo_sha256=photo.sha256,
            photo_size=(photo.width, photo.height),
            detection=detection,
            pose=pose,
            candidates=candidates,
            hypotheses=tuple(hypotheses),
            box_iou=box_iou,
            mask_iou=overlap,
            seconds=dict(clock.seconds),
            provenance=self.provenance(),
            none_probability=None if joint is None else joint.none_probability,
            cad_needs_review=joint is not None and joint.needs_review,
        )

    def _align(self, best: Candidate, box: Box, mask: Mask | None) -> tuple[Pose4Dof, float]:
        mesh = self.library.mesh(best.cad)
        if self.align_to == "mask" and mask is not None:
            camera = Cameras.framing(best.rotation.to_matrix(), mesh.hull, size=_MASK_SIDE, margin=0.02)
            silhouette = self.renderer.render(mesh, camera)
            fit = focal_from_mask(silhouette.alpha[0], camera, mask, centred=True)
            pose = Pose4Dof(best.rotation, fit.focal_px, fit.principal_px)
            drawn = np.array(_rectangle(pose, mesh.hull).to_tuple())
            return pose, float(box_iou(drawn, np.array(box.to_tuple())))
        return align(mesh.hull, best.rotation, box, centred=self.align_to != "paper")

    def _mask_iou(self, cad: CadModel, pose: Pose4Dof, box: Box, mask: Mask) -> float:
        """Silhouette IoU on a raster around model and mask: large photos cost no more than small ones."""
        drawn_box = _rectangle(pose, self.library.mesh(cad).hull)
        frame = Box.around(box, drawn_box, Box.from_mask(mask)) if mask.any() else Box.around(box, drawn_box)
        scale = _MASK_SIDE / max(frame.width, frame.height)
        width, height = max(1, round(frame.width * scale)), max(1, round(frame.height * scale))
        cx, cy = pose.principal_px
        cameras = Cameras.from_rotations(
            pose.rotation.to_matrix(),
            focal_px=pose.focal_px * scale,
            principal_px=((cx - frame.x0) * scale, (cy - frame.y0) * scale),
            width=width,
            height=height,
            t_z=pose.t_z,
        )
        drawn = self.renderer.render(self.library.mesh(cad), cameras).mask[0]
        columns = np.floor(frame.x0 + (np.arange(width) + 0.5) / scale).astype(int)
        rows = np.floor(frame.y0 + (np.arange(height) + 0.5) / scale).astype(int)
        inside = ((rows >= 0) & (rows < mask.shape[0]))[:, None] & (columns >= 0) & (columns < mask.shape[1])
        given = mask[rows.clip(0, mask.shape[0] - 1)[:, None], columns.clip(0, mask.shape[1] - 1)] & inside
        # Beyond the photo nothing is known: what the model covers there does not count.
        return mask_iou(drawn & inside, given)

    def provenance(self) -> dict[str, object]:
        """What every annotation says it was made with: version, library digest, stages, options."""
        return {
            "cadpose": cadpose.__version__,
            "library": self.library.digest,
            "detector": self.detector.name,
            "masks": self.masks.name,
            "rotation": self.rotation.name,
            "similarity": self.similarity.name,
            "renderer": self.renderer.name,
            "align_to": self.align_to,
            "candidates": self.candidate_count,
            "index": None if self.index is None else self.index.digest,
            "seed": self.seed,
        }


def _rectangle(pose: Pose4Dof, points_s: FloatArray) -> Box:
    """Rectangle of the projected points in pixels of the photo."""
    pixels = pose.project(points_s)
    (x0, y0), (x1, y1) = pixels.min(axis=0), pixels.max(axis=0)
    return Box(float(x0), float(y0), float(x1), float(y1))


def _path(value: Path | str | None) -> Path | None:
    return None if value is None else Path(value)


def _photo(photo: Photo | NDArray[np.uint8] | Path | str) -> Photo:
    if isinstance(photo, Photo):
        return photo
    if isinstance(photo, str | Path):
        return read_photo(Path(photo))
    return Photo(photo)
