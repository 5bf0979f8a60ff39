"""A streaming server inside the test, which can be told to fail in every way that a network has."""

from __future__ import annotations

from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest
from websockets.asyncio.server import serve
from websockets.exceptions import ConnectionClosed

from meshtide_client.connection.address import MeshAddress
from meshtide_codec.stream.messages import PacketPart, decode_message
from meshtide_codec.stream.session import error_frame
from server_end import ServerEnd

if TYPE_CHECKING:
    import ssl
    from collections.abc import AsyncIterator, Callable

    from websockets.asyncio.server import ServerConnection

    from server_end import StreamSource

MESH = "vase"


@dataclass
class StreamServer:
    """Serves `source` to one connection after the other.

    `cuts` tells after how many frames each connection is closed, the first entry for the first; connections beyond
    them are served to the end. `refusals` are sent instead of a stream, one a connection, before anything else.
    """

    source: StreamSource
    cuts: list[int] = field(default_factory=list)
    refusals: list[tuple[str, str]] = field(default_factory=list)
    connections: int = 0
    closed: int = 0
    finished_packets: list[int] = field(default_factory=list)
    """Indices of the packets whose last part was sent, in order, over all connections."""
    paths: list[str] = field(default_factory=list)
    address: MeshAddress = field(default_factory=lambda: MeshAddress.parse(f"http://unbound/meshes/{MESH}"))

    @property
    def url(self) -> str:
        return str(self.address)

    async def handle(self, socket: ServerConnection) -> None:
        assert socket.request is not None
        self.paths.append(socket.request.path)
        self.connections += 1
        try:
            await self._serve(socket)
        except ConnectionClosed:
            pass
        finally:
            self.closed += 1

    async def _serve(self, socket: ServerConnection) -> None:
        session = ServerEnd(MESH, self.source)
        session.receive(await socket.recv())
        if self.refusals:
            await socket.send(error_frame(*self.refusals.pop(0)))
            return
        left = self.cuts.pop(0) if self.cuts else None
        while not session.finished:
            frame = session.next_frame()
            if left == 0:
                return
            if frame is None:
                session.receive(await socket.recv())
                continue
            await socket.send(frame)
            left = None if left is None else left - 1
            self._note(frame)

    def _note(self, frame: bytes) -> None:
        message = decode_message(frame)
        if isinstance(message, PacketPart):
            length = self.source.header.packets[message.index].length
            if message.offset + len(message.data) == length:
                self.finished_packets.append(message.index)


@asynccontextmanager
async def listening(
    handle: Callable[[ServerConnection], object], tls: ssl.SSLContext | None = None
) -> AsyncIterator[MeshAddress]:
    """A websocket server on a free port, behind TLS if there is a certificate; yields the address of its mesh."""
    async with serve(handle, "127.0.0.1", 0, compression=None, ssl=tls) as server:  # type: ignore[arg-type]
        port = next(iter(server.sockets)).getsockname()[1]
        yield MeshAddress.parse(f"http{'' if tls is None else 's'}://127.0.0.1:{port}/meshes/{MESH}")


@asynccontextmanager
async def serving(
    source: StreamSource, tls: ssl.SSLContext | None = None, **settings: object
) -> AsyncIterator[StreamServer]:
    """A server of `source`."""
    server = StreamServer(source, **settings)  # type: ignore[arg-type]
    async with listening(server.handle, tls) as server.address:
        yield server


@pytest.fixture(name="serving")
def serving_fixture() -> Callable[..., object]:
    """The function `serving`."""
    return serving


@pytest.fixture(name="listening")
def listening_fixture() -> Callable[..., object]:
    """The function `listening`."""
    return listening
