"""How refusals, and the framework's own errors, become JSON."""

from __future__ import annotations

import logging
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from meshtide_server.catalogue import CatalogueError, DatabaseUnavailableError
from meshtide_server.http.methods import allowed_methods
from meshtide_server.http.models import Problem
from meshtide_server.refusals import RefusedError
from meshtide_server.store import DamagedObjectError, StoreError

if TYPE_CHECKING:
    from fastapi import FastAPI, Request, Response

logger = logging.getLogger("meshtide.server")

LONGEST_MESSAGE = 1000
EVERYWHERE: dict[int | str, dict[str, Any]] = {
    422: {"model": Problem, "description": "A parameter or the body is not what it should be."},
    429: {"model": Problem, "description": "Too many connections or writes; Retry-After says when to come again."},
}
"""Refusals that every route may answer with."""
_CODES = {
    HTTPStatus.NOT_FOUND: "not-found",
    HTTPStatus.METHOD_NOT_ALLOWED: "method-not-allowed",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "too-large",
}


def unavailable(error: StoreError | CatalogueError) -> RefusedError:
    """The refusal for what store or catalogue did not give; the log has the details, which are not for everybody."""
    if isinstance(error, DamagedObjectError):
        message = "the stream of this mesh is damaged in the server's store; its operator finds the details in the log"
        return RefusedError(HTTPStatus.INTERNAL_SERVER_ERROR, "mesh-failed", message)
    part = "store" if isinstance(error, StoreError) else "catalogue"
    logger.warning("a request met a %s that cannot be used: %s", part, error)
    message = f"the server's {part} does not answer as it should; try again in a moment"
    return RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, "not-ready", message, retry_after=1)


def problem_response(status: int, code: str, message: str, headers: dict[str, str] | None = None) -> JSONResponse:
    """The answer that says what is wrong."""
    return JSONResponse(Problem(error=code, message=message).model_dump(), status, headers)


def handle_problems(app: FastAPI) -> None:
    """Have `app` answer every refusal as a Problem."""

    async def refused(_: Request, error: Exception) -> Response:
        assert isinstance(error, RefusedError)  # noqa: S101 - it is registered for no other
        return problem_response(error.status, error.code, error.message, error.headers)

    async def elsewhere(_: Request, error: Exception) -> Response:
        assert isinstance(error, StoreError | CatalogueError)  # noqa: S101 - it is registered for no other
        refusal = unavailable(error)
        return problem_response(refusal.status, refusal.code, refusal.message, refusal.headers)

    async def framework(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)  # noqa: S101 - it is registered for no other
        status = HTTPStatus(error.status_code)
        message = {
            HTTPStatus.NOT_FOUND: "there is nothing at this address; GET / lists what there is",
            HTTPStatus.METHOD_NOT_ALLOWED: f"{request.method} is not for this address; /docs lists those that are",
        }.get(status, str(error.detail))
        headers = dict(error.headers or {})
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            headers["Allow"] = ", ".join(allowed_methods(request.app.all_routes, request.url.path))
        return problem_response(status, _CODES.get(status, "http-error"), message, headers)

    async def invalid(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)  # noqa: S101 - it is registered for no other
        parts = [f"{'.'.join(str(part) for part in detail['loc'])}: {detail['msg']}" for detail in error.errors()]
        return problem_response(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid", "; ".join(parts)[:LONGEST_MESSAGE])

    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(RefusedError, refused)
    app.add_exception_handler(StoreError, elsewhere)
    app.add_exception_handler(DatabaseUnavailableError, elsewhere)
    app.add_exception_handler(HTTPException, framework)
