"""What the server answers, beside the parts in :mod:`cadpose.review.shapes`."""

from __future__ import annotations

from typing import Literal, Self

from cadpose.annotations.store import QueueItem
from cadpose.records import Detection
from cadpose.review.shapes import BoxShape, CadShape, PoseShape, RleShape, RotationShape, Shape


class LibraryTold(Shape):
    """The opened CAD library: models, and how many a category."""

    models: int
    categories: dict[str, int]


class Limits(Shape):
    """The largest photo: bytes of its file, pixels."""

    upload_bytes: int
    pixels: int


class Actions(Shape):
    """What can be done here."""

    annotate: bool
    snap: bool
    replace: bool
    example: bool


class FormatTold(Shape):
    """A format of the exports; ``needs`` says why it cannot be made here, and is empty where it can."""

    name: str
    title: str
    needs: str


class SessionAnswer(Shape):
    """What the page asks first."""

    version: str
    author: str
    store: str
    library: LibraryTold | None
    limits: Limits
    actions: Actions
    formats: list[FormatTold]
    reasons: list[str]


class PhotoName(Shape):
    """A photo as lists name it."""

    sha256: str
    name: str
    width: int
    height: int


class PhotoTold(PhotoName):
    """A photo, and where its picture is: null where the file is not at hand."""

    image: str | None


class CadName(Shape):
    """A CAD model as lists name it."""

    id: str
    name: str


class Item(Shape):
    """An annotation as the queue shows it."""

    id: str
    version: int
    photo: PhotoName
    category: str
    cad: CadName
    box_iou: float
    mask_iou: float | None
    confidence: float | None
    machine_verdict: str | None
    verdict: str | None
    decided_by: str | None
    edited: bool
    thumb: str

    @classmethod
    def of(cls, item: QueueItem) -> Self:
        """From the store's."""
        width, height = item.photo_size
        return cls(
            id=item.annotation_id,
            version=item.version,
            photo=PhotoName(sha256=item.photo_sha256, name=item.photo_name, width=width, height=height),
            category=item.category,
            cad=CadName(id=item.cad_id, name=item.cad_name),
            box_iou=item.box_iou,
            mask_iou=item.mask_iou,
            confidence=item.confidence,
            machine_verdict=item.machine_verdict,
            verdict=item.verdict,
            decided_by=item.decided_by,
            edited=item.edited,
            # The version changes with what is drawn, so the picture may be kept.
            thumb=f"/api/annotations/{item.annotation_id}/thumb.jpg?v={item.version}",
        )


class QueueAnswer(Shape):
    """A page of the queue; ``total`` counts all that the selection takes."""

    items: list[Item]
    after: str | None
    total: int


class DetectionTold(Shape):
    """The object in the photo."""

    category: str
    score: float
    box: BoxShape
    mask: RleShape | None
    source: str
    truncated: bool
    tiny: bool
    unsure: bool
    alternatives: list[tuple[str, float]]

    @classmethod
    def of(cls, detection: Detection) -> Self:
        """From the record."""
        return cls(
            category=detection.category,
            score=detection.score,
            box=detection.box.to_tuple(),
            mask=None if detection.mask is None else RleShape.of(detection.mask),
            source=detection.source,
            truncated=detection.truncated,
            tiny=detection.tiny,
            unsure=detection.unsure,
            alternatives=list(detection.alternatives),
        )


class Machine(Shape):
    """The machine's own answer, whatever people changed since."""

    pose: PoseShape
    cad: CadShape


class CandidateTold(Shape):
    """A model that the machine compared with the object; rank 1 was its answer."""

    rank: int
    cad: CadShape
    score: float
    probability: float | None
    rotation: RotationShape


class HypothesisTold(Shape):
    """A rotation that the machine considered."""

    rotation: RotationShape
    score: float
    probability: float
    expected_error: float | None
    needs_review: bool


class Decided(Shape):
    """A decision of the past; ``changed`` names what it set."""

    author: str
    kind: Literal["human", "program"]
    at: str
    verdict: str
    reason: str
    note: str
    changed: list[Literal["pose", "cad", "region"]]


class AnnotationAnswer(Shape):
    """All of one annotation."""

    id: str
    version: int
    in_force: bool
    photo: PhotoTold
    detection: DetectionTold
    pose: PoseShape
    cad: CadShape
    machine: Machine
    start: PoseShape | None
    candidates: list[CandidateTold]
    hypotheses: list[HypothesisTold]
    none_probability: float | None
    confidence: float | None
    machine_verdict: str | None
    verdict: str | None
    decided_by: str | None
    edited: bool
    box_iou: float
    mask_iou: float | None
    depth: Literal["ratio", "scale", "metric"]
    history: list[Decided]
    siblings: list[str]


class DecisionAnswer(Shape):
    """What became of a decision."""

    item: Item
    version: int


class SnapAnswer(Shape):
    """A refined pose, with how well it agrees with box and mask and the likeness before and after."""

    pose: PoseShape
    box_iou: float
    mask_iou: float | None
    start_score: float
    score: float
    seconds: float


class CadsAnswer(Shape):
    """A page of the library."""

    items: list[CadShape]
    after: str | None


class SymmetryAnswer(Shape):
    """Rotations R_s_from_s (row-major, without the identity) after which a model looks alike."""

    name: str
    R: list[list[float]]
    continuous: bool


class JobAnswer(Shape):
    """A photo that is being annotated."""

    id: str
    name: str
    state: Literal["queued", "running", "done", "failed"]
    stage: str
    share: float
    error: str | None
    photo_sha256: str | None
    annotations: list[str]
    seconds: float


class JobsAnswer(Shape):
    """All jobs, the newest first."""

    items: list[JobAnswer]


class ReplaceAnswer(Shape):
    """Where the picture and the scene with the other model are."""

    picture: str
    scene: str
    seconds: float


class ProgressAnswer(Shape):
    """How many annotations there are, and on how many a person has decided."""

    total: int
    decided: int


class AuthorTold(Shape):
    """One person's pace."""

    author: str
    decisions: int
    last_hour: int
    median_seconds: float | None


class DayTold(Shape):
    """Decisions of a day, UTC."""

    day: str
    decisions: int


class BetweenPeople(Shape):
    """How far people agree on what several of them decided."""

    pairs: int
    same_verdict: float | None
    median_rotation_deg: float | None


class WithMachine(Shape):
    """What people made of the machine's annotations."""

    decided: int
    accepted_unchanged: int
    edited: int
    rejected: int


class Agreement(Shape):
    """Both agreements."""

    between_people: BetweenPeople
    with_machine: WithMachine


class StatsAnswer(Shape):
    """Progress, pace and agreement."""

    total: int
    decided: int
    by_verdict: dict[str, int]
    authors: list[AuthorTold]
    days: list[DayTold]
    agreement: Agreement
