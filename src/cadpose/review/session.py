"""``GET /api/session``: who and what the page has before it."""

from __future__ import annotations

from fastapi import APIRouter

from cadpose import __version__
from cadpose.photos import MAX_BYTES, MAX_PIXELS
from cadpose.review.answers import Actions, LibraryTold, Limits, SessionAnswer
from cadpose.review.desk import Desk
from cadpose.review.exporting import formats_told
from cadpose.review.uploads import example_of

#: What is said of a rejected annotation.
REASONS = (
    "wrong model",
    "wrong rotation",
    "front and back swapped",
    "wrong size",
    "wrong object",
    "not visible enough",
    "duplicate",
)


def session_routes(desk: Desk) -> APIRouter:
    """The route."""
    routes = APIRouter()

    @routes.get("/session")
    def session() -> SessionAnswer:
        library = desk.models.library
        has = library is not None
        return SessionAnswer(
            version=__version__,
            author=desk.author,
            store=desk.store.place,
            library=None
            if library is None
            else LibraryTold(models=len(library.models()), categories=library.categories()),
            limits=Limits(upload_bytes=MAX_BYTES, pixels=MAX_PIXELS),
            actions=Actions(annotate=has, snap=has, replace=has, example=example_of(desk.models) is not None),
            formats=formats_told(desk),
            reasons=list(REASONS),
        )

    return routes
