"""The parts of the JSON document as pydantic models, each made from a record and turned back into it.

They refuse unknown keys, numbers that are not finite, and parts that contradict themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from cadpose.geometry.boxes import Box
from cadpose.records import (
    CadModel,
    Candidate,
    Detection,
    Pose4Dof,
    Rotation,
    RotationHypothesis,
)
from cadpose.rle import check_runs, decode_mask, encode_mask

Unit = Annotated[float, Field(ge=0.0, le=1.0)]
# An IoU or a probability may exceed 1 by rounding; the records allow the same.
Share = Annotated[float, Field(ge=0.0, le=1.0 + 1e-9)]
Positive = Annotated[float, Field(gt=0.0)]
Size = Annotated[int, Field(ge=1)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Row3 = tuple[float, float, float]
Matrix3 = tuple[Row3, Row3, Row3]


class Part(BaseModel):
    """Strict base: unknown keys and numbers that are not finite are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """The schema of what is written now: keys that older documents lack are required too."""
        schema = handler(core_schema)
        told = handler.resolve_ref_schema(schema)
        told["required"] = list(told["properties"])
        for rule in told["properties"].values():
            rule.pop("default", None)
        return schema


class PhotoPart(Part):
    """The photo: its name as given, the SHA-256 of its bytes, [width, height] in pixels."""

    name: str
    sha256: Sha256
    size: tuple[Size, Size]


class MaskPart(Part):
    """COCO's uncompressed RLE: [height, width] and column-major runs, background first."""

    size: tuple[Size, Size]
    counts: list[Annotated[int, Field(ge=0)]]

    @model_validator(mode="after")
    def _runs_fill_the_mask(self) -> Self:
        check_runs(self.size, self.counts)
        return self


class AlternativePart(Part):
    """Another category that the detector considered."""

    category: str
    score: float


class RotationPart(Part):
    """Azimuth [0, 360), elevation [-90, 90], in-plane rotation (-180, 180], in degrees."""

    azimuth: Annotated[float, Field(ge=0.0, lt=360.0)]
    elevation: Annotated[float, Field(ge=-90.0, le=90.0)]
    inplane: Annotated[float, Field(gt=-180.0, le=180.0)]

    @classmethod
    def of(cls, rotation: Rotation) -> RotationPart:
        """From the record."""
        return cls(azimuth=rotation.azimuth, elevation=rotation.elevation, inplane=rotation.inplane)

    def record(self) -> Rotation:
        """To the record."""
        return Rotation(self.azimuth, self.elevation, self.inplane)


class DetectionPart(Part):
    """The object in the photo: box [x0, y0, x1, y1] in continuous pixels, category, mask.

    truncated: the box touches the photo's edge; tiny: it has too few pixels to be trusted; unsure: the
    category is a guess.
    """

    box: tuple[float, float, float, float]
    category: Annotated[str, Field(min_length=1)]
    score: Unit
    source: str
    alternatives: tuple[AlternativePart, ...]
    rotation: RotationPart | None
    mask: MaskPart | None
    # Documents of earlier versions lack the three.
    truncated: bool = False
    tiny: bool = False
    unsure: bool = False

    @model_validator(mode="after")
    def _box_is_not_empty(self) -> Self:
        Box(*self.box)
        return self

    @classmethod
    def of(cls, detection: Detection) -> DetectionPart:
        """From the record."""
        mask = detection.mask
        return cls(
            box=_floats4(detection.box.to_tuple()),
            category=plain_text(detection.category),
            score=float(detection.score),
            source=plain_text(detection.source),
            alternatives=tuple(
                AlternativePart(category=plain_text(category), score=float(score))
                for category, score in detection.alternatives
            ),
            rotation=None if detection.rotation is None else RotationPart.of(detection.rotation),
            mask=None
            if mask is None
            else MaskPart(size=(mask.shape[0], mask.shape[1]), counts=encode_mask(mask)),
            truncated=bool(detection.truncated),
            tiny=bool(detection.tiny),
            unsure=bool(detection.unsure),
        )

    def record(self) -> Detection:
        """To the record."""
        return Detection(
            box=Box(*self.box),
            category=self.category,
            score=self.score,
            source=self.source,
            alternatives=tuple((other.category, other.score) for other in self.alternatives),
            rotation=None if self.rotation is None else self.rotation.record(),
            mask=None if self.mask is None else decode_mask(self.mask.size, self.mask.counts),
            truncated=self.truncated,
            tiny=self.tiny,
            unsure=self.unsure,
        )


class PosePart(RotationPart):
    """The four degrees of freedom, and the same as matrices: p ~ K (R_cv_from_s X + (0, 0, t_z))."""

    focal_px: Positive
    principal_px: tuple[float, float]
    t_z: Positive
    R_cv_from_s: Matrix3
    K: Matrix3

    @model_validator(mode="after")
    def _matrices_say_the_same(self) -> Self:
        if not np.allclose(self.record().to_matrix(), self.R_cv_from_s, rtol=0.0, atol=1e-9):
            raise ValueError("R_cv_from_s is not the matrix of azimuth, elevation and inplane")
        if _intrinsics(self.focal_px, self.principal_px) != self.K:
            raise ValueError("K is not the matrix of focal_px and principal_px")
        return self

    @classmethod
    def of_pose(cls, pose: Pose4Dof) -> PosePart:
        """From the record."""
        x, y = (float(value) for value in pose.principal_px)
        rows = pose.rotation.to_matrix().tolist()
        return cls(
            azimuth=pose.rotation.azimuth,
            elevation=pose.rotation.elevation,
            inplane=pose.rotation.inplane,
            focal_px=float(pose.focal_px),
            principal_px=(x, y),
            t_z=float(pose.t_z),
            R_cv_from_s=(_floats3(rows[0]), _floats3(rows[1]), _floats3(rows[2])),
            K=_intrinsics(float(pose.focal_px), (x, y)),
        )

    def pose(self) -> Pose4Dof:
        """To the record."""
        return Pose4Dof(self.record(), self.focal_px, self.principal_px, self.t_z)


class CadPart(Part):
    """A CAD model of the catalogue, with whom to thank for it; size_cm is width, depth, height."""

    id: Annotated[str, Field(min_length=1)]
    name: str
    category: Annotated[str, Field(min_length=1)]
    licence: str
    creator: str
    source: str
    size_cm: tuple[float, float, float] | None
    face_count: Annotated[int, Field(ge=0)]
    sha256: str

    @classmethod
    def of(cls, cad: CadModel) -> CadPart:
        """From the record."""
        return cls(
            id=plain_text(cad.id),
            name=plain_text(cad.name),
            category=plain_text(cad.category),
            licence=plain_text(cad.licence),
            creator=plain_text(cad.creator),
            source=plain_text(cad.source),
            size_cm=None if cad.size_cm is None else _floats3(cad.size_cm),
            face_count=int(cad.face_count),
            sha256=cad.sha256,
        )

    def record(self) -> CadModel:
        """To the record."""
        return CadModel(**self.model_dump())


class CandidatePart(Part):
    """A CAD model compared with the photo; rank 1 is the answer, a higher score is better.

    probability is the chance that it is the object's model; null where the ranking tells none.
    """

    rank: Annotated[int, Field(ge=1)]
    cad: CadPart
    score: float
    rotation: RotationPart
    measures: dict[str, float]
    # Documents of earlier versions lack it, as they do the two of an annotation. No validator that runs
    # before can add it: what it returns is no JSON any more, and in strict mode a list is then no tuple.
    probability: Share | None = None

    def record(self) -> Candidate:
        """To the record."""
        return Candidate(
            self.cad.record(), self.score, self.rotation.record(), dict(self.measures), self.probability
        )


class HypothesisPart(Part):
    """One rotation that the estimator proposed, in rank order.

    With an expected_error (degrees), probability is the calibrated chance of being within 30 degrees of the
    true rotation; without one, the share among the hypotheses.
    """

    rotation: RotationPart
    score: float
    probability: Share
    expected_error: Annotated[float, Field(ge=0.0, le=180.0)] | None
    needs_review: bool

    @model_validator(mode="before")
    @classmethod
    def _older_documents_lack_two_keys(cls, data: Any) -> Any:
        return {"expected_error": None, "needs_review": False, **data} if isinstance(data, dict) else data

    @classmethod
    def of(cls, hypothesis: RotationHypothesis) -> HypothesisPart:
        """From the record."""
        error = hypothesis.expected_error
        return cls(
            rotation=RotationPart.of(hypothesis.rotation),
            score=float(hypothesis.score),
            probability=float(hypothesis.probability),
            expected_error=None if error is None else float(error),
            needs_review=bool(hypothesis.needs_review),
        )

    def record(self) -> RotationHypothesis:
        """To the record."""
        return RotationHypothesis(
            self.rotation.record(), self.score, self.probability, self.expected_error, self.needs_review
        )


def _intrinsics(focal: float, principal: tuple[float, float]) -> Matrix3:
    return (focal, 0.0, principal[0]), (0.0, focal, principal[1]), (0.0, 0.0, 1.0)


def _floats3(values: Sequence[float]) -> Row3:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _floats4(values: Sequence[float]) -> tuple[float, float, float, float]:
    a, b, c, d = (float(value) for value in values)
    return a, b, c, d


def plain_text(value: str) -> str:
    """Text that JSON can carry."""
    # A file name that is not UTF-8 reaches Python as lone surrogates, which JSON cannot carry.
    return value.encode("utf-8", "backslashreplace").decode("utf-8")


def plain_json(value: Any) -> Any:
    """JSON's own types: numpy scalars and arrays, tuples and paths turned into them."""
    if isinstance(value, dict):
        return {plain_text(str(key)): plain_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_json(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain_json(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        raise ValueError(f"provenance holds {value}, which JSON cannot carry")
    if value is None or isinstance(value, (bool, int, float)):
        return value
    return plain_text(str(value))
