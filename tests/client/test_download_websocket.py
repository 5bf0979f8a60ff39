from __future__ import annotations

import asyncio
import ssl
from contextlib import aclosing, suppress
from typing import TYPE_CHECKING, Any

import pytest

from arriving import events_of
from meshtide_client.connection.address import MeshAddress
from meshtide_client.connection.link import Link
from meshtide_client.download.websocket import WebsocketTransport, open_connection
from meshtide_codec.errors import PacketError, ProtocolError, TransferError
from meshtide_codec.stream.container import fingerprint
from meshtide_codec.stream.messages import Error, HeaderPart, PacketPart, decode_message, encode_message
from meshtide_codec.stream.session import ClientSession, DoneEvent, PacketEvent
from streams import MadeUpStream

if TYPE_CHECKING:
    from collections.abc import Callable

    from websockets.asyncio.server import ServerConnection

STREAM = MadeUpStream()


def ignore(_: object) -> None:
    """Events are looked at where they come out."""


async def receive(address: MeshAddress, link: Link | None = None) -> list[Any]:
    link = link or Link()
    session = ClientSession(address.mesh, window=link.window)
    async with aclosing(events_of(WebsocketTransport(address, session, ignore, link))) as events:
        return [event async for event in events]


async def test_events_come_in_order(serving: Callable[..., Any]) -> None:
    async with serving(STREAM) as server:
        events = await receive(server.address)
    assert [event.index for event in events if isinstance(event, PacketEvent)] == list(range(len(STREAM.packets)))
    assert isinstance(events[-1], DoneEvent)


async def test_closing_early_closes_the_connection(serving: Callable[..., Any]) -> None:
    async with serving(STREAM) as server:
        session = ClientSession(server.address.mesh)
        async with aclosing(events_of(WebsocketTransport(server.address, session, ignore, Link()))) as events:
            async for _ in events:
                break
        await asyncio.sleep(0.05)
        assert server.closed == 1


async def test_a_rate_slows_the_link(serving: Callable[..., Any]) -> None:
    async with serving(STREAM) as server:
        loop = asyncio.get_running_loop()
        started = loop.time()
        await receive(server.address, Link(rate=30_000.0))
        size = len(STREAM.header_bytes) + sum(len(data) for data in STREAM.packet_bytes)
        assert loop.time() - started >= size / 30_000.0


async def test_a_closed_port_is_told() -> None:
    with pytest.raises(TransferError, match=r"cannot connect to http://127\.0\.0\.1:9: Connection refused"):
        await open_connection(MeshAddress.parse("http://127.0.0.1:9/meshes/a"), Link())


async def test_an_unknown_host_is_told() -> None:
    with pytest.raises(TransferError, match="cannot connect to http://no-such-host.invalid"):
        await open_connection(MeshAddress.parse("http://no-such-host.invalid/meshes/a"), Link(timeout=5.0))


async def answering(data: bytes, *, scheme: str = "http") -> Any:
    """Open a connection to something that answers with `data` and closes."""

    left = asyncio.Event()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(100)
        writer.write(data)
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()
        left.set()

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        try:
            return await open_connection(MeshAddress.parse(f"{scheme}://127.0.0.1:{port}/meshes/a"), Link(timeout=3.0))
        finally:
            await left.wait()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", "HTTP status 404 instead of a stream"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi", "HTTP status 200 instead of a stream"),
        (b"SSH-2.0-OpenSSH_9.6\r\n\r\n", "is not a web server"),
        (b"HTTP/1.1 101 Switching Protocols\r\n\r\n", "does not answer as a websocket"),
    ],
)
async def test_what_is_no_stream_is_told(answer: bytes, message: str) -> None:
    with pytest.raises(ProtocolError, match=message):
        await answering(answer)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n", "not available now .HTTP status 503"),
        (b"", "closed the connection before it was open"),
    ],
)
async def test_what_may_pass_is_a_transfer_error(answer: bytes, message: str) -> None:
    with pytest.raises(TransferError, match=message):
        await answering(answer)


async def test_plain_text_where_tls_is_expected_is_told() -> None:
    with pytest.raises(TransferError, match="cannot connect to https") as caught:
        await answering(b"HTTP/1.1 400 Bad Request\r\n\r\n", scheme="https")
    assert isinstance(caught.value.__cause__, ssl.SSLError | OSError)


async def test_a_server_that_does_not_answer_is_given_up() -> None:
    left = asyncio.Event()

    async def wait(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read()
        writer.close()
        await writer.wait_closed()
        left.set()

    server = await asyncio.start_server(wait, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        with pytest.raises(TransferError, match=r"did not answer within 0\.2 seconds"):
            await open_connection(MeshAddress.parse(f"http://127.0.0.1:{port}/meshes/a"), Link(timeout=0.2))
        await left.wait()


async def test_a_server_that_says_nothing_is_given_up(listening: Callable[..., Any]) -> None:
    async def handle(socket: ServerConnection) -> None:
        await socket.wait_closed()

    async with listening(handle) as address:
        with pytest.raises(TransferError, match=r"nothing came from .* for 0\.2 seconds"):
            await receive(address, Link(timeout=0.2))


async def test_a_frame_that_comes_slowly_is_waited_for(listening: Callable[..., Any]) -> None:
    """One frame takes longer than the timeout, but its bytes keep coming."""
    mark = fingerprint(STREAM.header_bytes)
    first = encode_message(HeaderPart(mark, len(STREAM.header_bytes), 0, STREAM.header_bytes))
    part = encode_message(PacketPart(1, 0, STREAM.packet_bytes[1]))

    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.send(first)
        frame = b"\x82\x7e" + len(part).to_bytes(2) + part
        for start in range(0, len(frame), 700):
            socket.transport.write(frame[start : start + 700])
            await asyncio.sleep(0.1)

    assert 126 <= len(part) < 1 << 16  # a frame of two length bytes
    async with listening(handle) as address:
        session = ClientSession(address.mesh)
        link = Link(timeout=0.25)
        indices = []
        async with aclosing(events_of(WebsocketTransport(address, session, ignore, link))) as events:
            async for event in events:
                if isinstance(event, PacketEvent):
                    indices.append(event.index)
                    break
        assert indices == [1]


async def test_a_text_frame_is_refused_and_the_server_is_told(listening: Callable[..., Any]) -> None:
    said: list[Any] = []

    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.send("welcome to the chat")
        said.append(decode_message(await socket.recv()))

    async with listening(handle) as address:
        with pytest.raises(ProtocolError, match="a text frame arrived"):
            await receive(address)
    assert isinstance(said[0], Error)
    assert said[0].code == "protocol"


async def test_an_oversized_frame_is_refused(listening: Callable[..., Any]) -> None:
    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.send(bytes(300_000))
        await socket.wait_closed()

    async with listening(handle) as address:
        with pytest.raises(ProtocolError, match="does not keep to the protocol"):
            await receive(address)


async def test_a_server_that_ignores_the_credit_is_stopped(listening: Callable[..., Any]) -> None:
    stream = MadeUpStream((2000,) * 27)

    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        mark = fingerprint(stream.header_bytes)
        await socket.send(encode_message(HeaderPart(mark, len(stream.header_bytes), 0, stream.header_bytes)))
        for index, data in enumerate(stream.packet_bytes):
            await socket.send(encode_message(PacketPart(index, 0, data)))
        await socket.wait_closed()

    async with listening(handle) as address:
        link = Link(window=1000)
        session = ClientSession(address.mesh, window=link.window)
        taken: list[Any] = []
        with pytest.raises(ProtocolError, match="sends more than it was allowed"):
            async with aclosing(events_of(WebsocketTransport(address, session, taken.append, link))) as events:
                async for _ in events:
                    await asyncio.sleep(0.02)  # as slow as a decoder
    assert len(taken) < 20


async def test_what_arrives_is_taken_while_the_caller_is_busy(serving: Callable[..., Any]) -> None:
    async with serving(STREAM) as server:
        session = ClientSession(server.address.mesh)
        taken: list[Any] = []
        async with aclosing(events_of(WebsocketTransport(server.address, session, taken.append, Link()))) as events:
            await anext(events)
            await asyncio.sleep(0.1)
            assert isinstance(taken[-1], DoneEvent)
            assert [event async for event in events] == taken[1:]


async def test_what_cannot_be_stored_is_raised_after_what_was(serving: Callable[..., Any]) -> None:
    def take(event: object) -> None:
        if isinstance(event, PacketEvent) and event.index == 2:
            raise OSError(28, "No space left on device")

    async with serving(STREAM) as server:
        session = ClientSession(server.address.mesh)
        indices: list[int] = []
        with pytest.raises(OSError, match="No space left"):
            async with aclosing(events_of(WebsocketTransport(server.address, session, take, Link()))) as events:
                async for event in events:
                    if isinstance(event, PacketEvent):
                        indices.append(event.index)  # noqa: PERF401 - what came before the error counts
    assert indices == [0, 1]


async def test_a_busy_caller_holds_the_server_back(serving: Callable[..., Any]) -> None:
    stream = MadeUpStream((2000,) * 27)
    async with serving(stream) as server:
        link = Link(window=2000)
        session = ClientSession(server.address.mesh, window=link.window)
        async with aclosing(events_of(WebsocketTransport(server.address, session, ignore, link))) as events:
            async for event in events:
                if isinstance(event, PacketEvent):
                    break
            await asyncio.sleep(0.1)
            assert len(server.finished_packets) * 2000 <= 2 * link.window
        await asyncio.sleep(0.05)


async def test_a_damaged_packet_is_refused(listening: Callable[..., Any]) -> None:
    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        mark = fingerprint(STREAM.header_bytes)
        await socket.send(encode_message(HeaderPart(mark, len(STREAM.header_bytes), 0, STREAM.header_bytes)))
        await socket.send(encode_message(PacketPart(0, 0, bytes(len(STREAM.packet_bytes[0])))))
        await socket.wait_closed()

    async with listening(handle) as address:
        with pytest.raises(PacketError, match="is damaged"):
            await receive(address)


async def test_the_close_reason_is_told(listening: Callable[..., Any]) -> None:
    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.close(1001, "maintenance")

    async with listening(handle) as address:
        with pytest.raises(TransferError, match=r"closed with code 1001: maintenance"):
            await receive(address)


async def test_a_connection_that_breaks_is_told(listening: Callable[..., Any]) -> None:
    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        socket.transport.abort()

    async with listening(handle) as address:
        with pytest.raises(TransferError, match="it closed without a word"):
            await receive(address)


@pytest.mark.parametrize(
    "frame",
    [b"\x89\x7d" + bytes(125), b"\x8a\x7d" + bytes(125), b"\x89\x00", b"\x00\x00"],
    ids=["pings", "pongs", "empty pings", "empty fragments"],
)
@pytest.mark.parametrize("count", [1, 16_000], ids=["now and then", "without end"])
async def test_bytes_that_are_no_message_are_no_news(frame: bytes, count: int, listening: Callable[..., Any]) -> None:
    """Control frames and fragments without content keep a connection busy; they do not keep a client waiting."""
    sent = 0

    async def handle(socket: ServerConnection) -> None:
        nonlocal sent
        await socket.recv()
        if frame[0] == 0:
            socket.transport.write(b"\x02\x01x")  # the first fragment of a message
        with suppress(RuntimeError):  # the client has left
            while not socket.transport.is_closing():
                socket.transport.write(frame * (1 + count // len(frame)))
                sent += 1
                await asyncio.sleep(0.02)

    async with listening(handle) as address:
        with pytest.raises(TransferError, match="nothing came from"):
            await receive(address, Link(timeout=0.2))
    assert sent < 100


async def test_a_message_that_trickles_is_no_news(listening: Callable[..., Any]) -> None:
    sent = 0

    async def handle(socket: ServerConnection) -> None:
        nonlocal sent
        await socket.recv()
        socket.transport.write(b"\x82\x7e\xff\xff")
        with suppress(RuntimeError):
            while not socket.transport.is_closing():
                socket.transport.write(b"x")
                sent += 1
                await asyncio.sleep(0.02)

    async with listening(handle) as address:
        with pytest.raises(TransferError, match="nothing came from"):
            await receive(address, Link(timeout=0.1))
    assert sent < 100


async def test_a_slow_message_among_pings_is_waited_for(listening: Callable[..., Any]) -> None:
    """It takes many time limits; what comes in each of them is enough."""
    mark = fingerprint(STREAM.header_bytes)
    message = encode_message(HeaderPart(mark, len(STREAM.header_bytes) + 8000, 0, STREAM.header_bytes + bytes(8000)))
    head = b"\x02\x7e" + (len(message) - 1).to_bytes(2, "big")

    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        data = head + message[:-1]
        for place in range(0, len(data), 300):
            socket.transport.write(data[place : place + 300])
            await asyncio.sleep(0.02)
        socket.transport.write(b"\x89\x01p" * 10 + b"\x80\x01" + message[-1:])
        await socket.wait_closed()

    async with listening(handle) as address:
        with pytest.raises(ProtocolError, match="does not match its fingerprint"):
            await receive(address, Link(timeout=0.25))


async def test_why_a_server_closes_is_told_escaped(listening: Callable[..., Any]) -> None:
    async def handle(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.close(1011, "\x1b[2J\u202ebye\n")

    async with listening(handle) as address:
        with pytest.raises(TransferError, match="closed with code 1011") as caught:
            await receive(address)
    assert str(caught.value).isprintable()
    assert "bye" in str(caught.value)


async def test_headers_of_what_is_no_websocket_are_told_escaped() -> None:
    with pytest.raises(ProtocolError) as caught:
        await answering(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: \x1b[2J\r\nConnection: upgrade\r\n\r\n")
    assert str(caught.value).isprintable()
