"""The HTTP and websocket routes."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request, Response, WebSocket
from pydantic import TypeAdapter
from starlette.convertors import Convertor, register_url_convertor
from starlette.routing import WebSocketRoute

from meshtide_server.http.application import Running, parts_of
from meshtide_server.http.conditional import conditional_json
from meshtide_server.http.dependencies import READERS, UNAUTHORIZED
from meshtide_server.http.download import MEDIA_TYPE, download
from meshtide_server.http.lookup import find_stream
from meshtide_server.http.mesh_question import MeshQuestion  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.models import Index, MeshDetail, MeshSummary, Problem
from meshtide_server.operations.version import program_version


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
async def meshes(request: Request, server: Running, asked: Annotated[MeshQuestion, Query()]) -> Response:
    """Hosted meshes in the order of their ids, also those that are not ready: all, or those that are asked for.

    They come page by page: the header Link names the next page, if there is one.
    """
    page, more = await server.library.page(asked.query(), asked.page_size)
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
async def file(request: Request, server: Running, mesh_id: MeshId) -> Response:
    """The stream of a mesh as a file. A cut-off file is a coarser mesh; a range can be asked for, and resumed."""
    _, stream = await find_stream(server.library, mesh_id)

    def holds() -> bool:
        found = server.library.known(mesh_id)
        return found is not None and found.stream is stream and stream.reader.unchanged()

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
async def mesh(request: Request, server: Running, mesh_id: MeshId) -> Response:
    """What is known of a mesh, and its stream: quantization, levels and packets, with their places in the file."""
    found, stream = await find_stream(server.library, mesh_id)
    body = await asyncio.to_thread(lambda: MeshDetail.of(found, stream).model_dump_json().encode())
    return conditional_json(request, body)


async def stream(websocket: WebSocket) -> None:
    """The stream of a mesh, level by level, over a websocket."""
    server = await parts_of(websocket)
    await server.streams.serve(websocket, websocket.path_params["mesh_id"])


STREAM_ROUTE = WebSocketRoute("/meshes/{mesh_id:mesh}/stream", stream)
"""Starlette's plain route: FastAPI's, which has nothing to do for it, costs a tenth of a whole stream."""
