"""A `.tide` file, or a part of it such as a packet, as an HTTP answer that is read as fast as it is taken.

The first piece is read before anything is answered, so that what cannot be read is a refusal rather than an answer
that is cut off.
"""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING

from fastapi.responses import Response, StreamingResponse

from meshtide_codec.errors import StreamError
from meshtide_server.http.problems import problem_response, unavailable
from meshtide_server.http.ranges import plan
from meshtide_server.refusals import RefusedError
from meshtide_server.store import StoreError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from meshtide_server.hosting.stream import HostedStream
    from meshtide_server.store.protocol import OpenRanges

MEDIA_TYPE = "application/x-tide"
CHUNK = 1 << 18
"""Bytes read at a time."""


@dataclass(frozen=True, slots=True)
class Extract:
    """A part of a file that has an address of its own.

    Args:
        etag: its strong entity tag.
        start: its first byte in the file.
        end: one past its last byte.
        caching: what caches may do with it.
    """

    etag: str
    start: int
    end: int
    caching: str


async def download(
    stream: HostedStream, method: str, headers: Mapping[str, str], extract: Extract | None = None
) -> Response:
    """The answer to a GET or HEAD request for the file of `stream`, or for a part of it.

    Args:
        stream: the file.
        method: GET or HEAD.
        headers: of the request, under lower-case names.
        extract: the part; the whole file when left out.

    Raises:
        RefusedError: the file is gone or has changed, or its store does not give it.
    """
    # A file may change, so it is asked for again each time; compressing it would break ranges.
    extract = extract or Extract(stream.etag, 0, stream.size, "no-cache, no-transform")
    size = extract.end - extract.start
    planned = plan(method, headers, extract.etag, size)
    common = {
        "ETag": extract.etag,
        "Accept-Ranges": "bytes",
        "Cache-Control": extract.caching,
    }
    if planned.status == HTTPStatus.NOT_MODIFIED:
        return Response(status_code=planned.status, headers=common)
    if planned.status == HTTPStatus.PRECONDITION_FAILED:
        return problem_response(planned.status, "changed", "the stream is not the one that If-Match names", common)
    if planned.status == HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
        common["Content-Range"] = f"bytes */{size}"
        message = f"the range lies outside of the {size} bytes"
        return problem_response(planned.status, "range-not-satisfiable", message, common)
    if planned.status == HTTPStatus.PARTIAL_CONTENT:
        common["Content-Range"] = f"bytes {planned.start}-{planned.end - 1}/{size}"
    common["Content-Length"] = str(planned.end - planned.start)
    if method == "HEAD":
        return Response(status_code=planned.status, headers=common, media_type=MEDIA_TYPE)
    start, end = extract.start + planned.start, extract.start + planned.end
    first_end = min(start + CHUNK, end)
    try:
        opened = stream.open()
        with ExitStack() as stack:
            stack.callback(opened.close)
            first = await opened.read(start, first_end)
            if first_end < end:
                stack.pop_all()
    except StreamError as error:
        raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, "not-ready", str(error), retry_after=1) from error
    except StoreError as error:
        raise unavailable(error) from error
    if first_end == end:
        return Response(first, planned.status, common, MEDIA_TYPE)
    return StreamingResponse(_body(opened, first, first_end, end), planned.status, common, MEDIA_TYPE)


async def _body(opened: OpenRanges, first: bytes, start: int, end: int) -> AsyncIterator[bytes]:
    with closing(opened):
        yield first
        for position in range(start, end, CHUNK):
            yield await opened.read(position, min(position + CHUNK, end))
