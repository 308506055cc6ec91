"""What a run keeps of each finished photo: enough for tables, pages and --resume without its document."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import ConfigDict, Field

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.parts import DetectionPart, Part, Sha256, Size
from cadpose.records import Verdict

Count = Annotated[int, Field(ge=0)]


class Kept(Part):
    """Strict base of what is kept beside documents; keys of a later version are passed over."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


class FoundObject(Kept):
    """What is told of an object that was found: its category and what may be wrong with it."""

    category: str
    alternatives: tuple[tuple[str, float], ...]
    truncated: bool
    tiny: bool
    unsure: bool
    box: tuple[float, float, float, float]


class AnnotatedObject(FoundObject):
    """An annotated object: model, pose and how sure they are. Angles in degrees, lengths in pixels."""

    cad_id: str
    cad_name: str
    azimuth: float
    elevation: float
    inplane: float
    focal_px: float
    probability: float | None
    expected_error: float | None
    needs_review: bool
    cad_probability: float | None
    none_probability: float | None
    cad_needs_review: bool
    confidence: float | None
    verdict: Verdict | None
    box_iou: float
    mask_iou: float | None

    @property
    def doubtful(self) -> bool:
        """A person should look at it."""
        if self.verdict is not None:
            return self.verdict != "auto_accept"
        return self.needs_review or self.cad_needs_review


class LeftOutObject(FoundObject):
    """An object that was found and not annotated."""

    stage: str
    reason: str


class PhotoRecord(Kept):
    """One finished photo.

    Attributes:
        photo: Its path as it was named.
        sha256: Of its bytes.
        file_bytes, file_mtime_ns: Size and time of its file when it was read; 0 where that is not known.
        size: Width and height in pixels.
        made_with: Key of what it was made with, see :mod:`cadpose.batch.making`.
        output_bytes: Size of the document, then of each picture, in the order of ``OutputPaths``.
        seconds: Time by stage.
        objects: What was annotated.
        left_out: What was found and not annotated.
    """

    photo: str
    sha256: Sha256
    file_bytes: Count
    file_mtime_ns: int
    size: tuple[Size, Size]
    made_with: str
    output_bytes: tuple[Count, ...]
    seconds: dict[str, float]
    objects: tuple[AnnotatedObject, ...]
    left_out: tuple[LeftOutObject, ...]


def record_of(
    document: AnnotationDocument,
    *,
    made_with: str,
    seconds: Mapping[str, float],
    file: tuple[int, int] = (0, 0),
    output_bytes: tuple[int, ...] = (),
) -> PhotoRecord:
    """What to keep of a document.

    Args:
        document: What was found.
        made_with: Key of what it was made with.
        seconds: Time by stage.
        file: Size and time (ns) of the photo's file when it was read.
        output_bytes: Size of the document, then of each picture.
    """
    return PhotoRecord(
        photo=document.photo.name,
        sha256=document.photo.sha256,
        file_bytes=file[0],
        file_mtime_ns=file[1],
        size=document.photo.size,
        made_with=made_with,
        output_bytes=output_bytes,
        seconds={stage: round(spent, 4) for stage, spent in seconds.items()},
        objects=tuple(_annotated(part) for part in document.annotations),
        left_out=tuple(
            LeftOutObject(
                category=part.detection.category,
                alternatives=_alternatives(part.detection),
                truncated=part.detection.truncated,
                tiny=part.detection.tiny,
                unsure=part.detection.unsure,
                box=part.detection.box,
                stage=part.stage,
                reason=part.reason,
            )
            for part in document.failures
        ),
    )


def _annotated(part: AnnotationPart) -> AnnotatedObject:
    found, first = part.detection, part.hypotheses[0] if part.hypotheses else None
    return AnnotatedObject(
        category=found.category,
        alternatives=_alternatives(found),
        truncated=found.truncated,
        tiny=found.tiny,
        unsure=found.unsure,
        box=found.box,
        cad_id=part.cad.id,
        cad_name=part.cad.name,
        azimuth=part.pose.azimuth,
        elevation=part.pose.elevation,
        inplane=part.pose.inplane,
        focal_px=part.pose.focal_px,
        probability=None if first is None else first.probability,
        expected_error=None if first is None else first.expected_error,
        needs_review=first is not None and first.needs_review,
        cad_probability=part.candidates[0].probability,
        none_probability=part.none_probability,
        cad_needs_review=part.cad_needs_review,
        confidence=part.confidence,
        verdict=part.verdict,
        box_iou=part.box_iou,
        mask_iou=part.mask_iou,
    )


def _alternatives(found: DetectionPart) -> tuple[tuple[str, float], ...]:
    return tuple((other.category, other.score) for other in found.alternatives)
