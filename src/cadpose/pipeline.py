"""One photo in, 4-DoF annotations out: the only place where the stages meet.

find the objects -> mask each -> guess its rotation -> rank the CAD candidates, each at its best rotation
near a guess -> fit the focal length that lays the best one over the object -> refine the pose
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import cadpose
from cadpose.alignment.placement import Placement
from cadpose.alignment.refinement.refine import Refiner
from cadpose.alignment.trust import Trust
from cadpose.annotations.document import Failure
from cadpose.backends import Backends
from cadpose.detection.flags import flagged
from cadpose.errors import CadposeError, DependencyError, InputError, LibraryError
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.intrinsics import Intrinsics
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
from cadpose.stopwatch import Stopwatch
from cadpose.weights import REGISTRY

log = logging.getLogger(__name__)

#: Side of the square crops and renders that are compared.
SIDE = 224


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


class Annotator:
    """Photo to 4-DoF annotations; this class is the whole inference API.

    Args:
        library: CAD library, its folder, or None for the default one (``cadpose library add``).
        detector: Finds the objects: a name (see ``cadpose.backends``) or a ``Detector``.
        masks: Finds their pixels: a name or a ``MaskEstimator``.
        rotation: Tells how they are turned: a name or a ``RotationEstimator``.
        similarity: Ranks the models: a name or a ``SimilarityMeasure``.
        renderer: Draws them: a name or a ``Renderer``.
        candidates: CAD models compared with each object.
        index: Chooses them by what the object looks like; the category's representatives if None.
        categories: Library categories to look for; None means all that the library holds.
        align_to: ``"box"`` fits the focal length to the detection box with the middles of box and projected
            rectangle together; ``"paper"`` keeps the principal point at the box's middle as the paper does;
            ``"mask"`` fits the silhouette to the mask. See docs/alignment.md.
        refine: ``"off"``, ``"fast"`` or ``"full"``: render and compare about the fitted pose; never with
            ``align_to="paper"``.
        intrinsics: Tells which camera took a photo; EXIF where None.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds everything that draws random numbers.
        cache: Folder of template galleries; None for the user's cache folder.

    Raises:
        LibraryError: the library is missing or empty, or has no model of a category asked for.
        CadposeError: a backend's name is unknown or its dependency is missing.

    Examples:
        A library of one crate, and a photo of a brown rectangle whose box and rotation are known:

        >>> import tempfile
        >>> from pathlib import Path
        >>> import numpy as np
        >>> import trimesh
        >>> from cadpose import Annotator, Box, Detection, Library, Rotation
        >>> from cadpose.library.importers import add_path
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = trimesh.creation.box((0.4, 0.5, 1.0)).export(folder / "crate.obj")
        >>> _ = add_path(Library.create(folder / "library"), folder / "crate.obj", category="box")
        >>> photo = np.full((120, 160, 3), 200, np.uint8)
        >>> photo[30:90, 40:120] = (120, 80, 40)
        >>> known = Detection(Box(40, 30, 120, 90), "box", rotation=Rotation(40, 20))
        >>> annotator = Annotator(
        ...     folder / "library", masks="none", similarity="aligned", refine="off", cache=folder / "cache"
        ... )
        >>> for annotation in annotator.annotate(photo, [known]):
        ...     print(annotation.cad.name, annotation.pose.rotation, round(annotation.box_iou, 1))
        crate Rotation(azimuth=40.0, elevation=20.0, inplane=0.0) 0.9
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
        refine: str = "fast",
        intrinsics: Intrinsics | None = None,
        device: str = "cpu",
        seed: int = 0,
        cache: Path | None = None,
    ) -> None:
        if candidates < 1:
            raise ValueError(f"candidates must be at least 1, got {candidates}")
        self.library = library if isinstance(library, Library) else Library.open(_path(library))
        self.categories = tuple(self._known(name) for name in categories or self.library.categories())
        self.candidate_count = candidates
        self.intrinsics = Intrinsics() if intrinsics is None else intrinsics
        self.seed, self.index = seed, index
        backends = Backends(device, seed, cache, self.render_framed, self.library.symmetry, self.library.mesh)
        self.renderer = backends.renderer(renderer)
        self.detector = backends.detector(detector, self.categories)
        self.masks = backends.masks(masks)
        self.rotation = backends.rotation(rotation, self.renderer.name)
        self.placement = Placement(self.renderer, align_to, backends.refiner(refine), refine)
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

    def refiner(self, mode: str) -> Refiner | None:
        """What refines poses in a mode; None for ``off``."""
        return self._backends.refiner(mode)

    def annotate(
        self, photo: Photo | NDArray[np.uint8] | Path | str, detections: Sequence[Detection] | None = None
    ) -> list[Annotation]:
        """The 4-DoF annotations of a photo, one an object; objects that fail are logged.

        Args:
            photo: A path, a decoded ``Photo``, or (H, W, 3) uint8 RGB.
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
        """As ``annotate``, with the failures and the time each stage took."""
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
        pool = self.candidates(category) if cads is None else cads
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

    def candidates(self, category: str) -> tuple[CadModel, ...]:
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

    def annotate_object(
        self, photo: Photo, detection: Detection, cads: Sequence[CadModel] | None = None
    ) -> Annotation:
        """The annotation of one object.

        Args:
            photo: The photo.
            detection: The object.
            cads: Models to choose among; those of its category, or of the index, if None.

        Raises:
            CadposeError: the object cannot be annotated.
        """
        return self._annotate_object(photo, flagged(detection, photo.width, photo.height), Stopwatch(), cads)

    def _annotate_object(
        self,
        photo: Photo,
        detection: Detection,
        clock: Stopwatch,
        cads: Sequence[CadModel] | None = None,
    ) -> Annotation:
        box = detection.box.clipped(photo.width, photo.height)
        if box is None:
            raise InputError(f"the box {detection.box.to_tuple()} lies outside the photo")
        if detection.mask is not None and detection.mask.shape != (photo.height, photo.width):
            raise InputError(
                f"the mask of {detection.mask.shape[1]} x {detection.mask.shape[0]} pixels does not fit the "
                f"photo of {photo.width} x {photo.height}"
            )
        detection = replace(detection, box=box)
        named = cads is not None
        with clock.time("library"):
            cads = self.candidates(detection.category) if cads is None else cads
        if detection.mask is None:
            with clock.time("mask"):
                detection = replace(detection, mask=self.masks.mask(photo, box))
        with clock.time("rotation"):
            if detection.rotation is not None:
                hypotheses = [RotationHypothesis(detection.rotation, 1.0, 1.0)]
            else:
                hypotheses = self.estimate_rotation(photo, box, detection.category, cads)
        with clock.time("similarity"):
            if self.index is not None and not named:
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
            size = best.cad.size_cm
            placed = self.placement.place(
                photo,
                box,
                detection.mask,
                self.library.mesh(best.cad),
                best.rotation,
                symmetry=self.library.symmetry(best.cad) if self.placement.refine != "off" else None,
                turn=detection.rotation is None,
                camera=self.intrinsics.camera_of(photo),
                diagonal_m=None if size is None else float(np.linalg.norm(size)) / 100.0,
            )
        found = Annotation(
            photo_name=photo.name,
            photo_sha256=photo.sha256,
            photo_size=(photo.width, photo.height),
            detection=detection,
            pose=placed.pose,
            candidates=candidates,
            hypotheses=tuple(hypotheses),
            box_iou=placed.box_iou,
            mask_iou=placed.mask_iou,
            seconds=dict(clock.seconds),
            provenance=self.provenance(),
            none_probability=None if joint is None else joint.none_probability,
            cad_needs_review=joint is not None and joint.needs_review,
            refinement=placed.refinement,
            pose_6dof=placed.pose_6dof,
        )
        trust = Trust.shipped().of(found) if placed.refinement is not None else None
        return found if trust is None else replace(found, confidence=trust[0], verdict=trust[1])

    def provenance(self) -> dict[str, object]:
        """What every annotation says it was made with: version, library digest, stages, options."""
        refines = self.placement.refine != "off"
        every = set(self.categories) == set(self.library.categories())
        return {
            "cadpose": cadpose.__version__,
            "library": self.library.digest,
            "detector": self.detector.name,
            "masks": self.masks.name,
            "rotation": self.rotation.name,
            "similarity": self.similarity.name,
            "renderer": self.renderer.name,
            "align_to": self.placement.align_to,
            "refine": self.placement.refine,
            "refinement": REGISTRY["refinement"].sha256[:12] if refines else None,
            "trust": Trust.shipped().digest if refines else None,
            "intrinsics": self.intrinsics.name,
            "categories": None if every else sorted(set(self.categories)),
            "candidates": self.candidate_count,
            "index": None if self.index is None else self.index.digest,
            "seed": self.seed,
        }


def _path(value: Path | str | None) -> Path | None:
    return None if value is None else Path(value)


def _photo(photo: Photo | NDArray[np.uint8] | Path | str) -> Photo:
    if isinstance(photo, Photo):
        return photo
    if isinstance(photo, str | Path):
        return read_photo(Path(photo))
    return Photo(photo)
