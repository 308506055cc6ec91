"""The queue, and everything of one annotation."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query, Response

from cadpose.annotations.pose_parts import depth_of
from cadpose.annotations.store import Selection, StoredAnnotation, StoredDecision
from cadpose.errors import InputError
from cadpose.review.answers import (
    AnnotationAnswer,
    CandidateTold,
    Decided,
    DetectionTold,
    HypothesisTold,
    Item,
    Machine,
    PhotoTold,
    QueueAnswer,
)
from cadpose.review.desk import Desk, photo_of
from cadpose.review.drawing import missing_png, object_jpeg
from cadpose.review.photos import KEEP, image_url
from cadpose.review.shapes import DIGEST, PoseShape, RotationShape

AnnotationId = Annotated[str, Path(pattern=DIGEST)]
_Unit = Annotated[float | None, Query(ge=0.0, le=1.0)]
_Text = Annotated[str | None, Query(max_length=500)]


def item_routes(desk: Desk) -> APIRouter:
    """Routes under ``/api/queue`` and ``/api/annotations``."""
    routes = APIRouter()

    @routes.get("/queue")
    def queue(
        limit: Annotated[int, Query(ge=1, le=1000)] = 50,
        after: Annotated[str | None, Query(max_length=200)] = None,
        category: _Text = None,
        cad_id: Annotated[str | None, Query(max_length=2000)] = None,
        verdict: Annotated[list[str] | None, Query(max_length=20)] = None,
        text: Annotated[str, Query(max_length=500)] = "",
        min_confidence: _Unit = None,
        max_confidence: _Unit = None,
        decided_by: Literal["human", "program"] | None = None,
    ) -> QueueAnswer:
        selection = Selection(
            category=category or None,
            cad_id=cad_id or None,
            verdicts=tuple(verdict or ()),
            min_confidence=min_confidence,
            max_confidence=max_confidence,
            text=text,
            decided_by=decided_by,
        )
        page = desk.store.queue(selection, after=after or None, limit=limit)
        total = desk.store.count(selection)
        return QueueAnswer(items=[Item.of(item) for item in page.items], after=page.after, total=total)

    @routes.get("/annotations/{annotation_id}")
    def annotation(annotation_id: AnnotationId) -> AnnotationAnswer:
        return told_annotation(desk, desk.stored(annotation_id))

    @routes.get("/annotations/{annotation_id}/thumb.jpg")
    @desk.slow
    def thumb(annotation_id: AnnotationId) -> Response:
        found = desk.stored(annotation_id)
        pose, cad = found.annotation.pose, found.annotation.cad
        mesh = desk.models.mesh(cad)
        box = found.annotation.detection.box
        drawn = PoseShape.of(pose).model_dump_json() + cad.sha256 if mesh is not None else ""
        key = f"object 1 {found.item.photo_sha256} {box.to_tuple()} {drawn}"

        def draw() -> bytes:
            photo = desk.photo(*photo_of(found.annotation))
            return object_jpeg(photo, box, mesh, pose, desk.studio.renderer)

        try:
            picture = desk.pictures.made(key, draw)
        except (InputError, ValueError):
            return Response(missing_png(), 404, media_type="image/png")
        # Without its model the picture is not the last word: a library may be opened later.
        return Response(picture, media_type="image/jpeg", headers=KEEP if mesh is not None else None)

    return routes


def told_annotation(desk: Desk, found: StoredAnnotation) -> AnnotationAnswer:
    """All of one annotation; what the machine weighed comes from its own answer."""
    item, now = found.item, found.annotation
    own = now if not item.edited else desk.stored(item.annotation_id, original=True).annotation
    sha256, name = photo_of(now)
    ids = [other.annotation_id for other in desk.store.items(sha256)]
    cad = desk.models.shape
    return AnnotationAnswer(
        id=item.annotation_id,
        version=item.version,
        in_force=item.in_force,
        photo=PhotoTold(
            sha256=sha256,
            name=name,
            width=item.photo_size[0],
            height=item.photo_size[1],
            image=image_url(sha256) if desk.at_hand(sha256, name) else None,
        ),
        detection=DetectionTold.of(now.detection),
        pose=PoseShape.of(now.pose),
        cad=cad(now.cad),
        machine=Machine(pose=PoseShape.of(own.pose), cad=cad(own.cad)),
        start=None if own.refinement is None else PoseShape.of(own.refinement.start),
        candidates=[
            CandidateTold(
                rank=rank,
                cad=cad(candidate.cad),
                score=candidate.score,
                probability=candidate.probability,
                rotation=RotationShape.of(candidate.rotation),
            )
            for rank, candidate in enumerate(own.candidates, start=1)
        ],
        hypotheses=[
            HypothesisTold(
                rotation=RotationShape.of(hypothesis.rotation),
                score=hypothesis.score,
                probability=hypothesis.probability,
                expected_error=hypothesis.expected_error,
                needs_review=hypothesis.needs_review,
            )
            for hypothesis in own.hypotheses
        ],
        none_probability=own.none_probability,
        confidence=item.confidence,
        machine_verdict=item.machine_verdict,
        verdict=item.verdict,
        decided_by=item.decided_by,
        edited=item.edited,
        box_iou=now.box_iou,
        mask_iou=now.mask_iou,
        depth=depth_of(now.pose_6dof),
        history=[_decided(decision) for decision in desk.store.history(item.annotation_id)],
        siblings=ids if item.annotation_id in ids else [*ids, item.annotation_id],
    )


def _decided(decision: StoredDecision) -> Decided:
    changes = {"pose": decision.pose_after, "cad": decision.cad_after, "region": decision.region_after}
    return Decided(
        author=decision.author.name,
        kind=decision.author.kind,
        at=decision.decided_at.isoformat(),
        verdict=decision.verdict,
        reason=decision.reason,
        note=decision.note,
        changed=[name for name in ("pose", "cad", "region") if changes[name] is not None],
    )
