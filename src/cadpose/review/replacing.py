"""``POST /api/annotations/{id}/replace``: another model stands where the object was."""

from __future__ import annotations

import secrets
import time
from dataclasses import replace
from functools import lru_cache
from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from pydantic import Field

from cadpose.library.catalogue import Library
from cadpose.records import Annotation
from cadpose.replacement.replacer import Replacer
from cadpose.review.answers import ReplaceAnswer
from cadpose.review.desk import Desk, photo_of
from cadpose.review.drawing import png
from cadpose.review.items import AnnotationId
from cadpose.review.kept import Kept
from cadpose.review.photos import KEEP
from cadpose.review.refusals import not_found
from cadpose.review.shapes import PoseShape, RegionShape, Shape
from cadpose.review.studio import seconds_since
from cadpose.review.turns import Turn

#: Bytes of results that are kept, the oldest going first.
MOST_BYTES = 256 * 2**20
_PATIENCE = 60.0

ResultId = Annotated[str, Path(pattern="^[0-9a-f]{32}$")]


class NowShape(Shape):
    """The old object as it stands on the page, where that is not what is stored."""

    pose: PoseShape | None = None
    cad_id: Annotated[str, Field(max_length=2000)] | None = None
    region: RegionShape | None = None


class ReplaceBody(Shape):
    """What stands there instead (``cad_id``), and how; where exactly, the old object tells."""

    cad_id: Annotated[str, Field(max_length=2000)]
    now: NowShape | None = None
    shadow: bool = True
    light: bool = True


def replace_routes(desk: Desk) -> APIRouter:
    """The route, and those of its results: by random names, for a while."""
    routes = APIRouter()
    turn = Turn(_PATIENCE, "another picture is being made: try again in a moment")
    pictures: Kept[bytes] = Kept(MOST_BYTES, len)
    scenes: Kept[bytes] = Kept(MOST_BYTES, len)

    @lru_cache(maxsize=1)
    def replacer(library: Library) -> Replacer:
        return Replacer(library)

    @routes.post("/annotations/{annotation_id}/replace")
    async def replaced(request: Request, annotation_id: AnnotationId, body: ReplaceBody) -> ReplaceAnswer:
        async with turn.of(request):
            return await desk.slow.run(made, annotation_id, body)

    def made(annotation_id: str, body: ReplaceBody) -> ReplaceAnswer:
        begun = time.perf_counter()
        found = desk.stored(annotation_id)
        old = found.annotation if body.now is None else standing_now(desk, found.annotation, body.now)
        cad = desk.models.of_id(body.cad_id)
        photo = desk.photo(*photo_of(found.annotation))
        others = [
            other.annotation
            for other in desk.store.standing(photo.sha256)
            if other.item.annotation_id != annotation_id
        ]
        result = replacer(desk.models.opened()).replace(
            photo, old, cad, shadow=body.shadow, light=body.light, others=others
        )
        name = secrets.token_hex(16)
        pictures.put(name, png(result.picture))
        scenes.put(name, result.scene_glb())
        return ReplaceAnswer(
            picture=f"/api/replacements/{name}/picture.png",
            scene=f"/api/replacements/{name}/scene.glb",
            seconds=seconds_since(begun),
        )

    def kept(held: Kept[bytes], name: str, kind: str) -> Response:
        data = held.get(name)
        if data is None:
            raise not_found("this picture is not kept any more: make it again")
        return Response(data, media_type=kind, headers=KEEP)

    @routes.get("/replacements/{name}/picture.png")
    def picture(name: ResultId) -> Response:
        return kept(pictures, name, "image/png")

    @routes.get("/replacements/{name}/scene.glb")
    def scene(name: ResultId) -> Response:
        return kept(scenes, name, "model/gltf-binary")

    return routes


def standing_now(desk: Desk, stored: Annotation, now: NowShape) -> Annotation:
    """The old object with the pose, model and region that it has on the page.

    Raises:
        InputError: a pose or region does not fit the photo.
        LibraryError: the library lacks the model.
    """
    pose = stored.pose if now.pose is None else now.pose.pose(stored.photo_size)
    detection, first = stored.detection, stored.candidates[0]
    if now.region is not None:
        region = now.region.region(stored.photo_size)
        detection = replace(detection, box=region.box, mask=region.mask)
    if now.cad_id is not None:
        first = replace(first, cad=desk.models.of_id(now.cad_id))
    return replace(stored, pose=pose, detection=detection, candidates=(first, *stored.candidates[1:]))
