import logging
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import Request, WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from meshtide_codec.stream.session import ClientSession
from meshtide_server.connections import cut
from meshtide_server.settings import Settings

from .conftest import make_stream


def test_without_a_connection_nothing_is_cut() -> None:
    cut({"type": "http"})
    cut({"type": "http", "state": {}})


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
    with connect(f"{server.socket_url}/cut-websocket") as socket, pytest.raises(ConnectionClosed):
        socket.recv(5.0)
    assert httpx.get(f"{server.url}/healthz").status_code == 200


def test_a_websocket_that_nobody_reads_leaves_nothing_behind(
    folder: Path, serve: Any, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "large.tide").write_bytes(make_stream(3, (400, 30, 40, 2000, 50, 30_000_000)))
    caplog.set_level(logging.INFO)
    server = serve(Settings(directory=folder, rescan_seconds=0, stall_timeout=0.4))
    with connect(f"{server.socket_url}/meshes/large/stream", max_queue=1, close_timeout=0.1) as socket:
        socket.send(ClientSession("large", window=1 << 30).hello())
        assert server.running_streams(1) == 1
        assert server.running_streams(0, 10.0) == 0
        deadline = time.monotonic() + 5.0
        while server.server.server_state.connections and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not server.server.server_state.connections
    assert "nobody reads" in caplog.text or "read nothing" in caplog.text
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]
