"""The HTTP and websocket routes."""

from __future__ import annotations

import asyncio
import hashlib
from http import HTTPStatus
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Path, Query, Request, Response, WebSocket
from pydantic import TypeAdapter
from starlette.convertors import Convertor, register_url_convertor
from starlette.routing import WebSocketRoute

from meshtide_server.access import require_read
from meshtide_server.catalogue import CatalogueError
from meshtide_server.download import MEDIA_TYPE, download
from meshtide_server.hosted_mesh import HostedMesh, Status
from meshtide_server.models import Index, MeshDetail, MeshQuestion, MeshSummary, Problem
from meshtide_server.problems import RefusedError, unavailable
from meshtide_server.ranges import plan
from meshtide_server.routes_tickets import UNAUTHORIZED
from meshtide_server.store import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from meshtide_server.hosted_stream import HostedStream
    from meshtide_server.library import Library
    from meshtide_server.streaming import Streams


class MeshIdConvertor(Convertor[str]):
    """An id in an address: of a mesh in a subfolder, it holds slashes."""

    regex = "[^/]+(?:/[^/]+)*"

    def convert(self, value: str) -> str:
        """The id."""
        return value

    def to_string(self, value: str) -> str:
        """How it stands in an address."""
        return value


register_url_convertor("mesh", MeshIdConvertor())
router = APIRouter()
READERS = [Depends(require_read)]

MeshId = Annotated[str, Path(description="Id of a mesh, as GET /meshes lists it.", examples=["stanford-bunny"])]
_Responses = dict[int | str, dict[str, Any]]
_REFUSALS: _Responses = {
    **UNAUTHORIZED,
    404: {"model": Problem, "description": "There is no such mesh."},
    409: {"model": Problem, "description": "Its file could not be made a stream; the message says why."},
    500: {"model": Problem, "description": "Its stream is damaged in the server's store."},
    503: {"model": Problem, "description": "The mesh is being encoded; the message says how far."},
}
_BINARY = {"content": {MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}}}}
_CONDITIONAL: _Responses = {304: {"description": "What the client holds (If-None-Match) is still the answer."}}
_LISTING = TypeAdapter(list[MeshSummary])
FILE_RESPONSES: _Responses = {
    200: {**_BINARY, "description": "The whole file."},
    206: {**_BINARY, "description": "The range asked for."},
    304: {"description": "The file that the client holds (If-None-Match) is still this one."},
    412: {"model": Problem, "description": "The file is not the one that If-Match names."},
    416: {"model": Problem, "description": "The range lies outside of the file."},
    **_REFUSALS,
}


@router.get("/", summary="Where everything is", tags=["server"])
async def index() -> Index:
    """Name and version of this server, and where its meshes and this documentation are."""
    return Index(version=program_version())


@router.get(
    "/meshes",
    summary="Find meshes",
    response_model=list[MeshSummary],
    tags=["meshes"],
    responses={**_CONDITIONAL, **UNAUTHORIZED, 503: _REFUSALS[503]},
    dependencies=READERS,
)
async def meshes(request: Request, asked: Annotated[MeshQuestion, Query()]) -> Response:
    """Hosted meshes in the order of their ids, also those that are not ready: all, or those that are asked for.

    They come page by page: the header Link names the next page, if there is one.
    """
    page, more = await _library(request).page(asked.search(), asked.limit)
    headers = {}
    if more:
        kept = [(name, value) for name, value in request.query_params.multi_items() if name != "after"]
        headers["Link"] = f'</meshes?{urlencode([*kept, ("after", page[-1].id)])}>; rel="next"'
    body = await asyncio.to_thread(lambda: _LISTING.dump_json([MeshSummary.of(mesh) for mesh in page]))
    return conditional_json(request, body, headers)


@router.api_route(
    "/meshes/{mesh_id:mesh}.tide",
    methods=["GET"],
    response_class=Response,
    responses=FILE_RESPONSES,
    summary="A mesh as a .tide file",
    tags=["meshes"],
    dependencies=READERS,
)
@router.api_route(
    "/meshes/{mesh_id:mesh}.tide",
    methods=["HEAD"],
    response_class=Response,
    include_in_schema=False,
    dependencies=READERS,
)
async def file(request: Request, mesh_id: MeshId) -> Response:
    """The stream of a mesh as a file. A cut-off file is a coarser mesh; a range can be asked for, and resumed."""
    library = _library(request)
    _, stream = await find_stream(library, mesh_id)

    def holds() -> bool:
        found = library.find(mesh_id)
        return found is not None and found.stream is stream and stream.storage.unchanged()

    request.state.holds = holds
    return await download(stream, request.method, request.headers)


@router.get(
    "/meshes/{mesh_id:mesh}",
    response_model=MeshDetail,
    responses={**_CONDITIONAL, **_REFUSALS},
    summary="All about one mesh",
    tags=["meshes"],
    dependencies=READERS,
)
async def mesh(request: Request, mesh_id: MeshId) -> Response:
    """What is known of a mesh, and its stream: quantization, levels and packets, with their places in the file."""
    found, stream = await find_stream(_library(request), mesh_id)
    body = await asyncio.to_thread(lambda: MeshDetail.of(found, stream).model_dump_json().encode())
    return conditional_json(request, body)


async def stream(websocket: WebSocket) -> None:
    """The stream of a mesh, level by level, over a websocket."""
    streams: Streams = websocket.app.state.streams
    await streams.serve(websocket, websocket.path_params["mesh_id"])


STREAM_ROUTE = WebSocketRoute("/meshes/{mesh_id:mesh}/stream", stream)
"""Starlette's plain route: FastAPI's, which has nothing to do for it, costs a tenth of a whole stream."""


async def find_stream(library: Library, mesh_id: str) -> tuple[HostedMesh, HostedStream]:
    """The mesh of that id and its stream.

    Raises:
        RefusedError: there is no such mesh, or it is not ready, or it has failed, or cannot be looked up now.
    """
    try:
        found = await library.look_up(mesh_id)
    except (StoreError, CatalogueError) as error:
        raise unavailable(error) from error
    except OSError as error:
        raise unavailable(StoreError(f"the stream of {mesh_id} cannot be opened: {error}")) from error
    if found is None:
        message = f"there is no mesh {mesh_id[:100]!r}; GET /meshes lists them all"
        raise RefusedError(HTTPStatus.NOT_FOUND, "unknown-mesh", message)
    if found.status == Status.FAILED:
        raise RefusedError(HTTPStatus.CONFLICT, "mesh-failed", found.failed_message)
    if found.stream is None:
        raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, "not-ready", found.not_ready_message, retry_after=1)
    return found, found.stream


def conditional_json(request: Request, body: bytes, headers: Mapping[str, str] | None = None) -> Response:
    """JSON with a strong entity tag, or 304 if that is what the client holds."""
    etag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    common = {"ETag": etag, "Cache-Control": "no-cache", **(headers or {})}
    held = {"if-none-match": request.headers["if-none-match"]} if "if-none-match" in request.headers else {}
    if plan("GET", held, etag, len(body)).status == HTTPStatus.NOT_MODIFIED:
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=common)
    return Response(body, headers=common, media_type="application/json")


def program_version() -> str:
    """Version of the installed distribution."""
    try:
        return version("meshtide")
    except PackageNotFoundError:
        return "0"


def _library(request: Request) -> Library:
    library: Library = request.app.state.library
    return library
