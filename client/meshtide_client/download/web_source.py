"""A `.tide` file on a web server, read with range requests or as one plain download.

The entity tag of the first answer goes along with every later request (If-Match), and tag and size of every answer are
held against it, so that bytes of two states of a file are never mixed. Compression by the server is declined: packets
are compressed. A proxy that compresses a whole download all the same is understood; with a range it is not known
whether the range was taken before or after, so that is refused.
"""

from __future__ import annotations

import re
from contextlib import asynccontextmanager, contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING

import httpx

from meshtide_client.connection.content_coding import ContentDecoder
from meshtide_client.connection.credentials import authorization
from meshtide_client.connection.problem import LARGEST_PROBLEM, read_problem
from meshtide_client.connection.secrecy import without_secrets
from meshtide_client.connection.tls import distrust, tls_context
from meshtide_client.download.byte_source import Reading
from meshtide_codec.errors import PeerError, ProtocolError, TransferError, TruncatedError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator

    from meshtide_client.connection.link import Link

_BUSY = frozenset({429, 500, 502, 503, 504})
_LONGEST_NUMBER = 18
_CONTENT_RANGE = re.compile(r"bytes ([0-9]{1,18})-([0-9]{1,18})/(?:([0-9]{1,18})|\*)", re.ASCII)


class WebSource:
    """A file on a web server.

    Args:
        url: of the file.
        shown: the same for messages.
        link: timeout, token, and who vouches for the server.
        ranges: whether ranges are asked for.
        local: whether the server is on this machine, so that no proxy stands between.
    """

    def __init__(self, url: str, shown: str, link: Link, *, ranges: bool, local: bool) -> None:
        self._secure = url.lower().startswith("https:")
        self.name = "http" if ranges else "download"
        self._url = url
        self._shown = shown
        self._link = link
        self._ranges = ranges
        self._tag: str | None = None
        self._size: int | None = None
        self._client = httpx.AsyncClient(
            timeout=link.timeout,
            trust_env=not local,
            verify=tls_context(link.ca_file, needed=self._secure),
            follow_redirects=True,
            headers={"Accept-Encoding": "identity", **authorization(link.token)},
        )

    @asynccontextmanager
    async def read(self, start: int, end: int | None) -> AsyncIterator[Reading]:
        """See ByteSource."""
        headers = {}
        if self._ranges:
            headers["Range"] = f"bytes={start}-{'' if end is None else end - 1}"
            if self._tag is not None:
                headers["If-Match"] = self._tag
        with self._explained():
            answer = await self._client.send(self._client.build_request("GET", self._url, headers=headers), stream=True)
        try:
            if self._secure and answer.url.scheme != "https":
                raise ProtocolError(f"{self._shown} is redirected to an address without TLS; that is not followed")
            yield await self._reading(answer, start, end)
        finally:
            await answer.aclose()

    async def close(self) -> None:
        """Close the connections."""
        await self._client.aclose()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """What goes wrong with a request or its answer, as errors of the tree."""
        try:
            yield
        except httpx.TimeoutException as error:
            raise TransferError(f"nothing came from {self._shown} for {self._link.timeout:g} seconds") from error
        except (httpx.RemoteProtocolError, httpx.DecodingError) as error:
            raise TransferError(f"the connection to {self._shown} was lost ({without_secrets(str(error))})") from error
        except httpx.TooManyRedirects as error:
            raise ProtocolError(f"{self._shown} is redirected without end; check the address") from error
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            reason = distrust(error) or without_secrets(str(error))
            raise TransferError(f"cannot read {self._shown}: {reason}") from error

    async def _pieces(self, answer: httpx.Response, decoder: ContentDecoder) -> AsyncIterator[bytes]:
        """The body of an answer, expanded."""
        with self._explained():
            async for data in answer.aiter_raw():
                for piece in decoder.feed(data):
                    yield piece
        decoder.end()

    async def _reading(self, answer: httpx.Response, start: int, end: int | None) -> Reading:
        status = answer.status_code
        if status not in {HTTPStatus.OK, HTTPStatus.PARTIAL_CONTENT}:
            raise await self._refusal(answer, start)
        decoder = ContentDecoder(answer.headers.get("Content-Encoding", ""), self._shown)
        pieces = self._pieces(answer, decoder)
        if status == HTTPStatus.OK:
            length = answer.headers.get("Content-Length", "") if decoder.plain else ""
            size = int(length) if length.isascii() and length.isdigit() and len(length) <= _LONGEST_NUMBER else None
            self.name = "download"  # what it is, whatever was asked for
            return Reading(0, ranged=False, pieces=pieces, size=size)
        if not decoder.plain:
            raise ProtocolError(f"a range of {self._shown} comes compressed on the way, though that was declined")
        size = self._size_of(answer.headers.get("Content-Range", ""), start, end)
        self._check_same(answer.headers.get("ETag", ""), size)
        return Reading(start, ranged=True, pieces=pieces, size=size)

    def _size_of(self, place: str, start: int, end: int | None) -> int | None:
        """The size of the whole file by a Content-Range, which has to be what was asked for."""
        found = _CONTENT_RANGE.fullmatch(place.strip())
        if self._ranges and found is not None and int(found[1]) == start:
            last, size = int(found[2]), None if found[3] is None else int(found[3])
            if start <= last and (end is None or last < end) and (size is None or last < size):
                return size
        raise ProtocolError(f"{self._shown} answers with another range than the one that was asked for")

    def _check_same(self, tag: str, size: int | None) -> None:
        """The file has to be the one that the first answer was of."""
        tagged = tag if tag.startswith('"') else None  # a strong one
        if (self._tag is not None and tagged != self._tag) or (None not in {size, self._size} and size != self._size):
            self._tag = self._size = None
            raise TransferError(f"{self._shown} has changed while it was read")
        self._tag = tagged
        self._size = self._size if size is None else size

    async def _refusal(self, answer: httpx.Response, start: int) -> Exception:
        """What an answer without the file means."""
        status = answer.status_code
        if status == HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return TruncatedError(f"{self._shown} ends before byte {start}")
        if status == HTTPStatus.PRECONDITION_FAILED and self._tag is not None:
            self._tag = self._size = None
            return TransferError(f"{self._shown} has changed while it was read")
        if (problem := read_problem(await self._body(answer))) is not None:
            return problem
        if status in _BUSY:
            return TransferError(f"{self._shown} is not available now (HTTP status {status})")
        if status in {HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN}:
            return PeerError("unauthorized", f"{self._shown} may not be read (HTTP status {status})")
        return ProtocolError(f"{self._shown} answered with HTTP status {status}; check the address")

    async def _body(self, answer: httpx.Response) -> bytes:
        """The body of a refusal, as far as it is worth reading."""
        body = bytearray()
        decoder = ContentDecoder(answer.headers.get("Content-Encoding", ""), self._shown)
        async for piece in self._pieces(answer, decoder):
            body += piece
            if len(body) > LARGEST_PROBLEM:
                break
        return bytes(body)
