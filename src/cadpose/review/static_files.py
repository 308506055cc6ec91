"""The built page: files of one folder, listed when the server starts, and nothing else by any path."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fastapi import APIRouter, Request, Response

from cadpose.review.refusals import not_found

FOLDER = Path(__file__).parent / "static"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".woff2": "font/woff2",
    ".json": "application/json",
}
_NOT_BUILT = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>cadpose review</title>'
    "<p>The server runs, but its page is not built: run <code>make web</code> in the repository.</p></html>"
)


def static_routes(folder: Path = FOLDER) -> APIRouter:
    """``/`` and ``/static/...``; files are checked by ETag, so that a new build shows at once."""
    known = {
        path.relative_to(folder).as_posix(): path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in _TYPES and not path.is_symlink()
    }
    routes = APIRouter()

    def answer(name: str, request: Request) -> Response:
        if name not in known:
            raise not_found("there is no such file")
        try:
            data = known[name].read_bytes()
        except OSError:
            raise not_found("there is no such file any more") from None
        tag = f'"{hashlib.sha256(data).hexdigest()[:16]}"'
        headers = {"etag": tag, "cache-control": "no-cache"}
        if request.headers.get("if-none-match") == tag:
            return Response(None, 304, headers)
        return Response(data, media_type=_TYPES[known[name].suffix], headers=headers)

    @routes.get("/")
    def page(request: Request) -> Response:
        if "index.html" not in known:
            return Response(_NOT_BUILT, media_type=_TYPES[".html"])
        return answer("index.html", request)

    @routes.get("/static/{name:path}")
    def static(name: str, request: Request) -> Response:
        return answer(name, request)

    return routes
