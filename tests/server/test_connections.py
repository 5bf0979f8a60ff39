import asyncio
import logging
import socket
import struct
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import Request, WebSocket
from hypothesis import given
from hypothesis import strategies as st
from starlette.responses import StreamingResponse
from starlette.websockets import WebSocketDisconnect
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.server import ServerState
from websockets.exceptions import ConnectionClosed
from websockets.frames import Frame, Opcode
from websockets.sync.client import connect

from meshtide_codec.stream.session import ClientSession
from meshtide_server import routes
from meshtide_server.app import create_app
from meshtide_server.connections import WebSocketProtocol, cut, frame_head
from meshtide_server.prepared_answers import SECONDS
from meshtide_server.serving import configuration
from meshtide_server.settings import Settings

from .conftest import LiveServer, make_stream
from .connection_parts import FakeTransport


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


@given(st.one_of(st.integers(0, 300), st.integers(65_400, 66_000)))
def test_heads_are_those_of_the_library(size: int) -> None:
    data = bytes(size)
    assert frame_head(size) + data == Frame(Opcode.BINARY, data).serialize(mask=False)


def prepare(live: LiveServer, url: str) -> httpx.Response:
    """Ask once, and wait until the answer is kept, which happens after it was sent."""
    kept = len(live.app.state.prepared)
    answer = httpx.get(url)
    deadline = time.monotonic() + 5
    while len(live.app.state.prepared) == kept:
        assert time.monotonic() < deadline
        time.sleep(0.001)
    return answer


def packets(live: LiveServer) -> list[str]:
    detail = httpx.get(f"{live.url}/meshes/small").raise_for_status().json()
    return [f"{live.url}/packets/{packet['sha256']}" for packet in detail["packets"]]


def test_an_answer_that_is_ready_is_the_same_as_the_first(
    serve: Callable[[Settings], LiveServer], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = serve(Settings(directory=folder))
    first = prepare(live, f"{live.url}/meshes/small.tide")
    monkeypatch.setattr(routes, "download", lambda *_: 1 / 0)  # the application is not asked any more
    with httpx.Client() as client:
        others = [client.get(f"{live.url}/meshes/small.tide") for _ in range(3)]
    assert first.content == make_stream()
    ids = {answer.headers["x-request-id"] for answer in (first, *others)}
    assert len(ids) == 4
    for answer in others:
        assert answer.content == first.content
        assert dict(answer.headers) | {"x-request-id": "", "date": ""} == dict(first.headers) | {
            "x-request-id": "",
            "date": "",
        }


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Range": "bytes=0-9"}, 206),
        ({"Range": "bytes=999999999-"}, 416),
        ({"If-None-Match": "*"}, 304),
        ({"If-Match": '"other"'}, 412),
        ({"X-Request-ID": "mine"}, 200),
        ({"Connection": "close"}, 200),
    ],
)
def test_what_a_header_may_change_is_asked_of_the_application(
    serve: Callable[[Settings], LiveServer], folder: Path, headers: dict[str, str], status: int
) -> None:
    live = serve(Settings(directory=folder))
    url = packets(live)[3]
    with httpx.Client() as client:
        whole = prepare(live, url)
        answer = client.get(url, headers=headers)
        assert client.head(url).content == b""
        again = client.get(url)
    assert answer.status_code == status
    assert answer.headers.get("x-request-id") == headers.get("X-Request-ID", answer.headers["x-request-id"])
    assert ("close" in answer.headers.get("connection", "")) == ("Connection" in headers)
    assert again.content == whole.content


def test_a_file_that_changes_is_not_given_again(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    assert prepare(live, f"{live.url}/meshes/small.tide").status_code == 200
    (folder / "small.tide").write_bytes(make_stream(2))
    assert httpx.get(f"{live.url}/meshes/small.tide").status_code == 503


def test_requests_that_write_make_all_answers_new(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder))
    prepare(live, f"{live.url}/meshes/small.tide")
    httpx.delete(f"{live.url}/meshes/small")
    assert len(live.app.state.prepared) == 0


def test_requests_in_one_piece_are_answered_in_their_order(
    serve: Callable[[Settings], LiveServer], folder: Path
) -> None:
    live = serve(Settings(directory=folder))
    first, second = (url.removeprefix(live.url) for url in packets(live)[:2])
    whole = [httpx.get(live.url + path).content for path in (first, second)]
    paths = [first, second, "/healthz", second, first]
    asked = b"".join(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode() for path in paths[:-1])
    asked += f"GET {first} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", int(live.url.rsplit(":", 1)[1])), timeout=5 * SECONDS) as connection:
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


async def test_over_a_websocket_that_is_closing_nothing_is_sent(folder: Path) -> None:
    config = configuration(create_app(Settings(directory=folder)), Settings(directory=folder))
    protocol = WebSocketProtocol(config=config, server_state=ServerState(), app_state={})
    transport = FakeTransport()
    protocol.connection_made(transport)  # type: ignore[arg-type]
    transport.abort()
    for message in ({"type": "websocket.accept"}, {"type": "websocket.send", "frames": [b"x"]}):
        with pytest.raises(ClientDisconnected):
            await protocol.send(message)
    assert not transport.written
