"""The route that gives out tickets for websockets."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from meshtide_server.http.application import Running  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.dependencies import READERS, UNAUTHORIZED

router = APIRouter()


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
    dependencies=READERS,
)
async def issue_ticket(server: Running, response: Response) -> Ticket:
    """A one-time ticket for pages in browsers, which cannot send a token with a websocket's handshake."""
    response.headers["Cache-Control"] = "no-store"
    return Ticket(ticket=server.access.issue_ticket(), seconds=server.settings.ticket_seconds)
