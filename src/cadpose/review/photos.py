"""The photos themselves: always decoded and encoded anew, never a file's own bytes."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response

from cadpose.errors import InputError
from cadpose.review.desk import Desk
from cadpose.review.drawing import photo_jpeg
from cadpose.review.refusals import not_found
from cadpose.review.shapes import DIGEST

#: What has a digest or a version in its address never changes.
KEEP = {"cache-control": "private, max-age=31536000, immutable"}
#: Sides in pixels of a photo's longer edge.
LEAST_SIDE, USUAL_SIDE, MOST_SIDE = 16, 1600, 8192

PhotoDigest = Annotated[str, Path(pattern=DIGEST)]


def image_url(sha256: str) -> str:
    """Where a photo's picture is."""
    return f"/api/photos/{sha256}/image?side={USUAL_SIDE}"


def photo_routes(desk: Desk) -> APIRouter:
    """Routes under ``/api/photos/{sha256}``."""
    routes = APIRouter()

    @routes.get("/photos/{sha256}/image")
    @desk.slow
    def image(
        sha256: PhotoDigest, side: Annotated[int, Query(ge=LEAST_SIDE, le=MOST_SIDE)] = USUAL_SIDE
    ) -> Response:
        name = desk.photo_name(sha256)

        def draw() -> bytes:
            return photo_jpeg(desk.photo(sha256, name), side)

        try:
            picture = desk.pictures.made(f"photo 1 {sha256} {side}", draw)
        except InputError as error:
            raise not_found(str(error)) from None
        return Response(picture, media_type="image/jpeg", headers=KEEP)

    return routes
