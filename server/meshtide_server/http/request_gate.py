"""The gate before the HTTP protocol: heads of requests are handed on whole, and only those that keep to the limits.

A head that is too long is refused as soon as so many bytes of it have come (414, 431), whatever would still follow, and
one that is not whole in time ends its connection, for connections that say nothing cost descriptors. Requests that come
in one go are handed on one after the other, each when the one before has been answered.
"""

from __future__ import annotations

import asyncio
import json
import logging
from enum import Enum, auto
from typing import TYPE_CHECKING

from meshtide_server.http.gate import Gate
from meshtide_server.http.request_framing import (
    END,
    LONGEST_CHUNK_LINE,
    Body,
    HeadLimits,
    RequestError,
    body_of,
    check_host,
    chunk_size,
)
from meshtide_server.operations.logs import HEADER, accepted_id

if TYPE_CHECKING:
    from meshtide_server.http.connection import Connection

logger = logging.getLogger("meshtide.server")

_LINE_END = b"\r\n"


class _Part(Enum):
    """What of a request comes next."""

    HEAD = auto()
    BODY = auto()
    CHUNK_LINE = auto()
    CHUNK = auto()
    TRAILERS = auto()


class RequestGate(Gate):
    """Stands before an HTTP protocol.

    Args:
        inner: the protocol.
        connection: what the application knows of it, and whether an answer is being given.
        limits: of a request's head.
        hello_timeout: seconds until a head has to be whole.
    """

    def __init__(
        self, inner: asyncio.Protocol, connection: Connection, limits: HeadLimits, hello_timeout: float
    ) -> None:
        super().__init__(inner, connection)
        self._limits = limits
        self._hello_timeout = hello_timeout
        self._part = _Part.HEAD
        self._left = 0
        self._searched = 0
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by the event loop."""
        super().connection_made(transport)
        self._set_deadline()

    def work(self) -> None:
        """One turn."""
        super().work()
        if self._part is _Part.HEAD and self._waiting and self._deadline is None and not self.blocked():
            self._set_deadline()  # bytes one by one do not move it

    def blocked(self) -> bool:
        """Whether the next request has to wait for the answer to the one before."""
        return self._part is _Part.HEAD and self.connection.busy

    def replaced(self) -> bool:
        """Whether the connection is a websocket by now."""
        return self.transport.get_protocol() is not self

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by the event loop."""
        self._lift_deadline()
        super().connection_lost(exc)

    def cut(self, waiting: bytearray) -> int:
        """The next head, or what is there of a body."""
        try:
            return self._cut(waiting)
        except RequestError as error:
            self._refuse(error)
            return 0

    def _cut(self, waiting: bytearray) -> int:
        if self._part is _Part.HEAD:
            return self._head(waiting)
        if self._part is _Part.CHUNK_LINE:
            return self._chunk_line(waiting)
        if self._part is _Part.TRAILERS:
            return self._trailers(waiting)
        size = min(self._left, len(waiting))
        self._left -= size
        if not self._left:
            self._part = _Part.HEAD if self._part is _Part.BODY else _Part.CHUNK_LINE
        return size

    def _head(self, waiting: bytearray) -> int:
        if self.blocked():
            return 0
        if waiting.startswith(_LINE_END):  # empty lines before a request mean nothing
            del waiting[: len(waiting) - len(waiting.lstrip(_LINE_END))]
        end = self._end(waiting)
        self._limits.check_line(waiting)
        self._limits.check_size(len(waiting) if end < 0 else end)
        if end < 0:
            return 0
        head = bytes(waiting[:end])
        self._limits.check_count(head.count(_LINE_END) - 2)
        body = body_of(head)
        check_host(head)
        self._lift_deadline()
        self.connection.asked()
        if body is Body.CHUNKS:
            self._part = _Part.CHUNK_LINE
        elif body:
            self._part, self._left = _Part.BODY, body
        return end

    def _chunk_line(self, waiting: bytearray) -> int:
        end = waiting.find(_LINE_END, 0, LONGEST_CHUNK_LINE)
        if end < 0 and len(waiting) < LONGEST_CHUNK_LINE:
            return 0
        size = chunk_size(bytes(waiting[: max(end, 0)]))
        if size:
            self._part, self._left = _Part.CHUNK, size + len(_LINE_END)
        else:
            self._part = _Part.TRAILERS
        return end + len(_LINE_END)

    def _trailers(self, waiting: bytearray) -> int:
        """What may follow the last chunk: more headers."""
        end = len(_LINE_END) if waiting.startswith(_LINE_END) else self._end(waiting)
        self._limits.check_size(len(waiting) if end < 0 else end)
        if end < 0:
            return 0
        trailers = bytes(waiting[:end])
        self._limits.check_count(trailers.count(_LINE_END) - 1)
        body_of(_LINE_END + trailers)
        self._part = _Part.HEAD
        return end

    def _end(self, waiting: bytearray) -> int:
        """Where a head ends, or -1; what was searched before is not searched again."""
        found = waiting.find(END, self._searched)
        self._searched = max(len(waiting) - len(END) + 1, 0) if found < 0 else 0
        return found + len(END) if found >= 0 else -1

    def _refuse(self, error: RequestError) -> None:
        logger.info("refused a request with status %d: %s", error.status, error)
        self._lift_deadline()
        if self.connection.busy:
            self.transport.abort()  # whatever was written now would be taken for a part of that answer
            return
        body = json.dumps({"error": error.code, "message": str(error)}).encode()
        lines = (
            f"HTTP/1.1 {error.status.value} {error.status.phrase}",
            "content-type: application/json",
            f"content-length: {len(body)}",
            "connection: close",
            f"{HEADER.decode()}: {accepted_id(None)}",
        )
        self.give_up(said="\r\n".join(lines).encode() + END + body)

    def _set_deadline(self) -> None:
        self._deadline = asyncio.get_running_loop().call_later(self._hello_timeout, self._expire)

    def _lift_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _expire(self) -> None:
        self._deadline = None
        if self.transport.is_closing() or self.replaced():
            return
        if self.transport.is_reading():
            self.transport.abort()
        else:
            self._set_deadline()  # the rest may have come, and not been read yet
