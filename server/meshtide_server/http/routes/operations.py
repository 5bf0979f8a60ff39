"""The routes for those who run the server: is it alive, can it work, what does it count."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Response, Security
from fastapi.security import HTTPAuthorizationCredentials  # noqa: TC002 - fastapi reads the annotations

from meshtide_server.catalogue import Status
from meshtide_server.http.application import Running  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.dependencies import READ_SCHEME, UNAUTHORIZED
from meshtide_server.http.models import Health, Problem, ReadinessReport
from meshtide_server.operations import metrics
from meshtide_server.operations.readiness import OK
from meshtide_server.operations.version import program_version
from meshtide_server.refusals import RefusedError

router = APIRouter(tags=["server"])


@router.get("/healthz", summary="Whether the server answers")
async def health(server: Running) -> Health:
    """That the server answers, and how many of its meshes are in which state."""
    counts = server.library.counts
    return Health(version=program_version(), meshes={status.value: counts[status] for status in Status})


@router.get(
    "/readyz",
    summary="Whether the server can do its work",
    responses={503: {"model": ReadinessReport, "description": "A part is missing, or the server is about to stop."}},
)
async def ready(server: Running, response: Response) -> ReadinessReport:
    """Whether requests should be sent to this server, and what it waits for if not; 503 while it drains."""
    parts = await server.readiness.parts()
    is_ready = all(state == OK for state in parts.values())
    if not is_ready:
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
        response.headers["Retry-After"] = "1"
    response.headers["Cache-Control"] = "no-store"
    return ReadinessReport(ready=is_ready, parts=parts)


@router.get(
    "/metrics",
    summary="What the server counts",
    response_class=Response,
    responses={
        200: {"content": {"text/plain": {"schema": {"type": "string"}}}, "description": "In Prometheus's text format."},
        **UNAUTHORIZED,
        404: {"model": Problem, "description": "The setting `metrics` is off."},
    },
)
async def exposition(
    server: Running, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(READ_SCHEME)]
) -> Response:
    """Streams, bytes by kind of packet, time to the first packet, jobs, requests and faults, for Prometheus."""
    if server.settings.metrics == "off":
        raise RefusedError(HTTPStatus.NOT_FOUND, "not-found", "this server does not show its metrics")
    if server.settings.metrics == "read":
        server.access.check_read(credentials.credentials if credentials else None)
    body, media_type = await asyncio.to_thread(metrics.exposition)
    return Response(body, media_type=media_type, headers={"Cache-Control": "no-store"})
