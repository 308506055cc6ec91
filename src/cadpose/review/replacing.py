"""``POST /api/annotations/{id}/replace``: another model stands where the object was."""

from __future__ import annotations

import secrets
import threading
import time
from functools import lru_cache
from typing import Annotated

from fastapi import APIRouter, Path, Response
from pydantic import Field

from cadpose.library.catalogue import Library
from cadpose.replacement.replacer import Replacer
from cadpose.review.answers import ReplaceAnswer
from cadpose.review.desk import Desk, photo_of
from cadpose.review.drawing import png
from cadpose.review.items import AnnotationId
from cadpose.review.kept import Kept
from cadpose.review.photos import KEEP
from cadpose.review.refusals import RefusedError, not_found
from cadpose.review.shapes import PoseShape, Shape
from cadpose.review.studio import seconds_since

#: Bytes of results that are kept, the oldest going first.
MOST_BYTES = 256 * 2**20
_PATIENCE = 60.0

ResultId = Annotated[str, Path(pattern="^[0-9a-f]{32}$")]


class ReplaceBody(Shape):
    """What stands there instead, and how."""

    cad_id: Annotated[str, Field(max_length=2000)]
    pose: PoseShape | None = None
    shadow: bool = True
    light: bool = True


def replace_routes(desk: Desk) -> APIRouter:
    """The route, and those of its results: by random names, for a while."""
    routes = APIRouter()
    turn = threading.Lock()
    pictures: Kept[bytes] = Kept(MOST_BYTES, len)
    scenes: Kept[bytes] = Kept(MOST_BYTES, len)

    @lru_cache(maxsize=1)
    def replacer(library: Library) -> Replacer:
        return Replacer(library)

    @routes.post("/annotations/{annotation_id}/replace")
    @desk.slow
    def replace(annotation_id: AnnotationId, body: ReplaceBody) -> ReplaceAnswer:
        begun = time.perf_counter()
        found = desk.stored(annotation_id)
        pose = None if body.pose is None else body.pose.pose(found.item.photo_size)
        cad = desk.models.of_id(body.cad_id)
        photo = desk.photo(*photo_of(found.annotation))
        others = [
            other.annotation
            for other in desk.store.standing(photo.sha256)
            if other.item.annotation_id != annotation_id
        ]
        if not turn.acquire(timeout=_PATIENCE):
            raise RefusedError("busy", "another picture is being made: try again in a moment")
        try:
            made = replacer(desk.models.opened()).replace(
                photo,
                found.annotation,
                cad,
                pose=pose,
                shadow=body.shadow,
                light=body.light,
                others=others,
            )
            name = secrets.token_hex(16)
            pictures.put(name, png(made.picture))
            scenes.put(name, made.scene_glb())
        finally:
            turn.release()
        return ReplaceAnswer(
            picture=f"/api/replacements/{name}/picture.png",
            scene=f"/api/replacements/{name}/scene.glb",
            seconds=seconds_since(begun),
        )

    def result(held: Kept[bytes], name: str, kind: str) -> Response:
        data = held.get(name)
        if data is None:
            raise not_found("this picture is not kept any more: make it again")
        return Response(data, media_type=kind, headers=KEEP)

    @routes.get("/replacements/{name}/picture.png")
    def picture(name: ResultId) -> Response:
        return result(pictures, name, "image/png")

    @routes.get("/replacements/{name}/scene.glb")
    def scene(name: ResultId) -> Response:
        return result(scenes, name, "model/gltf-binary")

    return routes
