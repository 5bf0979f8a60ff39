import asyncio
import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from meshtide_codec.stream.messages import PROTOCOL_VERSION, Credit, Hello, encode_message
from meshtide_server.http.connection import Connection
from meshtide_server.http.frame_gate import MOST_FRAGMENTS, FrameGate
from meshtide_server.http.gate import PIECES_A_TURN
from meshtide_server.settings import Settings

from ..conftest import LiveServer
from ..connection_parts import FakeTransport, Notes, connected, turns
from ..made_streams import make_stream

HANDSHAKE = b"GET /meshes/small/stream HTTP/1.1\r\nUpgrade: websocket\r\n\r\n"
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10


def frame(opcode: int, payload: bytes = b"", *, final: bool = True) -> bytes:
    size = len(payload)
    first = opcode | (0x80 if final else 0)
    if size < 126:
        head = struct.pack(">BB", first, 0x80 | size)
    elif size < 1 << 16:
        head = struct.pack(">BBH", first, 0x80 | 126, size)
    else:
        head = struct.pack(">BBQ", first, 0x80 | 127, size)
    return head + bytes(4) + payload


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def made(frames: int = 100, control_frames: int = 5) -> tuple[FrameGate, Notes, FakeTransport, Clock]:
    inner, clock = Notes(), Clock()
    gate = FrameGate(inner, Connection(), frames=frames, control_frames=control_frames, clock=clock)
    transport = connected(gate)
    gate.data_received(HANDSHAKE)
    assert inner.pieces == [HANDSHAKE]
    inner.pieces.clear()
    inner.transport.write(b"HTTP/1.1 101 Switching Protocols\r\n\r\n")
    return gate, inner, transport, clock


async def test_frames_that_come_before_the_handshake_is_answered_wait() -> None:
    inner = Notes()
    gate = FrameGate(inner, Connection(), frames=100, control_frames=5)
    transport = connected(gate)
    gate.data_received(HANDSHAKE + frame(BINARY, b"early"))
    gate.data_received(frame(BINARY, b"second"))
    await turns(3)
    assert inner.pieces == [HANDSHAKE]
    assert not transport.reading
    inner.transport.write(b"101")
    await turns(3)
    assert inner.pieces == [HANDSHAKE, frame(BINARY, b"early"), frame(BINARY, b"second")]
    inner.transport.write(b"more")
    assert (bytes(transport.written), transport.reading) == (b"101more", True)


async def test_the_answer_to_a_client_that_has_left_is_dropped() -> None:
    inner = Notes()
    gate = FrameGate(inner, Connection(), frames=100, control_frames=5)
    transport = connected(gate)
    gate.data_received(HANDSHAKE + frame(BINARY, b"early"))
    transport.abort()
    inner.transport.write(b"101")
    gate.connection_lost(None)
    await turns(3)
    assert (transport.written, inner.pieces, inner.lost) == (b"", [HANDSHAKE], True)


async def test_a_flood_of_tiny_frames_is_worked_off_in_turns_and_not_read_meanwhile() -> None:
    gate, inner, transport, clock = made(frames=100)
    gate.data_received(frame(BINARY) * 40_000)
    counts = [len(inner.pieces)]
    for _ in range(10):
        await turns(1)
        counts.append(len(inner.pieces))
    assert counts == [min(PIECES_A_TURN * turn, 100) for turn in range(1, 12)]  # then those of a second are used up
    assert not transport.reading
    clock.now += 0.5
    for _ in range(200):
        await asyncio.sleep(0.01)
        if len(inner.pieces) >= 150:
            break
    await turns(3)
    assert len(inner.pieces) == 150
    assert not transport.closed
    gate.connection_lost(None)


@pytest.mark.parametrize("opcode", [PING, PONG])
async def test_more_pings_than_are_of_use_end_the_websocket(opcode: int) -> None:
    gate, inner, transport, clock = made(control_frames=5)
    for _ in range(4):
        gate.data_received(frame(opcode, b"x") * 5)
        await turns(2)
        clock.now += 1.0
    assert len(inner.pieces) == 20
    assert not gate.deaf
    gate.data_received(frame(opcode) * 100)
    assert len(inner.pieces) == 26
    assert inner.pieces[-1] == frame(CLOSE, b"\x03\xf0too many pings and pongs")
    assert transport.ended
    gate.data_received(frame(BINARY))
    assert len(inner.pieces) == 26
    assert gate.waiting == 0


async def test_a_message_in_many_pieces_ends_the_websocket() -> None:
    gate, inner, _, _ = made(frames=1000)
    whole = frame(BINARY, final=False) + frame(0, final=False) * (MOST_FRAGMENTS - 2) + frame(0)
    gate.data_received(whole * 3)
    await turns(20)
    assert inner.heard == whole * 3
    gate.data_received(frame(BINARY, final=False) + frame(0, final=False) * MOST_FRAGMENTS)
    await turns(20)
    assert len(inner.pieces) == 4 * MOST_FRAGMENTS + 1
    assert b"a message in more than" in inner.pieces[-1]


@given(
    st.lists(st.tuples(st.sampled_from([TEXT, BINARY, PING]), st.sampled_from([0, 1, 125, 126, 70_000])), max_size=5),
    st.integers(1, 50_000),
)
def test_frames_arrive_as_they_were_sent_however_they_are_cut(kinds: list[tuple[int, int]], step: int) -> None:
    async def run() -> None:
        gate, inner, transport, _ = made(control_frames=50)
        sent = b"".join(frame(opcode, b"\x81\x80" * (size // 2) + b"\x89" * (size % 2)) for opcode, size in kinds)
        for position in range(0, len(sent), step):
            gate.data_received(sent[position : position + step])
            await turns(2)
        assert inner.heard == sent
        assert gate.waiting == 0
        assert transport.reading
        gate.connection_lost(None)

    asyncio.run(run())


def hello(credit: int) -> bytes:
    return encode_message(Hello(PROTOCOL_VERSION, "small", b"", (), None, None, None, credit))


def test_a_hello_right_behind_the_handshake_is_heard(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    host, port = live.url.removeprefix("http://").split(":")
    head = b"GET /meshes/small/stream HTTP/1.1\r\nHost: h\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    head += b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    with socket.create_connection((host, int(port)), timeout=10.0) as client:
        client.sendall(head + frame(BINARY, hello(1 << 20)))
        answer = b""
        while make_stream()[-5000:] not in answer:
            data = client.recv(1 << 16)
            assert data
            answer += data
    assert answer.startswith(b"HTTP/1.1 101 ")


def test_a_client_that_pings_too_much_is_told_so(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    with connect(f"{live.socket_url}/meshes/small/stream") as websocket:
        websocket.send(hello(1))
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(1000):
                websocket.ping()
            while True:
                websocket.recv(5.0)
    assert closed.value.rcvd is not None
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, "too many pings and pongs")
    assert live.running_streams(0) == 0


def test_messages_of_a_flood_are_taken_at_their_rate(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0, frames_per_second=50))
    heard = 0

    class Counting:
        def __init__(self, receive: Callable[[bytes], None]) -> None:
            self.receive = receive

        def __call__(self, data: bytes) -> None:
            nonlocal heard
            heard += 1
            self.receive(data)

    with connect(f"{live.socket_url}/meshes/small/stream", close_timeout=0.1) as websocket:
        websocket.send(hello(1))
        websocket.recv(5.0)
        (conversation,) = live.app.parts.streams._conversations
        conversation._session.receive = Counting(conversation._session.receive)
        began = time.monotonic()
        websocket.socket.sendall(frame(BINARY, encode_message(Credit(1))) * 3000)
        for _ in range(20):
            assert httpx.get(f"{live.url}/healthz").status_code == 200
        while time.monotonic() < began + 0.5:
            time.sleep(0.02)
        assert 40 <= heard <= 50 * (time.monotonic() - began) + 51
