"""The application's own state: what a running server is made of, and how a route comes by it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from fastapi import Depends, FastAPI
from starlette.requests import HTTPConnection  # noqa: TC002 - fastapi reads the annotations

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Sequence

    from starlette.routing import BaseRoute

    from meshtide_server.encoding.runner import JobRunner
    from meshtide_server.hosting.library import Library
    from meshtide_server.http.websocket import RunningStreams
    from meshtide_server.operations.readiness import Readiness
    from meshtide_server.security.access import Access
    from meshtide_server.settings import Settings


@dataclass(frozen=True, slots=True)
class ServerParts:
    """What a running server is made of.

    Args:
        settings: of the server.
        access: who may read and write.
        library: the hosted meshes.
        streams: the running streams.
        jobs: works on uploads; None where nothing can be published.
        readiness: whether it can do its work.
        draining: is set when it takes no new work any more.
    """

    settings: Settings
    access: Access
    library: Library
    streams: RunningStreams
    jobs: JobRunner | None
    readiness: Readiness
    draining: asyncio.Event


class Application(FastAPI):
    """The ASGI application."""

    parts: ServerParts
    """There while it runs, which its lifespan sees to."""
    all_routes: Sequence[BaseRoute] = ()
    """Its routes, and those of its routers."""


async def parts_of(connection: HTTPConnection) -> ServerParts:
    """A dependency: the parts of the server that answers."""
    application: Application = connection.app
    return application.parts


Running = Annotated[ServerParts, Depends(parts_of)]
"""What a route that takes `server: Running` is given."""
