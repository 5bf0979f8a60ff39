import asyncio
import json
import random
import socket
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import httptools
import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_server.http.connection import Connection
from meshtide_server.http.gate import Gate
from meshtide_server.http.request_framing import HeadLimits
from meshtide_server.http.request_gate import RequestGate
from meshtide_server.settings import Settings

from ..conftest import LiveServer
from ..connection_parts import FakeTransport, Notes, connected, turns
from ..made_streams import make_stream

LIMITS = HeadLimits(line=100, size=400, headers=10)
PLAIN = b"GET /a HTTP/1.1\r\nHost: h\r\n\r\n"
CHUNKS = b"PUT /a HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n"
CHUNKS += b"3;x=y\r\nabc\r\nA\r\n0123456789\r\n0\r\nAfter: 1\r\n\r\n"
LENGTH = b"PUT /a HTTP/1.1\r\nHost: h\r\nContent-Length: 30\r\n\r\n" + b"\r\n\r\nGET / HTTP/1.1\r\n" + bytes(10)


class AnsweredAtOnce(Connection):
    """Of a server that answers before anything else happens."""

    def asked(self) -> None:
        super().asked()
        self.busy = False


def made(
    *, connection: Connection | None = None, hello_timeout: float = 10.0
) -> tuple[RequestGate, Notes, FakeTransport]:
    inner = Notes()
    gate = RequestGate(inner, connection or AnsweredAtOnce(), LIMITS, hello_timeout)
    return gate, inner, connected(gate)


async def test_requests_are_handed_on_whole_however_they_come() -> None:
    gate, inner, transport = made()
    whole = PLAIN + LENGTH + CHUNKS + b"\r\n\r\n" + PLAIN
    for position in range(len(whole)):
        gate.data_received(whole[position : position + 1])
    assert inner.heard == PLAIN + LENGTH + CHUNKS + PLAIN
    heads = [piece for piece in inner.pieces if b"HTTP/1.1\r\n" in piece]
    assert len(heads) == 4
    assert all(piece.endswith(b"\r\n\r\n") for piece in heads)
    gate.data_received(whole)
    await turns(5)
    assert inner.heard == 2 * (PLAIN + LENGTH + CHUNKS + PLAIN)
    assert transport.reading
    gate.connection_lost(None)


@pytest.mark.parametrize(
    ("start", "repeated", "status"),
    [
        (b"GET /", b"a", 414),
        (b"GET /a HTTP/1.1\r\nX: ", b"b", 431),
        (b"GET /a HTTP/1.1\r\n", b"X: 1\r\n", 431),
        (b"GET /a HTTP/1.1\r\n", b"X", 431),
        (CHUNKS[: CHUNKS.find(b"After")], b"X: 1\r\n", 431),
        (CHUNKS[: CHUNKS.find(b"3;")], b"1", 400),
    ],
)
async def test_a_head_without_an_end_is_refused_after_so_many_bytes(start: bytes, repeated: bytes, status: int) -> None:
    gate, inner, transport = made()
    gate.data_received(start)
    received = len(start)
    while not gate.deaf:
        gate.data_received(repeated)
        received += len(repeated)
        assert received < 2 * LIMITS.size + 1024
        assert gate.waiting <= received
    answer, _, body = bytes(transport.written).partition(b"\r\n\r\n")
    assert answer.startswith(f"HTTP/1.1 {status} ".encode())
    assert b"connection: close" in answer
    assert f"content-length: {len(body)}".encode() in answer
    assert json.loads(body).keys() == {"error", "message"}
    gate.data_received(repeated * 10_000)
    assert gate.waiting == 0
    assert repeated * 50 not in inner.heard
    gate.connection_lost(None)


async def test_nothing_is_written_into_an_answer() -> None:
    gate, _, transport = made(connection=Connection())
    gate.data_received(b"PUT /a HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\nno length\r\n")
    assert transport.aborted
    assert not transport.written
    gate.connection_lost(None)


async def test_a_request_waits_for_the_answer_to_the_one_before() -> None:
    connection = Connection()
    gate, inner, transport = made(connection=connection, hello_timeout=0.05)
    gate.data_received(PLAIN + LENGTH + PLAIN[:-1])
    assert (inner.heard, transport.reading) == (PLAIN, False)
    await asyncio.sleep(0.1)  # as long as an answer takes, nobody has to say anything
    assert not transport.aborted
    connection.answered()
    await turns(2)
    assert (inner.heard, transport.reading) == (PLAIN + LENGTH, False)
    connection.answered()
    await turns(2)
    assert (inner.heard, transport.reading) == (PLAIN + LENGTH, True)
    gate.data_received(PLAIN[-1:])
    assert inner.heard == PLAIN + LENGTH + PLAIN
    connection.answered()
    gate.data_received(PLAIN[:-1])
    await asyncio.sleep(0.1)
    assert transport.aborted
    gate.connection_lost(None)


async def test_a_body_is_handed_on_while_it_is_answered() -> None:
    gate, inner, transport = made(connection=Connection())
    for position in range(len(CHUNKS)):
        gate.data_received(CHUNKS[position : position + 1])
        assert transport.reading
    assert inner.heard == CHUNKS
    gate.connection_lost(None)


async def test_a_head_has_a_deadline_that_bytes_do_not_move_unless_the_server_does_not_read() -> None:
    gate, inner, transport = made(hello_timeout=0.05)
    for _ in range(10):
        gate.data_received(b"G")
        await asyncio.sleep(0.01)
    assert transport.aborted
    gate, inner, transport = made(hello_timeout=0.05)
    gate.data_received(PLAIN)
    await asyncio.sleep(0.1)
    assert not transport.aborted
    gate.data_received(LENGTH[:-5])  # a body has its own deadline, which the application knows
    await asyncio.sleep(0.1)
    assert not transport.aborted
    gate.data_received(LENGTH[-5:])
    inner.transport.pause_reading()
    gate.data_received(PLAIN[:10])
    await asyncio.sleep(0.1)
    assert not transport.aborted
    inner.transport.resume_reading()
    await asyncio.sleep(0.1)
    assert transport.aborted
    gate.connection_lost(None)


async def test_what_comes_behind_the_request_for_a_websocket_reaches_it() -> None:
    class Upgrading(Notes):
        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            self.transport.set_protocol(successor)

    class Everything(Gate):
        def cut(self, waiting: bytearray) -> int:
            return len(waiting)

    websocket = Notes()
    connection = Connection()
    successor = Everything(websocket, connection)
    inner = Upgrading()
    gate = RequestGate(inner, connection, LIMITS, 0.05)
    transport = connected(gate)
    successor.connection_made(transport)  # type: ignore[arg-type] # it does what is needed
    gate.data_received(PLAIN + b"frames")
    assert (inner.heard, websocket.heard, transport.reading) == (PLAIN, b"frames", True)
    await asyncio.sleep(0.1)
    assert not transport.aborted


class Reader:
    """What a parser finds in what was handed on."""

    def __init__(self) -> None:
        self.parser = httptools.HttpRequestParser(self)
        self.in_head = False
        self.headers = 0

    def on_message_begin(self) -> None:
        self.in_head = True

    def on_header(self, name: bytes, value: bytes) -> None:
        self.headers += len(name) + len(value)

    def on_headers_complete(self) -> None:
        self.in_head = False

    def on_message_complete(self) -> None:
        self.headers = 0


@st.composite
def _damaged_requests(draw: st.DrawFn) -> bytes:
    data = bytearray(b"".join(draw(st.lists(st.sampled_from([PLAIN, CHUNKS, LENGTH]), min_size=1, max_size=4))))
    pieces = st.sampled_from([
        *(b"\r", b"\n", b"\r\n", b"\n\n", b"\r\n\r\n", b" ", b"\t", b"0", b":", b";", b"\x00", b"HTTP/1.0"),
        *(b"Content-Length: 99\r\n", b"Transfer-Encoding: chunked\r\n", b"Content-Length: 1\r\n 2\r\n"),
        *(b"CONNECT ", b"Upgrade: x\r\nConnection: upgrade\r\n", b"Connection: close\r\n"),
        *(b"X: " + b"y" * 300, b"GET / HTTP/1.1\r\nX: " + b"z" * 2000),
    ])  # fmt: skip
    for _ in range(draw(st.integers(0, 3))):
        place = draw(st.integers(0, len(data)))
        data[place : place + draw(st.integers(0, 3))] = draw(pieces)
    return bytes(data)


@given(_damaged_requests(), st.integers(40, 3000), st.randoms(use_true_random=False))
def test_who_reads_what_was_handed_on_never_waits_in_a_head(data: bytes, step: int, chance: random.Random) -> None:
    """The parser behind must see the same requests as the gate: only then do the gate's limits hold for it."""

    async def run() -> None:
        gate, inner, transport = made()
        position = 0
        while position < len(data) and not gate.deaf:
            end = position + chance.randrange(1, step + 1)
            gate.data_received(data[position:end])
            position = end
            await turns(3)
        gate.connection_lost(None)
        assert not transport.closed
        reader = Reader()
        for piece in inner.pieces:
            try:
                reader.parser.feed_data(piece)
            except httptools.HttpParserUpgrade:
                assert piece.endswith(b"\r\n\r\n") or not reader.in_head
            except httptools.HttpParserError:
                return  # the connection ends with that
            assert not reader.in_head
            assert reader.headers <= LIMITS.size

    asyncio.run(run())


def flood(live: LiveServer, start: bytes, block: bytes, size: int) -> bytes:
    """Send without end; returns what was answered."""
    host, port = live.url.removeprefix("http://").split(":")
    sent = 0
    with socket.create_connection((host, int(port)), timeout=5.0) as client:
        client.sendall(start)
        with suppress(OSError):
            while sent < size:
                client.sendall(block)
                sent += len(block)
        answer = b""
        with suppress(OSError):
            while data := client.recv(1 << 16):
                answer += data
    return answer


def test_one_connection_does_not_take_the_server_s_memory(
    folder: Path, serve: Callable[[Settings], LiveServer]
) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    httpx.get(f"{live.url}/meshes")
    tracemalloc.start()
    try:
        for start, status in ((b"GET / HTTP/1.1\r\nX: ", b" 431 "), (b"GET /", b" 414 ")):
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            answer = flood(live, start, b"x" * (1 << 16), 1 << 25)
            assert status in answer
            assert tracemalloc.get_traced_memory()[1] - before < 1 << 22
    finally:
        tracemalloc.stop()
    assert httpx.get(f"{live.url}/healthz").status_code == 200


def test_large_but_allowed_requests_are_answered(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    with httpx.Client() as client:
        headers = {f"x-{number}": "y" * 500 for number in range(80)}
        for _ in range(2):
            answer = client.get(f"{live.url}/meshes/small.tide", headers=headers)
            assert answer.content == make_stream()
        assert client.get(f"{live.url}/meshes?q={'a' * 60_000}").status_code == 422
        connection = HTTPConnection(live.url.removeprefix("http://"))
        connection.request("GET", f"/meshes?q={'a' * 70_000}")  # httpx refuses to send it
        assert connection.getresponse().status == 414
        connection.close()
        answer = client.get(f"{live.url}/meshes", headers={f"x-{number}": "y" for number in range(101)})
        assert answer.status_code == 431
        assert answer.json()["error"] == "headers-too-large"


def exchanged(live: LiveServer, request: bytes) -> bytes:
    """What is answered until the server hangs up."""
    host, port = live.url.removeprefix("http://").split(":")
    answer = b""
    with socket.create_connection((host, int(port)), timeout=10.0) as client:
        client.sendall(request)
        while data := client.recv(1 << 16):
            answer += data
    return answer


def test_a_request_names_the_host_that_it_asks(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    answer = exchanged(live, b"GET /healthz HTTP/1.1\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["error"] == "bad-request"
    upgrade = b"GET /meshes/small/stream HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n"
    assert exchanged(live, upgrade).startswith(b"HTTP/1.1 400 ")
    assert exchanged(live, b"GET /healthz HTTP/1.0\r\n\r\n").startswith(b"HTTP/1.1 200 ")
    named = b"GET /healthz HTTP/1.1\r\nHost: h\r\nConnection: close\r\n\r\n"
    assert exchanged(live, named).startswith(b"HTTP/1.1 200 ")


def test_limits_are_settings(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    limits: dict[str, Any] = {"max_request_line": 1024, "max_head": 2048, "max_headers": 10}
    live = serve(Settings(directory=folder, rescan_seconds=0, **limits))
    assert httpx.get(f"{live.url}/healthz?{'a' * 900}").status_code == 200
    assert httpx.get(f"{live.url}/healthz?{'a' * 1024}").status_code == 414
    assert httpx.get(f"{live.url}/healthz", headers={"x": "y" * 2048}).status_code == 431
    assert httpx.get(f"{live.url}/healthz", headers={f"x{n}": "y" for n in range(8)}).status_code == 431
