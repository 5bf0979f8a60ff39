"""A websocket client that costs little: it counts and hashes what comes, for it shares the machine with the server.

It knows as much of the protocol as a well-behaved server's frames need: no fragments, no extensions, no masks from the
server; pings are answered.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import os
import time
from typing import TYPE_CHECKING, cast

from meshtide_codec.stream.messages import PROTOCOL_VERSION, Hello, encode_message

if TYPE_CHECKING:
    from collections.abc import Sequence

_CLOSE, _PING, _PONG, _BINARY = 0x8, 0x9, 0xA, 0x2
_PACKET_PART = 3
ALL = 1 << 30
"""Credit for a whole stream at once."""
OPENING_SECONDS = 120.0


def hello(mesh: str, credit: int = ALL) -> bytes:
    """The message that opens a stream."""
    return encode_message(Hello(PROTOCOL_VERSION, mesh, b"", (), None, None, None, credit))


class LightClient(asyncio.Protocol):
    """One connection: sends a hello, takes everything, closes.

    Args:
        host: of the server.
        path: of the stream.
        first: what to send when the connection is open; None sends nothing until `send` is called.
    """

    def __init__(self, host: str, path: str, first: bytes | None) -> None:
        self._host = host
        self._path = path
        self._first = first
        self._buffer = bytearray()
        self._upgraded = False
        self._transport: asyncio.Transport | None = None
        self._digest = hashlib.sha256()
        self.opened = asyncio.get_running_loop().create_future()
        self.ended: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        """The close code, or 1006."""
        self.size = 0
        self.frames = 0
        self.asked = 0.0
        self.first_packet = 0.0

    @property
    def digest(self) -> bytes:
        """SHA-256 of the payload of all frames."""
        return self._digest.digest()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin the handshake."""
        self._transport = cast("asyncio.Transport", transport)  # uvloop's is none of asyncio's
        key = base64.b64encode(os.urandom(16)).decode()
        self._transport.write(
            f"GET {self._path} HTTP/1.1\r\nHost: {self._host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )

    def send(self, message: bytes, opcode: int = _BINARY) -> None:
        """Send one frame, masked with zeros."""
        assert self._transport is not None
        size = len(message)
        head = (
            bytes([0x80 | opcode, 0x80 | size])
            if size < 126
            else bytes([0x80 | opcode, 0xFE]) + size.to_bytes(2, "big")
        )
        self._transport.write(head + bytes(4) + message)
        if opcode == _BINARY:
            self.asked = time.perf_counter()

    def abort(self) -> None:
        """Hang up."""
        if self._transport is not None:
            self._transport.abort()

    def data_received(self, data: bytes) -> None:
        """Take what came."""
        self._buffer += data
        if not self._upgraded:
            end = self._buffer.find(b"\r\n\r\n")
            if end < 0:
                return
            status = bytes(self._buffer[9:12])
            del self._buffer[: end + 4]
            if status != b"101":
                self._finish(int(status))
                self.abort()
                return
            self._upgraded = True
            if not self.opened.done():
                self.opened.set_result(None)
            if self._first is not None:
                self.send(self._first)
        self._take_frames()

    def _take_frames(self) -> None:
        buffer, position, available = self._buffer, 0, len(self._buffer)
        while available - position >= 2:
            size, start = buffer[position + 1], position + 2
            if size >= 126:
                start += 2 if size == 126 else 8
                size = int.from_bytes(buffer[position + 2 : start], "big")
            if start > available or start + size > available:
                break
            opcode = buffer[position] & 0xF
            payload = memoryview(buffer)[start : start + size]
            try:
                if opcode == _BINARY:
                    self.frames += 1
                    self.size += size
                    self._digest.update(payload)
                    if not self.first_packet and payload[1] == _PACKET_PART:
                        self.first_packet = time.perf_counter()
                elif opcode == _PING:
                    self.send(bytes(payload), _PONG)
                elif opcode == _CLOSE:
                    self.send(bytes(payload[:2]), _CLOSE)
                    self._finish(int.from_bytes(payload[:2], "big"))
            finally:
                payload.release()
            position = start + size
        del buffer[:position]

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """The connection is gone."""
        self._finish(1006)

    def _finish(self, code: int) -> None:
        if not self.opened.done():
            self.opened.set_exception(ConnectionError(f"no websocket: {code}"))
        if not self.ended.done():
            self.ended.set_result(code)


async def open_clients(
    host: str, port: int, path: str, count: int, first: bytes | None, *, at_once: int = 64
) -> Sequence[LightClient]:
    """Open `count` connections, `at_once` at a time; returns when all are through the handshake."""
    loop = asyncio.get_running_loop()
    turns = asyncio.Semaphore(at_once)

    async def open_one() -> LightClient:
        async with turns:
            _, client = await loop.create_connection(lambda: LightClient(host, path, first), host, port)
            await client.opened
            return client

    async with asyncio.timeout(OPENING_SECONDS):
        return await asyncio.gather(*(open_one() for _ in range(count)))
