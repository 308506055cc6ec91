"""The part of the JSON document that holds the annotation of one object."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, JsonValue, field_validator, model_validator

from cadpose.annotations.parts import (
    CadPart,
    CandidatePart,
    DetectionPart,
    HypothesisPart,
    Part,
    PhotoPart,
    PosePart,
    RotationPart,
    Share,
    plain_json,
    plain_text,
)
from cadpose.annotations.pose_parts import Depth, Pose6DofPart, RefinementPart, depth_of
from cadpose.records import Annotation, Verdict


class AnnotationPart(Part):
    """The 4-DoF annotation of one object, with what it was chosen from.

    none_probability is the chance that none of the candidates is the object's model, null where the ranking
    tells none; cad_needs_review says that a person should look before the model is used.

    depth says what is known of the distance: "ratio" where only f / t_z was seen and t_z is a convention,
    "scale" where pose_6dof gives it in model diagonals, "metric" where it gives metres.

    confidence is the calibrated chance that rotation and model are both right, and verdict what it allows:
    auto_accept, review or reject; both are null where it is not told.
    """

    detection: DetectionPart
    pose: PosePart
    cad: CadPart
    candidates: Annotated[tuple[CandidatePart, ...], Field(min_length=1)]
    hypotheses: tuple[HypothesisPart, ...]
    none_probability: Share | None = None
    cad_needs_review: bool = False
    depth: Depth = "ratio"
    pose_6dof: Pose6DofPart | None = None
    refinement: RefinementPart | None = None
    confidence: Share | None = None
    verdict: Verdict | None = None
    box_iou: Share
    mask_iou: Share | None
    seconds: dict[str, float]
    provenance: dict[str, JsonValue]

    @field_validator("provenance")
    @classmethod
    def _finite(cls, value: dict[str, JsonValue]) -> dict[str, JsonValue]:
        plain_json(value)
        return value

    @model_validator(mode="after")
    def _first_candidate_is_the_answer(self) -> Self:
        if self.candidates[0].cad != self.cad:
            raise ValueError("cad is not the first candidate")
        if [c.rank for c in self.candidates] != list(range(1, len(self.candidates) + 1)):
            raise ValueError("the candidates' ranks are not 1, 2, 3 ...")
        return self

    @model_validator(mode="after")
    def _depth_is_what_the_pose_tells(self) -> Self:
        if self.depth != depth_of(self.pose_6dof):
            raise ValueError(f"depth is {self.depth}, but pose_6dof says {depth_of(self.pose_6dof)}")
        return self

    @classmethod
    def of(cls, annotation: Annotation) -> AnnotationPart:
        """From the record."""
        whole = None if annotation.pose_6dof is None else Pose6DofPart.of(annotation.pose_6dof)
        changed = annotation.refinement
        return cls(
            detection=DetectionPart.of(annotation.detection),
            pose=PosePart.of_pose(annotation.pose),
            cad=CadPart.of(annotation.cad),
            candidates=tuple(
                CandidatePart(
                    rank=rank,
                    cad=CadPart.of(candidate.cad),
                    score=float(candidate.score),
                    rotation=RotationPart.of(candidate.rotation),
                    measures={plain_text(name): float(value) for name, value in candidate.measures.items()},
                    probability=None if candidate.probability is None else float(candidate.probability),
                )
                for rank, candidate in enumerate(annotation.candidates, start=1)
            ),
            hypotheses=tuple(HypothesisPart.of(hypothesis) for hypothesis in annotation.hypotheses),
            none_probability=None
            if annotation.none_probability is None
            else float(annotation.none_probability),
            cad_needs_review=bool(annotation.cad_needs_review),
            depth=depth_of(whole),
            pose_6dof=whole,
            refinement=None if changed is None else RefinementPart.of(changed),
            confidence=None if annotation.confidence is None else float(annotation.confidence),
            verdict=annotation.verdict,
            box_iou=float(annotation.box_iou),
            mask_iou=None if annotation.mask_iou is None else float(annotation.mask_iou),
            seconds={plain_text(stage): float(spent) for stage, spent in annotation.seconds.items()},
            provenance=plain_json(annotation.provenance),
        )

    def record(self, photo: PhotoPart) -> Annotation:
        """To the record."""
        return Annotation(
            photo_name=photo.name,
            photo_sha256=photo.sha256,
            photo_size=photo.size,
            detection=self.detection.record(),
            pose=self.pose.pose(),
            candidates=tuple(candidate.record() for candidate in self.candidates),
            hypotheses=tuple(hypothesis.record() for hypothesis in self.hypotheses),
            box_iou=self.box_iou,
            mask_iou=self.mask_iou,
            seconds=dict(self.seconds),
            provenance=plain_json(self.provenance),
            none_probability=self.none_probability,
            cad_needs_review=self.cad_needs_review,
            refinement=None if self.refinement is None else self.refinement.record(),
            pose_6dof=None if self.pose_6dof is None else self.pose_6dof.pose(),
            confidence=self.confidence,
            verdict=self.verdict,
        )
