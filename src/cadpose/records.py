"""The records that the stages hand to one another: frozen, validated on construction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.boxes import Box
from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation

__all__ = [
    "Annotation",
    "CadModel",
    "Candidate",
    "Detection",
    "Mask",
    "Photo",
    "PhotoCamera",
    "Pose4Dof",
    "Pose6Dof",
    "Refinement",
    "Rotation",
    "RotationHypothesis",
    "Verdict",
    "Views",
]

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Photo:
    """A decoded photograph, EXIF orientation already applied.

    Attributes:
        rgb: (H, W, 3) uint8 sRGB, at least 1 x 1.
        name: What to call it in messages and file names: the path as the user gave it.
        sha256: Hex digest of the file's bytes, or of the pixels where there was no file.
        focal_35mm: EXIF's 35 mm equivalent focal length, if told.

    Raises:
        ValueError: ``rgb`` has another shape or type, or no pixel.

    Examples:
        >>> import numpy as np
        >>> from cadpose import Photo
        >>> photo = Photo(np.zeros((480, 640, 3), np.uint8), name="black")
        >>> photo.width, photo.height, photo.name
        (640, 480, 'black')
    """

    rgb: NDArray[np.uint8]
    name: str = "photo"
    sha256: str = ""
    focal_35mm: float | None = None

    def __post_init__(self) -> None:
        rgb = np.ascontiguousarray(self.rgb)
        if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3 or 0 in rgb.shape:
            raise ValueError(f"Photo.rgb must be (H, W, 3) uint8, got {rgb.shape} {rgb.dtype}")
        rgb = rgb.view()  # the caller may go on writing to an array of its own
        rgb.setflags(write=False)
        object.__setattr__(self, "rgb", rgb)

    @property
    def width(self) -> int:
        """Width in pixels."""
        return int(self.rgb.shape[1])

    @property
    def height(self) -> int:
        """Height in pixels."""
        return int(self.rgb.shape[0])


@dataclass(frozen=True, slots=True)
class RotationHypothesis:
    """One answer of a rotation estimator.

    Attributes:
        rotation: The three angles.
        score: Higher is better; comparable within one photo only.
        probability: Chance that the rotation is within 30° of the true one, in [0, 1]. Calibrated where
            the estimator is (``"embedded"``), else the share of this hypothesis among those returned.
        expected_error: Expected angle to the true rotation in degrees, None if the estimator tells none.
        needs_review: Whether a person should look before the answer is used.

    Raises:
        ValueError: the score is not finite, the probability is outside [0, 1] or the expected error
            outside [0, 180].
    """

    rotation: Rotation
    score: float
    probability: float = 0.0
    expected_error: float | None = None
    needs_review: bool = False

    def __post_init__(self) -> None:
        if not np.isfinite(self.score):
            raise ValueError(f"hypothesis score {self.score} must be finite")
        if not 0.0 <= self.probability <= 1.0 + 1e-9:
            raise ValueError(f"hypothesis probability {self.probability} is outside [0, 1]")
        if self.expected_error is not None and not 0.0 <= self.expected_error <= 180.0:
            raise ValueError(f"hypothesis expected error {self.expected_error} is outside [0, 180] degrees")


@dataclass(frozen=True, eq=False)
class Detection:
    """One object found in a photo.

    Attributes:
        box: Rectangle in continuous pixels of the photo.
        category: Library category, for example ``"car"``.
        score: Confidence in [0, 1].
        mask: (H, W) bool of the photo's size, or None.
        source: What made it: ``"embedded"``, ``"user"``, ``"file"`` ...
        rotation: A rotation given from outside, if any.
        alternatives: Other categories with their scores, best first.
        truncated: The box touches the photo's edge, so that part of the object may lie beyond it.
        tiny: The box has too few pixels to be trusted; ``cadpose.detection.flags`` sets both.
        unsure: There is an object, but its category is a guess; the detector sets it.

    Raises:
        ValueError: the score is outside [0, 1] or the mask is not a 2-D bool array.

    Examples:
        >>> from cadpose import Box, Detection, Rotation
        >>> found = Detection(Box(100, 69, 685, 446), "motorbike", rotation=Rotation(275, 5))
        >>> found.category, found.score, found.rotation.azimuth
        ('motorbike', 1.0, 275.0)
    """

    box: Box
    category: str
    score: float = 1.0
    mask: Mask | None = None
    source: str = "user"
    rotation: Rotation | None = None
    alternatives: tuple[tuple[str, float], ...] = ()
    truncated: bool = False
    tiny: bool = False
    unsure: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.score <= 1.0:
            raise ValueError(f"detection score {self.score} is outside [0, 1]")
        if not self.category:
            raise ValueError("a detection needs a category")
        if self.mask is not None and (self.mask.ndim != 2 or self.mask.dtype != np.bool_):
            raise ValueError("Detection.mask must be a (H, W) bool array")


@dataclass(frozen=True, slots=True)
class CadModel:
    """A catalogue entry; its mesh is loaded from the library by ``id``.

    Attributes:
        id: Unique in the catalogue, for example ``"Scopia/scopia/van/van.obj"``.
        name: What a person calls it.
        category: Library category.
        source: Importer and file it came from.
        licence: SPDX-like name; ``"unknown"`` where the source does not say.
        creator: Author, or empty.
        size_cm: Width, depth, height in centimetres where the source tells, else None.
        face_count: Number of triangles.
        sha256: Digest of the stored mesh file.

    Raises:
        ValueError: the id or the category is empty.

    Examples:
        >>> from cadpose import CadModel
        >>> van = CadModel("mymodels/van.glb", "Delivery van", "car", licence="CC0-1.0")
        >>> van.name, van.category, van.licence
        ('Delivery van', 'car', 'CC0-1.0')
    """

    id: str
    name: str
    category: str
    source: str = ""
    licence: str = "unknown"
    creator: str = ""
    size_cm: tuple[float, float, float] | None = None
    face_count: int = 0
    sha256: str = ""

    def __post_init__(self) -> None:
        if not self.id or not self.category:
            raise ValueError("a CAD model needs an id and a category")


@dataclass(frozen=True, eq=False)
class Views:
    """N renders of one mesh, background transparent.

    Attributes:
        rgb: (N, H, W, 3) uint8 sRGB, black where nothing was drawn.
        alpha: (N, H, W) uint8 coverage, 255 inside.
        depth: (N, H, W) float32 z in the camera frame at the pixel's centre, inf where empty.

    Raises:
        ValueError: the three do not fit together in shape, or have other types.
    """

    rgb: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    depth: NDArray[np.float32]

    def __post_init__(self) -> None:
        shape, depth = self.alpha.shape, self.depth.shape
        if self.rgb.shape != (*shape, 3) or depth != shape or self.alpha.ndim != 3:
            raise ValueError(f"Views: rgb {self.rgb.shape}, alpha {shape}, depth {depth} do not fit")
        if self.rgb.dtype != np.uint8 or self.alpha.dtype != np.uint8 or self.depth.dtype != np.float32:
            raise ValueError(
                f"Views: rgb and alpha are uint8, depth float32; got {self.rgb.dtype}, "
                f"{self.alpha.dtype}, {self.depth.dtype}"
            )

    def __len__(self) -> int:
        return len(self.alpha)

    @classmethod
    def joined(cls, parts: Sequence[Views]) -> Views:
        """All views in order; the parts share one size."""
        return cls(
            np.concatenate([part.rgb for part in parts]),
            np.concatenate([part.alpha for part in parts]),
            np.concatenate([part.depth for part in parts]),
        )

    def take(self, indices: Sequence[int] | NDArray[np.int64]) -> Views:
        """The views at these indices, in that order."""
        keep = np.asarray(indices, np.int64)
        return Views(self.rgb[keep], self.alpha[keep], self.depth[keep])

    @property
    def mask(self) -> Mask:
        """(N, H, W) bool, at least half covered."""
        return np.asarray(self.alpha >= 128)

    def over(self, background: int = 255) -> NDArray[np.uint8]:
        """(N, H, W, 3) uint8 composited over a uniform grey level."""
        alpha = np.repeat(self.alpha, 3, axis=-1).reshape(self.rgb.shape).astype(np.uint16)
        total = self.rgb * alpha
        total += np.uint16(background) * (np.uint16(255) - alpha)
        total += np.uint16(127)
        # Divided by 255, rounded down: exact for all that is possible here, and in 16 bits.
        total += (total >> 8) + np.uint16(1)
        return (total >> 8).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A CAD model compared with the photo.

    Attributes:
        cad: The catalogue entry.
        score: The measure it is ranked by; higher is better.
        rotation: The rotation at which it scored so.
        measures: Every measure that was computed, by name.
        probability: Chance that it is the object's model, in [0, 1]; None where the ranking tells none.

    Raises:
        ValueError: the score is not finite, or the probability is outside [0, 1].
    """

    cad: CadModel
    score: float
    rotation: Rotation
    measures: dict[str, float] = field(default_factory=dict)
    probability: float | None = None

    def __post_init__(self) -> None:
        if not np.isfinite(self.score):
            raise ValueError(f"candidate {self.cad.id}: score {self.score} must be finite")
        if self.probability is not None and not 0.0 <= self.probability <= 1.0 + 1e-9:
            raise ValueError(f"candidate {self.cad.id}: probability {self.probability} is outside [0, 1]")


@dataclass(frozen=True, slots=True)
class Refinement:
    """What render-and-compare changed of a pose.

    Attributes:
        mode: ``"fast"`` or ``"full"``.
        start: The pose that it began with.
        start_score: Score of ``start``; higher is better, comparable within one object only.
        score: Score of the refined pose, at least ``start_score``.
        evaluations: Poses that were drawn and compared.
        expected_error: Angle in degrees that the network expected to be left after its last step, whichever
            pose was the best in the end; None where it was not asked.

    Raises:
        ValueError: a score is not finite, the refined pose is worse than the start, or the expected error is
            outside [0, 180].
    """

    mode: str
    start: Pose4Dof
    start_score: float
    score: float
    evaluations: int
    expected_error: float | None = None

    def __post_init__(self) -> None:
        if self.expected_error is not None and not 0.0 <= self.expected_error <= 180.0:
            raise ValueError(f"expected error {self.expected_error} is outside [0, 180] degrees")
        if not np.isfinite((self.start_score, self.score)).all():
            raise ValueError("the scores of a refinement must be finite")
        if self.score < self.start_score:
            raise ValueError(f"a refinement to {self.score} is worse than its start, {self.start_score}")


#: What may be done with an annotation: use it, let a person look first, or leave it out.
Verdict = Literal["auto_accept", "review", "reject"]


@dataclass(frozen=True, eq=False)
class Annotation:
    """The 4-DoF annotation of one object, with what it was chosen from.

    Attributes:
        photo_name: The photo's name.
        photo_sha256: Digest of the photo's bytes.
        photo_size: (width, height) in pixels.
        detection: Object, box, category and mask.
        pose: The four degrees of freedom.
        candidates: CAD models in rank order; the first one is the answer.
        hypotheses: Rotation hypotheses in rank order.
        box_iou: IoU of the projected model's rectangle and the detection box.
        mask_iou: IoU of the rendered silhouette and the mask, None without a mask.
        seconds: Time spent by stage.
        provenance: Names and versions of everything that took part.
        none_probability: Chance that none of the candidates is the object's model; None where the ranking
            tells none. With the candidates' probabilities it adds up to 1.
        cad_needs_review: Whether a person should look before the model is used.
        refinement: What changed the pose after the focal length was fitted; None where nothing did.
        pose_6dof: The pose in the camera that took the photo; None where that camera is unknown, and then
            only the ratio f / t_z of ``pose`` has been seen.
        confidence: Calibrated chance that rotation and model are both right; None where it is not told.
        verdict: What ``confidence`` allows; None where it is not told.

    Raises:
        ValueError: there is no candidate, the photo's size is not positive, an IoU or a probability is
            outside [0, 1], or the verdict is another word.

    Examples:
        >>> from cadpose import Annotation, Box, CadModel, Detection, Pose4Dof, Rotation
        >>> from cadpose.records import Candidate, RotationHypothesis
        >>> turned = Rotation(40, 20)
        >>> annotation = Annotation(
        ...     photo_name="photo.png",
        ...     photo_sha256="",
        ...     photo_size=(160, 120),
        ...     detection=Detection(Box(40, 30, 120, 90), "car"),
        ...     pose=Pose4Dof(turned, focal_px=180.0, principal_px=(84.0, 55.0)),
        ...     candidates=(Candidate(CadModel("mymodels/van.glb", "Van", "car"), 1.0, turned),),
        ...     hypotheses=(RotationHypothesis(turned, 1.0, 1.0),),
        ...     box_iou=0.89,
        ... )
        >>> annotation.cad.name, annotation.offset_px, annotation.needs_review
        ('Van', (4.0, -5.0), False)
    """

    photo_name: str
    photo_sha256: str
    photo_size: tuple[int, int]
    detection: Detection
    pose: Pose4Dof
    candidates: tuple[Candidate, ...]
    hypotheses: tuple[RotationHypothesis, ...]
    box_iou: float
    mask_iou: float | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    none_probability: float | None = None
    cad_needs_review: bool = False
    refinement: Refinement | None = None
    pose_6dof: Pose6Dof | None = None
    confidence: float | None = None
    verdict: Verdict | None = None

    def __post_init__(self) -> None:
        if not self.candidates:
            raise ValueError("an annotation needs at least one CAD candidate")
        if min(self.photo_size) < 1:
            raise ValueError(f"photo_size {self.photo_size} must be positive")
        for name in ("box_iou", "mask_iou", "none_probability", "confidence"):
            share = getattr(self, name)
            if share is not None and not 0.0 <= share <= 1.0 + 1e-9:
                raise ValueError(f"{name} {share} is outside [0, 1]")
        if self.verdict not in (None, "auto_accept", "review", "reject"):
            raise ValueError(f"a verdict is auto_accept, review or reject, not {self.verdict!r}")

    @property
    def offset_px(self) -> tuple[float, float]:
        """(dx, dy) from the box's middle to the principal point: the fifth and sixth number of a pose."""
        (x, y), (cx, cy) = self.pose.principal_px, self.detection.box.centre
        return x - cx, y - cy

    @property
    def cad(self) -> CadModel:
        """The chosen CAD model."""
        return self.candidates[0].cad

    @property
    def needs_review(self) -> bool:
        """Whether a person should look before the rotation or the model is used."""
        return self.cad_needs_review or (bool(self.hypotheses) and self.hypotheses[0].needs_review)

    @property
    def none_fits(self) -> bool:
        """Whether the answer is "none of these": the first candidate is then the nearest, not the same."""
        return self.none_probability is not None and self.none_probability > 0.5
