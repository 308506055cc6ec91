"""What people say of annotations: written at once, refused where somebody else was first."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter
from pydantic import Field

from cadpose.annotations.store import ConflictError, Region, StoredAnnotation
from cadpose.errors import InputError
from cadpose.records import CadModel, Pose4Dof
from cadpose.review.answers import DecisionAnswer, Item
from cadpose.review.desk import Desk
from cadpose.review.items import AnnotationId
from cadpose.review.kept import Kept
from cadpose.review.refusals import RefusedError
from cadpose.review.shapes import CurrentShape, Long, PoseShape, RegionShape, Shape, Short

#: Answers that are kept for a page that asks again because it did not get one.
MOST_ANSWERS = 4096


class DecisionBody(Shape):
    """A decision; ``edit`` is accepting with changes, and takes at least one of pose, model and region.

    ``request_id`` is the page's own name for it: sent once more, it gets the first answer again.
    """

    verdict: Literal["accept", "reject", "edit", "review", "skip"]
    version: Annotated[int, Field(ge=0)]
    author: Short = ""
    reason: Short = ""
    note: Long = ""
    pose: PoseShape | None = None
    cad_id: Annotated[str, Field(max_length=2000)] | None = None
    region: RegionShape | None = None
    request_id: Annotated[str, Field(pattern="^[0-9a-f]{32}$")] | None = None


def decision_routes(desk: Desk) -> APIRouter:
    """``POST /api/annotations/{id}/decisions``."""
    routes = APIRouter()
    answers: Kept[DecisionAnswer] = Kept(MOST_ANSWERS, lambda answer: 1)

    def told_before(annotation_id: str, body: DecisionBody) -> DecisionAnswer | None:
        return answers.get(f"{annotation_id} {body.request_id}")

    @routes.post("/annotations/{annotation_id}/decisions")
    def decide(annotation_id: AnnotationId, body: DecisionBody) -> DecisionAnswer:
        found = desk.stored(annotation_id)
        if not found.item.in_force or found.item.version != body.version:
            if body.request_id is not None:
                # Under the lock: the same request's first try may be storing its decision just now.
                with desk.writing():
                    known = told_before(annotation_id, body)
                if known is not None:
                    return known
            raise conflict(desk, annotation_id)
        size = found.item.photo_size
        pose = None if body.pose is None else body.pose.pose(size)
        cad = None if body.cad_id is None else desk.models.of_id(body.cad_id)
        region = None if body.region is None else body.region.region(size)
        if (pose, cad, region) != (None, None, None) and body.verdict != "edit":
            raise InputError(f"the verdict {body.verdict} takes no changes: say edit")
        measures = measured(desk, found, pose, cad, region) if body.verdict == "edit" else None
        with desk.writing():
            try:
                version = desk.store.decide(
                    annotation_id,
                    body.verdict,
                    desk.person(body.author),
                    expected_version=body.version,
                    reason=body.reason,
                    note=body.note,
                    pose=pose,
                    cad=cad,
                    region=region,
                    measures=measures,
                )
            except ConflictError as error:
                known = told_before(annotation_id, body)
                if known is not None:
                    return known
                raise conflict(desk, annotation_id, error) from None
            # Also where another run took its place right behind the decision.
            item = desk.stored(annotation_id).item
            answer = DecisionAnswer(item=Item.of(item), version=version)
            if body.request_id is not None:
                answers.put(f"{annotation_id} {body.request_id}", answer)
        return answer

    return routes


def measured(
    desk: Desk,
    found: StoredAnnotation,
    pose: Pose4Dof | None,
    cad: CadModel | None,
    region: Region | None,
) -> dict[str, float] | None:
    """box_iou and mask_iou of what is set; None where the model is not at hand.

    Raises:
        InputError: the model cannot be drawn so.
    """
    now = found.annotation
    mesh = desk.models.mesh(cad or now.cad)
    if mesh is None:
        return None
    box, mask = now.detection.box, now.detection.mask
    if region is not None:
        box, mask = region.box, region.mask
    return desk.studio.measure(mesh, pose or now.pose, box, mask).told()


def conflict(desk: Desk, annotation_id: str, error: ConflictError | None = None) -> RefusedError:
    """409 with what holds now."""
    item, last = desk.stored(annotation_id).item, desk.store.history(annotation_id)[-1:]
    by = last[0].author.name if last else ""
    sentence = str(error) if error is not None else _sentence(item.in_force, by, item.verdict)
    current = CurrentShape(version=item.version, in_force=item.in_force, verdict=item.verdict, by=by)
    return RefusedError("conflict", sentence, current)


def _sentence(in_force: bool, by: str, verdict: str | None) -> str:
    if not in_force:
        return "another answer holds in this annotation's place: load the photo again"
    who = f" by {by} ({verdict})" if by else ""
    return f"this annotation was changed meanwhile{who}: load it again and decide anew"
