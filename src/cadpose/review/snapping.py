"""``POST /api/snap``: refine from where the person left the model."""

from __future__ import annotations

import time
from typing import Annotated, Literal

from fastapi import APIRouter, Request
from pydantic import Field

from cadpose.errors import LibraryError
from cadpose.review.answers import SnapAnswer
from cadpose.review.desk import Desk, photo_of
from cadpose.review.shapes import Digest, PoseShape, RegionShape, Shape
from cadpose.review.studio import seconds_since
from cadpose.review.turns import Turn

#: Seconds that a snap waits for others.
PATIENCE = 20.0


class SnapBody(Shape):
    """A pose to refine; ``region`` where the person drew another than is stored."""

    annotation_id: Digest
    cad_id: Annotated[str, Field(max_length=2000)]
    pose: PoseShape
    mode: Literal["fast", "full"] = "fast"
    region: RegionShape | None = None


def snap_routes(desk: Desk) -> APIRouter:
    """The route."""
    routes = APIRouter()
    turn = Turn(PATIENCE, "the server is busy with other poses: try again in a moment")

    @routes.post("/snap")
    async def snap(request: Request, body: SnapBody) -> SnapAnswer:
        async with turn.of(request):
            return await desk.slow.run(snapped, body)

    def snapped(body: SnapBody) -> SnapAnswer:
        begun = time.perf_counter()
        found = desk.stored(body.annotation_id)
        now, size = found.annotation, found.item.photo_size
        start = body.pose.pose(size)
        cad = desk.models.of_id(body.cad_id)
        mesh = desk.models.mesh(cad)
        if mesh is None:
            raise LibraryError(f"the mesh of {cad.id} cannot be read: see `cadpose library check`")
        box, mask = now.detection.box, now.detection.mask
        if body.region is not None:
            region = body.region.region(size)
            box, mask = region.box, region.mask
        photo = desk.photo(*photo_of(now))
        symmetry = desk.models.opened().symmetry(cad)
        pose, record = desk.studio.snap(photo, box, mask, mesh, start, body.mode, symmetry)
        measured = desk.studio.measure(mesh, pose, box, mask)
        return SnapAnswer(
            pose=PoseShape.of(pose),
            box_iou=measured.box_iou,
            mask_iou=measured.mask_iou,
            start_score=record.start_score,
            score=record.score,
            seconds=seconds_since(begun),
        )

    return routes
