"""What the store gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal, get_args

from cadpose.errors import CadposeError
from cadpose.geometry.boxes import Box
from cadpose.records import Annotation, CadModel, Mask, Pose4Dof

#: What can be said of an annotation.
DecisionVerdict = Literal["accept", "reject", "edit", "auto_accept", "review", "skip"]
Kind = Literal["human", "program"]
VERDICTS: tuple[DecisionVerdict, ...] = get_args(DecisionVerdict)
#: Verdicts that let an annotation be used without another look.
TRUSTED: tuple[DecisionVerdict, ...] = ("accept", "edit", "auto_accept")


class ConflictError(CadposeError):
    """An annotation changed after it was read: load it again and decide anew."""


@dataclass(frozen=True, slots=True)
class StoredPhoto:
    """A row of the photos table.

    Attributes:
        sha256: Digest of the photo's bytes, the key.
        name: Its name when it was last written.
        width: Pixels.
        height: Pixels.
    """

    sha256: str
    name: str
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class StoredFailure:
    """A photo that could not be annotated; gone once it is.

    Attributes:
        name: Its path as it was given.
        sha256: Digest of its bytes, None where they could not be read.
        stage: Where it ended.
        reason: One sentence.
        attempts: How often it was tried.
        failed_at: When it was last tried, UTC.
    """

    name: str
    sha256: str | None
    stage: str
    reason: str
    attempts: int
    failed_at: datetime


@dataclass(frozen=True, slots=True)
class Author:
    """Who or what decides.

    Attributes:
        name: The person's name, or the program's.
        kind: ``"human"`` or ``"program"``.
        tool: With what, for example ``"cadpose review"``.
        tool_version: Its version.

    Raises:
        ValueError: the name is empty or the kind is another word.
    """

    name: str
    kind: Kind = "human"
    tool: str = ""
    tool_version: str = ""

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ValueError("a decision needs its author's name")
        if self.kind not in get_args(Kind):
            raise ValueError(f"an author is human or program, not {self.kind!r}")


@dataclass(frozen=True, eq=False, slots=True)
class Region:
    """Where the object is in its photo, as a person drew it.

    Attributes:
        box: Rectangle in continuous pixels of the photo.
        mask: (H, W) bool of the photo's size, or None.

    Raises:
        ValueError: the mask is not a 2-D bool array, or empty.
    """

    box: Box
    mask: Mask | None = None

    def __post_init__(self) -> None:
        if self.mask is None:
            return
        if self.mask.ndim != 2 or self.mask.dtype != bool:
            raise ValueError("Region.mask must be a (H, W) bool array")
        if not self.mask.any():
            raise ValueError("the mask has no pixel")


@dataclass(frozen=True, slots=True)
class StoredDecision:
    """One decision on one annotation.

    Attributes:
        id: Digest of everything else.
        annotation_id: What was decided on.
        author: Who or what decided.
        decided_at: When, UTC.
        verdict: What was decided.
        reason: Why, for example ``"wrong front"``; may be empty.
        note: Free text; may be empty.
        pose_before: The pose that was looked at.
        pose_after: The pose that was set, None where it was left.
        cad_before: The model that was looked at.
        cad_after: The model that was set, None where it was left.
        region_after: Box and mask that were set, None where they were left.
        measures: ``box_iou`` and ``mask_iou`` of the pose that was set, as far as they were told.
    """

    id: str
    annotation_id: str
    author: Author
    decided_at: datetime
    verdict: DecisionVerdict
    reason: str = ""
    note: str = ""
    pose_before: Pose4Dof | None = None
    pose_after: Pose4Dof | None = None
    cad_before: CadModel | None = None
    cad_after: CadModel | None = None
    region_after: Region | None = None
    measures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class QueueItem:
    """An annotation as a list shows it.

    Attributes:
        annotation_id: Its key.
        version: Hand it to ``Store.decide`` as ``expected_version``.
        photo_sha256: The photo's key.
        photo_name: The photo's name.
        photo_size: (width, height) in pixels.
        position: Its place in the photo's document.
        category: What was detected.
        score: The detector's, in [0, 1].
        cad_id: The model, after any edit.
        cad_name: Its name.
        box_iou: Of the machine's pose.
        mask_iou: Of the machine's pose, None without a mask.
        confidence: Chance that the machine's answer is right, None where it is not told.
        machine_verdict: What the program said when it annotated.
        verdict: What holds now, None where nobody and nothing has decided.
        decided_by: ``"human"``, ``"program"`` or None.
        edited: Whether a decision changed pose, model or region.
        in_force: Whether lists and exports give it; a former answer is history.
    """

    annotation_id: str
    version: int
    photo_sha256: str
    photo_name: str
    photo_size: tuple[int, int]
    position: int
    category: str
    score: float
    cad_id: str
    cad_name: str
    box_iou: float
    mask_iou: float | None
    confidence: float | None
    machine_verdict: str | None
    verdict: DecisionVerdict | None
    decided_by: Kind | None
    edited: bool
    in_force: bool


@dataclass(frozen=True, slots=True)
class Page:
    """Some items of a list, and the key that gives those after them: None at the end."""

    items: tuple[QueueItem, ...]
    after: str | None


@dataclass(frozen=True, slots=True)
class StoredAnnotation:
    """An annotation and what is known of it beside what it says."""

    item: QueueItem
    annotation: Annotation
