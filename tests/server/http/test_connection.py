import asyncio
import logging
import socket
import struct
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import Request, WebSocket
from starlette.responses import StreamingResponse
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from meshtide_codec.stream.session import ClientSession
from meshtide_server.http.connection import FRAMES, STATE, Connecting, Connection, cut
from meshtide_server.http.gate import Door, Gate
from meshtide_server.settings import Settings

from ..conftest import LiveServer
from ..connection_parts import FakeTransport, Notes
from ..made_streams import make_stream


def test_without_a_connection_nothing_is_cut() -> None:
    for scope in ({"type": "http"}, {"type": "http", "state": {}}):
        before = {**scope}
        cut(scope)
        assert scope == before


def test_requests_and_websockets_can_be_cut(folder: Path, serve: Any) -> None:
    server = serve(Settings(directory=folder, rescan_seconds=0))

    async def cut_request(request: Request) -> None:
        cut(request.scope)

    async def cut_websocket(websocket: WebSocket) -> None:
        await websocket.accept()
        cut(websocket.scope)
        try:
            await websocket.receive()
        except WebSocketDisconnect:
            return

    server.app.add_api_route("/cut", cut_request)
    server.app.add_api_websocket_route("/cut-websocket", cut_websocket)
    with pytest.raises(httpx.RemoteProtocolError):
        httpx.get(f"{server.url}/cut")
    with connect(f"{server.socket_url}/cut-websocket") as websocket, pytest.raises(ConnectionClosed):
        websocket.recv(5.0)
    assert httpx.get(f"{server.url}/healthz").status_code == 200


@pytest.mark.parametrize("start", [b"", b"G", b"GET /meshes HTTP/1.1\r\nHost: h\r\nX-Long: "])
def test_who_does_not_finish_asking_is_dropped(start: bytes, folder: Path, serve: Any) -> None:
    server = serve(Settings(directory=folder, rescan_seconds=0, hello_timeout=0.4))
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as client:
        client.settimeout(5.0)
        client.sendall(start)
        began = time.monotonic()
        with suppress(OSError):  # bytes one by one do not help
            while time.monotonic() - began < 3.0:
                client.sendall(b"x" if start else b"")
                time.sleep(0.05)
                if not server.server.server_state.connections:
                    break
        assert time.monotonic() - began < 3.0
    assert not server.server.server_state.connections


def test_who_asks_in_time_is_answered_however_often_and_long(folder: Path, serve: Any) -> None:
    server = serve(Settings(directory=folder, rescan_seconds=0, hello_timeout=0.3))

    async def slow() -> str:
        await asyncio.sleep(0.6)
        return "done"

    server.app.add_api_route("/slow", slow)
    with httpx.Client() as client:
        for _ in range(2):
            assert client.get(f"{server.url}/slow").json() == "done"
        assert len(server.server.server_state.connections) == 1
    with httpx.Client() as client:  # answers that are ready count as well
        for _ in range(12):
            assert client.get(f"{server.url}/meshes/small.tide").status_code == 200
            time.sleep(0.05)
    with connect(f"{server.socket_url}/meshes/small/stream") as stream:
        stream.send(ClientSession("small", window=100).hello())
        stream.recv(5.0)
        time.sleep(0.6)
        assert server.running_streams(1) == 1


def test_after_an_answer_the_next_question_has_a_deadline_again(folder: Path, serve: Any) -> None:
    server = serve(Settings(directory=folder, rescan_seconds=0, hello_timeout=0.3))
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as client:
        client.settimeout(3.0)
        client.sendall(b"GET /healthz HTTP/1.1\r\nHost: h\r\n\r\n")
        answer = b""
        while not answer.endswith(b"}}"):
            answer += client.recv(4096)
        assert answer.startswith(b"HTTP/1.1 200")
        client.sendall(b"GET /hea")
        with suppress(ConnectionResetError):
            assert client.recv(4096) == b""


def test_a_websocket_that_nobody_reads_leaves_nothing_behind(
    folder: Path, serve: Any, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "large.tide").write_bytes(make_stream(3, (400, 30, 40, 2000, 50, 30_000_000)))
    caplog.set_level(logging.INFO)
    server = serve(Settings(directory=folder, rescan_seconds=0, stall_timeout=0.4))
    with connect(f"{server.socket_url}/meshes/large/stream", max_queue=1, close_timeout=0.1) as websocket:
        websocket.send(ClientSession("large", window=1 << 30).hello())
        assert server.running_streams(1) == 1
        assert server.running_streams(0, 10.0) == 0
        deadline = time.monotonic() + 5.0
        while server.server.server_state.connections and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not server.server.server_state.connections
    assert "nobody reads" in caplog.text or "read nothing" in caplog.text
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]


def packets(live: LiveServer) -> list[str]:
    detail = httpx.get(f"{live.url}/meshes/small").raise_for_status().json()
    return [f"{live.url}/packets/{packet['sha256']}" for packet in detail["packets"]]


def test_requests_in_one_piece_are_answered_in_their_order(
    serve: Callable[[Settings], LiveServer], folder: Path
) -> None:
    live = serve(Settings(directory=folder))
    first, second = (url.removeprefix(live.url) for url in packets(live)[:2])
    whole = [httpx.get(live.url + path).content for path in (first, second)]
    paths = [first, second, "/healthz", second, first]
    asked = b"".join(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode() for path in paths[:-1])
    asked += f"GET {first} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", int(live.url.rsplit(":", 1)[1])), timeout=5.0) as connection:
        connection.sendall(asked)
        answer = b""
        while data := connection.recv(1 << 16):
            answer += data
    assert answer.count(b"HTTP/1.1 200 OK\r\n") == 5
    positions = [answer.find(whole[0]), answer.find(whole[1]), answer.find(b'"status":"ok"'), answer.rfind(whole[1])]
    assert positions == sorted(positions)
    assert positions[0] >= 0
    assert answer.endswith(whole[0])


def test_an_answer_ends_with_its_client_though_others_wait_behind_it(folder: Path, serve: Any) -> None:
    """uvicorn tells only the last of the requests that came in one piece that the connection is lost."""
    live: LiveServer = serve(Settings(directory=folder, rescan_seconds=0))
    made, ended = [], threading.Event()

    async def pieces() -> AsyncIterator[bytes]:
        try:
            for _ in range(100_000):
                made.append(1)
                await asyncio.sleep(0)
                yield bytes(10_000)
        finally:
            ended.set()

    live.app.add_api_route("/long", lambda: StreamingResponse(pieces()))
    host, port = live.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.sendall(b"GET /long HTTP/1.1\r\nHost: h\r\n\r\n" * 3)
        client.recv(100)
    assert ended.wait(10)
    assert len(made) < 10_000
    assert httpx.get(f"{live.url}/healthz").status_code == 200


async def test_what_is_written_while_it_is_corked_leaves_in_one_piece_or_not_at_all() -> None:
    connection = Connection()
    writes: list[bytes] = []

    class Writes(FakeTransport):
        def write(self, data: bytes) -> None:
            super().write(data)
            writes.append(bytes(data))

    transport = Writes()
    door = Door(transport, Gate(Notes(), connection))  # type: ignore[arg-type]
    with connection.corked():
        pass  # there is no door yet
    connection.opened(door)
    with connection.corked():
        door.write(b"one ")
        door.write(b"two")
        assert writes == []
    door.write(b"three")
    with connection.corked():
        pass
    assert writes == [b"one two", b"three"]
    with pytest.raises(ZeroDivisionError), connection.corked():
        door.write(b"four")
        raise ZeroDivisionError
    assert writes[-1] == b"four"
    connection.abort()
    with connection.corked():
        door.write(b"five")
    assert (len(writes), transport.aborted) == (3, True)


async def test_frames_are_sent_one_by_one_and_written_at_once() -> None:
    connection = Connection()
    transport = FakeTransport()
    door = Door(transport, Gate(Notes(), connection))  # type: ignore[arg-type]
    connection.opened(door)
    sent = []

    async def send(message: Any) -> None:
        sent.append(message)
        door.write(message["bytes"])
        assert not transport.written

    async def app(scope: Any, _receive: Any, send: Any) -> None:
        assert FRAMES in scope["extensions"]
        await send({"type": "websocket.send", "frames": [b"a", b"bc"]})

    scope = {"type": "websocket", "extensions": {}, "state": {STATE: connection}}
    await Connecting(app)(scope, None, send)  # type: ignore[arg-type]
    assert sent == [{"type": "websocket.send", "bytes": data} for data in (b"a", b"bc")]
    assert transport.written == b"abc"


@pytest.mark.parametrize("fault", [False, True])
async def test_the_gate_hears_of_each_answer_whatever_comes_of_it(fault: bool) -> None:
    connection = Connection()
    told: list[bool] = []
    door = Door(FakeTransport(), Gate(Notes(), connection))  # type: ignore[arg-type]
    connection.opened(door, lambda: told.append(connection.busy))
    connection.asked()

    async def app(*_: Any) -> None:
        assert connection.busy
        if fault:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError) if fault else nullcontext():
        await Connecting(app)({"type": "http", "state": {STATE: connection}}, None, None)  # type: ignore[arg-type]
    assert told == [False]
