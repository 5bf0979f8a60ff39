"""A connection without a socket, and a protocol that only notes what it is given: for tests of gates."""

from __future__ import annotations

import asyncio
from typing import Any


class FakeTransport:
    """Notes what is done to it; like uvloop's it raises when it is written to after its end.

    Args:
        protocol: that it belongs to.
    """

    def __init__(self) -> None:
        self.protocol: asyncio.BaseProtocol | None = None
        self.written = bytearray()
        self.reading = True
        self.ended = False
        self.closed = False
        self.aborted = False

    def write(self, data: bytes) -> None:
        if self.is_closing():
            raise RuntimeError("unable to perform operation on <TCPTransport closed=True>; the handler is closed")
        self.written += data

    def write_eof(self) -> None:
        if self.is_closing():
            raise RuntimeError("Cannot call write_eof() after close()")
        self.ended = True

    def pause_reading(self) -> None:
        self.reading = False

    def resume_reading(self) -> None:
        self.reading = True

    def is_reading(self) -> bool:
        return self.reading

    def is_closing(self) -> bool:
        return self.closed or self.aborted

    def close(self) -> None:
        self.closed = True

    def abort(self) -> None:
        self.aborted = True

    def get_extra_info(self, _name: str) -> None:
        return None

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        self.protocol = protocol

    def get_protocol(self) -> asyncio.BaseProtocol | None:
        return self.protocol


class Notes(asyncio.Protocol):
    """Notes what it is given."""

    def __init__(self) -> None:
        self.transport: Any = None
        self.pieces: list[bytes] = []
        self.lost = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.pieces.append(data)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        self.lost = True

    @property
    def heard(self) -> bytes:
        return b"".join(self.pieces)


def connected(gate: Any) -> FakeTransport:
    """The connection of a gate."""
    transport = FakeTransport()
    transport.set_protocol(gate)
    gate.connection_made(transport)
    return transport


async def turns(count: int) -> None:
    """Let the event loop go round."""
    for _ in range(count):
        await asyncio.sleep(0)
