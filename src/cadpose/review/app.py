"""The application: the API, the page, and the guard before both."""

from __future__ import annotations

from fastapi import APIRouter, FastAPI
from starlette.types import ASGIApp

from cadpose.review.cads import cad_routes
from cadpose.review.decisions import decision_routes
from cadpose.review.desk import Desk
from cadpose.review.exporting import export_routes
from cadpose.review.items import item_routes
from cadpose.review.photos import photo_routes
from cadpose.review.refusals import answer_errors
from cadpose.review.replacing import replace_routes
from cadpose.review.security import Access, Guard
from cadpose.review.session import session_routes
from cadpose.review.snapping import snap_routes
from cadpose.review.static_files import static_routes
from cadpose.review.statistics import statistics_routes
from cadpose.review.turns import few_threads
from cadpose.review.uploads import upload_routes


def make_app(desk: Desk, access: Access) -> ASGIApp:
    """The whole server as an ASGI application.

    Args:
        desk: What it serves.
        access: Who is let in.
    """
    # No page of documentation: it would load scripts from elsewhere.
    app = FastAPI(
        title="cadpose review", docs_url=None, redoc_url=None, openapi_url=None, lifespan=few_threads
    )
    app.router.redirect_slashes = False
    api = APIRouter(prefix="/api")
    for routes in (
        session_routes,
        item_routes,
        decision_routes,
        snap_routes,
        photo_routes,
        cad_routes,
        upload_routes,
        replace_routes,
        export_routes,
        statistics_routes,
    ):
        api.include_router(routes(desk))
    app.include_router(api)
    app.include_router(static_routes())
    answer_errors(app)
    return Guard(app, access)
