"""The application: routes, library and streams put together."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack, asynccontextmanager
from typing import TYPE_CHECKING

from fastapi.middleware.cors import CORSMiddleware

from meshtide_server.encoding.folder_queue import FolderQueue
from meshtide_server.encoding.runner import JobRunner
from meshtide_server.hosting.library import Library
from meshtide_server.http.application import Application, ServerParts
from meshtide_server.http.limiting import Limiting
from meshtide_server.http.methods import Methods, add_heads
from meshtide_server.http.observation import Observation
from meshtide_server.http.problems import EVERYWHERE, handle_problems
from meshtide_server.http.ready_answers import ReadyAnswers
from meshtide_server.http.routes.catalogue import router as catalogue_router
from meshtide_server.http.routes.ingest import router as ingest_router
from meshtide_server.http.routes.meshes import STREAM_ROUTE, router
from meshtide_server.http.routes.operations import router as operations_router
from meshtide_server.http.routes.packets import router as packets_router
from meshtide_server.http.routes.tickets import router as tickets_router
from meshtide_server.http.websocket import RunningStreams
from meshtide_server.operations.readiness import Readiness, StoreCheck
from meshtide_server.operations.version import program_version
from meshtide_server.security.access import Access

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


def create_app(settings: Settings) -> Application:
    """The ASGI application of a server.

    Its lifespan finds the meshes and ends all work; while it runs, `parts` are what the server is made of. Run it with
    `serving.run`, which also ends running streams politely, or with any ASGI server.

    Args:
        settings: what to host and how.

    Raises:
        OptionError: tokens that cannot be used.
    """
    access = Access(settings)

    @asynccontextmanager
    async def lifespan(app: Application) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            app.parts = await _started(settings, access, stack)
            yield

    app = Application(
        title="meshtide",
        version=program_version(),
        description=DESCRIPTION,
        lifespan=lifespan,
        responses=EVERYWHERE,
    )
    handle_problems(app)
    app.router.routes.insert(0, STREAM_ROUTE)
    for included in ROUTERS:
        app.include_router(included)
    app.all_routes = [*app.routes, *(route for included in ROUTERS for route in included.routes)]
    app.add_middleware(Methods, routes=app.all_routes)
    if access.readable_by_all:
        app.add_middleware(ReadyAnswers)
    app.add_middleware(Limiting, settings=settings)
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.allowed_origins),
            allow_methods=list(settings.allowed_methods),
            allow_headers=list(settings.allowed_headers),
            expose_headers=list(EXPOSED_HEADERS),
        )
    # the last one added is the outermost
    app.add_middleware(Observation, access_log=settings.access_log)
    return app


async def _started(settings: Settings, access: Access, stack: AsyncExitStack) -> ServerParts:
    """Begin all work; `stack` ends it, streams first."""
    library = Library(settings)
    queue = FolderQueue(library.folder, settings.encoding)
    await library.start()
    stack.push_async_callback(library.stop)
    queue.start()
    stack.push_async_callback(queue.stop)
    draining = asyncio.Event()
    readiness = Readiness(draining)
    readiness.add("library", library.reason_to_wait)
    jobs: JobRunner | None = None
    if library.published is not None:
        readiness.add("catalogue", library.published.reason_to_wait)
        readiness.add("store", StoreCheck(library.published.store))
        jobs = JobRunner(library.published, settings, draining)
        jobs.start()
        stack.push_async_callback(jobs.stop)
    streams = RunningStreams(library, settings, access, draining)
    stack.push_async_callback(streams.close)
    return ServerParts(settings, access, library, streams, jobs, readiness, draining)
