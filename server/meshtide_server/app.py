"""The application: routes, library and streams put together."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from fastapi import FastAPI
from fastapi.middleware.cors import CORSMiddleware

from meshtide_server.access import Access
from meshtide_server.job_runner import JobRunner
from meshtide_server.library import Library
from meshtide_server.limiting import Limiting
from meshtide_server.methods import Methods, add_heads
from meshtide_server.observation import Observation
from meshtide_server.prepared_answers import prepared_answers
from meshtide_server.problems import EVERYWHERE, handle_problems
from meshtide_server.readiness import Readiness, StoreCheck
from meshtide_server.routes import STREAM_ROUTE, program_version, router
from meshtide_server.routes_catalogue import router as catalogue_router
from meshtide_server.routes_ingest import router as ingest_router
from meshtide_server.routes_operations import router as operations_router
from meshtide_server.routes_packets import router as packets_router
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
ROUTERS = tuple(
    add_heads(each)
    for each in (packets_router, router, tickets_router, ingest_router, catalogue_router, operations_router)
)
"""The longer addresses come first: an id may hold slashes."""
EXPOSED_HEADERS = (
    "Accept-Ranges",
    "Content-Length",
    "Content-Range",
    "ETag",
    "Link",
    "Location",
    "Retry-After",
    "WWW-Authenticate",
    "X-Request-ID",
)
"""What pages of other origins may see of an answer, besides the headers that they always may."""


def create_app(settings: Settings) -> FastAPI:
    """The ASGI application of a server.

    Its lifespan finds the meshes and ends all work; `app.state.library` and `app.state.streams` are the hosted
    meshes and the running streams, `app.state.draining` is an event that is set when the server takes no new work any
    more, and `app.state.readiness` says whether it can do any. Run it with `serving.run`, which also ends running
    streams politely, or with any ASGI server.

    Args:
        settings: what to host and how.

    Raises:
        OptionError: tokens that cannot be used.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        library = Library(settings)
        app.state.library = library
        draining = asyncio.Event()
        app.state.draining = draining
        app.state.readiness = Readiness(draining)
        app.state.readiness.add("library", library.reason_to_wait)
        app.state.streams = Streams(library, settings, app.state.access, draining)
        await library.start()
        if library.kept is not None:
            app.state.readiness.add("catalogue", library.kept.reason_to_wait)
            app.state.readiness.add("store", StoreCheck(library.kept.store))
        runner = JobRunner(library.kept, settings, draining) if library.kept is not None else None
        app.state.jobs = runner
        if runner is not None:
            runner.start()
        try:
            yield
        finally:
            await app.state.streams.close()
            if runner is not None:
                await runner.stop()
            await library.stop()

    app = FastAPI(
        title="meshtide",
        version=program_version(),
        description=DESCRIPTION,
        lifespan=lifespan,
        responses=EVERYWHERE,
    )
    app.state.settings = settings
    app.state.access = Access(settings)
    app.state.prepared = prepared_answers(settings)
    handle_problems(app)
    app.router.routes.insert(0, STREAM_ROUTE)
    for included in ROUTERS:
        app.include_router(included)
    app.state.routes = [*app.routes, *(route for included in ROUTERS for route in included.routes)]
    app.add_middleware(Methods, routes=app.state.routes)
    app.add_middleware(Limiting, settings=settings)
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.allowed_origins),
            allow_methods=list(settings.allowed_methods),
            allow_headers=list(settings.allowed_headers),
            expose_headers=list(EXPOSED_HEADERS),
        )
    app.add_middleware(
        Observation, prepared=app.state.prepared, access_log=settings.access_log
    )  # the last one added is the outermost
    return app
