"""The routes of a stream's parts: its header, and its packets by their digests, for caches and plain clients."""

from __future__ import annotations

import re
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Path, Request, Response

from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_server.http.application import Running  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.dependencies import READERS
from meshtide_server.http.download import Extract, download
from meshtide_server.http.lookup import find_stream
from meshtide_server.http.routes.meshes import FILE_RESPONSES, MeshId
from meshtide_server.refusals import RefusedError

router = APIRouter(tags=["meshes"], dependencies=READERS)

_DIGEST = re.compile(r"[0-9a-f]{64}", re.ASCII)
_FOR_EVER = "max-age=31536000, immutable, no-transform"
Digest = Annotated[
    str,
    Path(
        description="SHA-256 of the packet's bytes, in hexadecimal, as GET /meshes/{id} lists it.",
        examples=["9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"],
    ),
]


@router.api_route(
    "/meshes/{mesh_id:mesh}/header",
    methods=["GET"],
    response_class=Response,
    responses=FILE_RESPONSES,
    summary="The header of a stream",
)
@router.api_route("/meshes/{mesh_id:mesh}/header", methods=["HEAD"], response_class=Response, include_in_schema=False)
async def header(request: Request, server: Running, mesh_id: MeshId) -> Response:
    """The header of a mesh's stream as it is in the `.tide` file: levels, and the table of packets."""
    _, stream = await find_stream(server.library, mesh_id)
    extract = Extract(stream.etag, PREAMBLE_BYTES, stream.packet_offset(0), "no-cache, no-transform")
    return await download(stream, request.method, request.headers, extract)


@router.api_route(
    "/packets/{digest}",
    methods=["GET"],
    response_class=Response,
    responses={**FILE_RESPONSES, 404: {**FILE_RESPONSES[404], "description": "There is no such packet."}},
    summary="A packet by its digest",
)
@router.api_route("/packets/{digest}", methods=["HEAD"], response_class=Response, include_in_schema=False)
async def packet(request: Request, server: Running, digest: Digest) -> Response:
    """The bytes of one packet. They never change, so they may be kept for ever; never compressed on the way."""
    place = await server.library.find_packet(bytes.fromhex(digest)) if _DIGEST.fullmatch(digest) else None
    if place is None:
        message = f"there is no packet {digest[:100]!r}; GET /meshes/ID lists those of a mesh"
        raise RefusedError(HTTPStatus.NOT_FOUND, "unknown-packet", message)
    start = place.stream.packet_offset(place.position)
    end = place.stream.packet_offset(place.position + 1)
    visibility = "public" if server.access.readable_by_all else "private"
    request.state.holds = place.stream.reader.unchanged
    extract = Extract(f'"{digest}"', start, end, f"{visibility}, {_FOR_EVER}")
    return await download(place.stream, request.method, request.headers, extract)
