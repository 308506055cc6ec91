"""Everything that goes wrong becomes one JSON sentence with its status, and nothing of the machine leaks."""

from __future__ import annotations

import logging

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from cadpose.annotations.store import ConflictError
from cadpose.errors import CadposeError, DependencyError, InputError, LibraryError
from cadpose.review.shapes import CurrentShape, ErrorShape, Kind

log = logging.getLogger(__name__)

#: Status of each kind.
STATUS: dict[Kind, int] = {
    "conflict": 409,
    "not_found": 404,
    "bad_input": 422,
    "too_large": 413,
    "busy": 503,
    "forbidden": 403,
    "failed": 500,
}
_KIND_OF: dict[int, Kind] = {status: kind for kind, status in STATUS.items()} | {400: "bad_input"}


class RefusedError(CadposeError):
    """A request that is not done.

    Args:
        kind: What is wrong.
        sentence: In one sentence.
        current: With a conflict, what holds now.
    """

    def __init__(self, kind: Kind, sentence: str, current: CurrentShape | None = None) -> None:
        super().__init__(sentence)
        self.kind, self.current = kind, current


def not_found(what: str) -> RefusedError:
    """404."""
    return RefusedError("not_found", what)


def refusal(kind: Kind, sentence: str, current: CurrentShape | None = None) -> JSONResponse:
    """The answer."""
    body = ErrorShape(error=sentence, kind=kind, current=current)
    return JSONResponse(body.model_dump(exclude_none=True), STATUS[kind])


def answer_errors(app: FastAPI) -> None:
    """Tell every error of the app so."""
    app.add_exception_handler(CadposeError, _of_ours)
    app.add_exception_handler(RequestValidationError, _of_input)
    app.add_exception_handler(HTTPException, _of_routing)
    app.add_exception_handler(Exception, _of_anything)


def _of_ours(request: Request, error: Exception) -> JSONResponse:
    if isinstance(error, RefusedError):
        return refusal(error.kind, str(error), error.current)
    if isinstance(error, ConflictError):
        return refusal("conflict", str(error))
    if isinstance(error, InputError | LibraryError | DependencyError):
        return refusal("bad_input", str(error))
    log.error("%s %s: %s", request.method, request.url.path, error)
    return refusal("failed", str(error))


def _of_input(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    where = ".".join(str(step) for step in first["loc"][1:])
    plain = "".join(c if c.isprintable() else "?" for c in f"{where}: {first['msg']}"[:300])
    if first["loc"][0] == "path":
        return refusal("not_found", "there is nothing of that name here")
    return refusal("bad_input", f"this request cannot be used, {plain}")


def _of_routing(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    kind = _KIND_OF.get(error.status_code, "bad_input")
    sentence = "there is nothing of that name here" if kind == "not_found" else str(error.detail)
    answer = refusal(kind, sentence)
    if error.status_code == 405:
        answer.status_code = 405
    return answer


def _of_anything(request: Request, error: Exception) -> JSONResponse:
    # Starlette raises it again behind the answer; the server logs the traceback.
    return refusal("failed", f"the server failed ({type(error).__name__}): its log tells more")
