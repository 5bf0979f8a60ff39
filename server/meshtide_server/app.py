"""The application: routes, library and streams put together."""

from __future__ import annotations

from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from fastapi import FastAPI
from fastapi.middleware.cors import CORSMiddleware

from meshtide_server.access import Access
from meshtide_server.library import Library
from meshtide_server.problems import handle_problems
from meshtide_server.routes import program_version, router
from meshtide_server.routes_tickets import router as tickets_router
from meshtide_server.streaming import Streams

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from meshtide_server.settings import Settings

DESCRIPTION = """
Hosts triangle meshes as progressive streams: whole `.tide` files with ranges, and, at
`/meshes/{id}/stream`, a websocket that sends a mesh level by level, only as fast as the client grants,
and only what the client does not hold yet.
"""


def create_app(settings: Settings) -> FastAPI:
    """The ASGI application of a server.

    Its lifespan finds the meshes and ends all work; `app.state.library` and `app.state.streams` are the hosted
    meshes and the running streams. Run it with `serving.run`, which also ends running streams politely, or with
    any ASGI server.

    Args:
        settings: what to host and how.

    Raises:
        OptionError: tokens that cannot be used.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        library = Library(settings)
        app.state.library = library
        app.state.streams = Streams(library, settings, app.state.access)
        await library.start()
        try:
            yield
        finally:
            await app.state.streams.close()
            await library.stop()

    app = FastAPI(title="meshtide", version=program_version(), description=DESCRIPTION, lifespan=lifespan)
    app.state.settings = settings
    app.state.access = Access(settings)
    handle_problems(app)
    app.include_router(router)
    app.include_router(tickets_router)
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.allowed_origins),
            allow_methods=["GET", "HEAD"],
            allow_headers=["Range", "If-Range", "If-Match", "If-None-Match"],
            expose_headers=["Accept-Ranges", "Content-Length", "Content-Range", "ETag"],
        )
    return app
