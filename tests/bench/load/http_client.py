"""An HTTP client that costs little: keeps connections open, asks for paths in turn, counts bytes."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class Throughput:
    """What a load came to."""

    requests: int
    size: int
    seconds: float

    @property
    def rate(self) -> float:
        """Bytes of bodies a second."""
        return self.size / self.seconds


class _Connection(asyncio.Protocol):
    """One connection that always has one request under way."""

    def __init__(self, requests: Sequence[tuple[bytes, int]], offset: int, until: float) -> None:
        self._requests = requests
        self._next = offset
        self._until = until
        self._left = -1
        self._head = bytearray()
        self._transport: asyncio.Transport | None = None
        self.ended: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.count = 0
        self.size = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)  # uvloop's is none of asyncio's
        self._ask()

    def _ask(self) -> None:
        assert self._transport is not None
        request, self._expected = self._requests[self._next % len(self._requests)]
        self._next += 1
        self._transport.write(request)

    def data_received(self, data: bytes) -> None:
        if self._left < 0:
            self._head += data
            end = self._head.find(b"\r\n\r\n")
            if end < 0:
                return
            if self._head[9:12] != b"200":
                self._fail(f"an answer that is not 200: {bytes(self._head[:200])!r}")
                return
            self._left = self._expected - (len(self._head) - end - 4)
            self._head.clear()
        else:
            self._left -= len(data)
        if self._left < 0:
            self._fail("a body that is longer than the packet")
        elif self._left == 0:
            self._left = -1
            self.count += 1
            self.size += self._expected
            if time.perf_counter() < self._until:
                self._ask()
            else:
                self._end()

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.ended.done():
            self.ended.set_exception(ConnectionError(f"the server hung up: {exc}"))

    def _fail(self, reason: str) -> None:
        if not self.ended.done():
            self.ended.set_exception(ConnectionError(reason))
        self._end()

    def _end(self) -> None:
        assert self._transport is not None
        if not self.ended.done():
            self.ended.set_result(None)
        self._transport.close()


async def load(host: str, port: int, paths: dict[str, int], connections: int, seconds: float) -> Throughput:
    """Ask for `paths` over and over.

    Args:
        host: of the server.
        port: of the server.
        paths: and the length of what each one answers with.
        connections: how many are open; each has one request under way.
        seconds: that this lasts.

    Raises:
        ConnectionError: an answer is not what it should be.
    """
    loop = asyncio.get_running_loop()
    requests = [(f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode(), size) for path, size in paths.items()]
    started = time.perf_counter()
    made = await asyncio.gather(
        *(
            loop.create_connection(partial(_Connection, requests, turn, started + seconds), host, port)
            for turn in range(connections)
        )
    )
    await asyncio.gather(*(connection.ended for _, connection in made))
    elapsed = time.perf_counter() - started
    return Throughput(sum(each.count for _, each in made), sum(each.size for _, each in made), elapsed)
