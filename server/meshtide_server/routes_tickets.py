"""The route that gives out tickets for websockets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from meshtide_server.access import access_of, require_read
from meshtide_server.models import Problem

if TYPE_CHECKING:
    from meshtide_server.settings import Settings

router = APIRouter()

UNAUTHORIZED: dict[int | str, dict[str, Any]] = {
    401: {"model": Problem, "description": "The server has read tokens, and none of them was sent."}
}


class Ticket(BaseModel):
    """What opens one stream."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"ticket": "AAABkxq1c2h0ZWVzIHRpY2tldC4uLg", "seconds": 30.0}]}
    )

    ticket: Annotated[str, Field(description="To be used as /meshes/{id}/stream?ticket=..., once.")]
    seconds: Annotated[float, Field(description="How long it is good.")]


@router.post(
    "/tickets",
    status_code=201,
    summary="A ticket for one stream",
    tags=["meshes"],
    responses=UNAUTHORIZED,
    dependencies=[Depends(require_read)],
)
async def issue_ticket(request: Request, response: Response) -> Ticket:
    """A one-time ticket for pages in browsers, which cannot send a token with a websocket's handshake."""
    settings: Settings = request.app.state.settings
    response.headers["Cache-Control"] = "no-store"
    return Ticket(ticket=access_of(request).issue_ticket(), seconds=settings.ticket_seconds)
