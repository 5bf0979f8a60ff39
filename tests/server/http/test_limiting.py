from __future__ import annotations

import asyncio
import json
import logging
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from meshtide_codec.stream.session import ClientSession
from meshtide_server.http.connection import STATE
from meshtide_server.http.limiting import LARGEST_CHANGE, Limiting, SlowClientError
from meshtide_server.settings import Settings

from ..made_streams import make_stream


def settings(folder: Path, **changes: Any) -> Settings:
    """Limits that hold for this machine too."""
    return Settings(directory=folder, rescan_seconds=0, **({"unlimited_clients": "192.0.2.0/24"} | changes))


def test_connections_of_one_client_are_limited(folder: Path, serve: Any) -> None:
    server = serve(settings(folder, connections_per_client=2))
    url = f"{server.socket_url}/meshes/small/stream"
    with ExitStack() as stack:
        for _ in range(2):
            stack.enter_context(connect(url))
        assert server.running_streams(2) == 2
        with pytest.raises(InvalidStatus) as caught:
            connect(url)
        assert caught.value.response.status_code == 429
        refused = httpx.get(f"{server.url}/meshes")
        assert (refused.status_code, refused.json()["error"]) == (429, "too-many")
        assert refused.headers["retry-after"] == "5"
        assert httpx.get(f"{server.url}/healthz").status_code == 200
    assert server.running_streams(0) == 0
    assert httpx.get(f"{server.url}/meshes").status_code == 200


def test_this_machine_is_spared_unless_told(folder: Path, serve: Any) -> None:
    server = serve(Settings(directory=folder, connections_per_client=1))
    with connect(f"{server.socket_url}/meshes/small/stream"):
        assert httpx.get(f"{server.url}/meshes").status_code == 200


def test_writes_are_limited_and_reads_are_not(folder: Path, serve: Any) -> None:
    server = serve(settings(folder, writes_per_minute=3))
    assert [httpx.post(f"{server.url}/tickets").status_code for _ in range(4)] == [201, 201, 201, 429]
    assert 0 < int(httpx.post(f"{server.url}/tickets").headers["retry-after"]) <= 20
    assert httpx.get(f"{server.url}/meshes").status_code == 200


def test_proxies_are_believed_if_they_are_named(folder: Path, serve: Any) -> None:
    visitor = {"X-Forwarded-For": "203.0.113.7"}
    other = {"X-Forwarded-For": "203.0.113.8"}
    trusting = serve(settings(folder, writes_per_minute=1, trusted_proxies="127.0.0.0/8"))
    url = f"{trusting.url}/tickets"
    codes = [httpx.post(url, headers=headers).status_code for headers in (visitor, visitor, other)]
    assert codes == [201, 429, 201]
    forged = {"X-Forwarded-For": "203.0.113.9, 203.0.113.8"}
    assert httpx.post(f"{trusting.url}/tickets", headers=forged).status_code == 429
    wary = serve(settings(folder, writes_per_minute=1))
    codes = [httpx.post(f"{wary.url}/tickets", headers=headers).status_code for headers in (visitor, other)]
    assert codes == [201, 429]


def test_the_byte_rate_holds_over_http_and_websockets(folder: Path, serve: Any) -> None:
    (folder / "large.tide").write_bytes(make_stream(3, (400, 30, 40, 2000, 50, 40_000)))
    server = serve(settings(folder, bytes_per_second=32_768))
    started = time.monotonic()
    size = len(httpx.get(f"{server.url}/meshes/large.tide").content)
    session = ClientSession("large")
    with connect(f"{server.socket_url}/meshes/large/stream") as stream:
        stream.send(session.hello())
        while not session.finished:
            session.receive(stream.recv())
    assert time.monotonic() - started > 0.9 * (size + session.received_bytes - 32_768) / 32_768


def test_a_download_that_nobody_reads_is_cut(folder: Path, serve: Any, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "large.tide").write_bytes(make_stream(3, (400, 30, 40, 2000, 50, 30_000_000)))
    caplog.set_level(logging.INFO)
    server = serve(settings(folder, stall_timeout=0.4))
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.sendall(b"GET /meshes/large.tide HTTP/1.1\r\nHost: h\r\n\r\n")
        deadline = time.monotonic() + 10.0
        while "read nothing" not in caplog.text and time.monotonic() < deadline:
            time.sleep(0.05)
        while server.server.server_state.connections and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not server.server.server_state.connections
    assert "dropped a client that read nothing for 0.4 s" in caplog.text
    assert "fault" not in caplog.text
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]
    assert httpx.get(f"{server.url}/meshes/small.tide").status_code == 200


async def test_each_piece_has_its_own_deadline() -> None:
    async def application(_scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for _ in range(4):
            await send({"type": "http.response.body", "body": b"x", "more_body": True})
        await send({"type": "http.response.body", "body": b"", "more_body": False})

    pauses = [0.0, 0.02, 0.02, 0.02, 0.02, 0.0]
    sent: list[str] = []

    async def send(message: Any) -> None:
        await asyncio.sleep(pauses[len(sent)])
        sent.append(message["type"])

    class Transport:
        aborted = False

        def abort(self) -> None:
            self.aborted = True

    async def receive() -> Any:
        raise AssertionError

    transport = Transport()
    scope: dict[str, Any] = {"type": "http", "method": "GET", "path": "/", "client": ("192.0.2.1", 1)}
    scope["state"] = {STATE: transport}
    layer = Limiting(application, Settings(samples=True, stall_timeout=0.05))
    await layer(scope, receive, send)
    assert len(sent) == 6
    assert not transport.aborted
    sent.clear()
    pauses[3] = 60.0
    await layer(scope, receive, send)
    assert len(sent) == 3
    assert transport.aborted


async def test_faults_of_the_application_pass_through() -> None:
    async def application(_scope: Any, _receive: Any, _send: Any) -> None:
        raise ValueError("a fault")

    layer = Limiting(application, Settings(samples=True))
    with pytest.raises(ValueError, match="a fault"):
        await layer({"type": "http", "method": "GET", "path": "/"}, None, None)  # type: ignore[arg-type]
    assert issubclass(SlowClientError, OSError)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("connections_per_client", -1),
        ("bytes_per_second", 100),
        ("writes_per_minute", -5),
        ("unlimited_clients", "10.0.0.1/8"),
        ("trusted_proxies", "everybody"),
    ],
)
def test_limits_that_make_no_sense_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        Settings(samples=True, **{name: value})


def test_refusals_are_problems(folder: Path, serve: Any) -> None:
    server = serve(settings(folder, writes_per_minute=1))
    httpx.post(f"{server.url}/tickets")
    assert set(json.loads(httpx.post(f"{server.url}/tickets").content)) == {"error", "message"}


def test_a_body_without_end_is_not_kept_for_a_stranger(folder: Path, serve: Any) -> None:
    server = serve(Settings(directory=folder, data=folder / "data", rescan_seconds=0))
    sent = 0

    def endless() -> Iterator[bytes]:
        nonlocal sent
        yield b'{"licence": "'
        for _ in range(512):
            sent += 1 << 16
            yield b"x" * (1 << 16)

    with suppress(httpx.WriteError):  # it may be refused while it is still sent
        answer = httpx.patch(f"{server.url}/meshes/small", content=endless(), timeout=20.0)
        assert (answer.status_code, answer.json()["error"]) == (413, "too-large")
    assert LARGEST_CHANGE < sent < 1 << 25
    change = {"licence": "x" * 20_000, "tags": ["\u00fc" * 100] * 50}
    assert httpx.patch(f"{server.url}/meshes/small", json=change).status_code == 403
