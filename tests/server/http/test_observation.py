import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from starlette.requests import Request
from starlette.websockets import WebSocket
from uvicorn.protocols.utils import ClientDisconnected
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from meshtide_server.hosting import library
from meshtide_server.http.connection import STATE
from meshtide_server.http.observation import Observation
from meshtide_server.operations import metrics
from meshtide_server.operations.logs import request_id
from meshtide_server.settings import Settings

from ..conftest import LiveServer


def records(caplog: pytest.LogCaptureFixture) -> list[dict[str, Any]]:
    return [record.fields for record in caplog.records if hasattr(record, "fields")]


def test_ids_come_back_over_http_and_websocket(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder))
    chosen = {"X-Request-ID": "chosen-1"}
    for path in ("/healthz", "/meshes/small.tide", "/nowhere", "/meshes/nothing"):
        assert httpx.get(live.url + path, headers=chosen).headers["x-request-id"] == "chosen-1"
        assert len(httpx.get(live.url + path).headers["x-request-id"]) == 16
    with connect(f"{live.socket_url}/meshes/small/stream", additional_headers=chosen) as connection:
        assert connection.response is not None
        assert connection.response.headers["x-request-id"] == "chosen-1"


def test_the_access_log_has_paths_without_queries(
    serve: Callable[[Settings], LiveServer], folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "meshtide.access")
    live = serve(Settings(directory=folder, access_log=True))
    answer = httpx.get(f"{live.url}/meshes/small.tide?ticket=s3cr3t", headers={"Authorization": "Bearer s3cr3t"})
    with connect(f"{live.socket_url}/meshes/nothing/stream?ticket=s3cr3t") as connection:
        connection.recv(5)
    live.running_streams(0)
    of_the_server = [each for each in caplog.records if not each.name.startswith("httpx")]  # the client is in here too
    assert "s3cr3t" not in "\n".join(each.getMessage() for each in of_the_server)
    http, websocket = records(caplog)
    assert (http["method"], http["path"], http["status"]) == ("GET", "/meshes/small.tide", 200)
    assert http["bytes"] == len(answer.content)
    assert (websocket["method"], websocket["status"]) == ("WEBSOCKET", 101)


def test_requests_are_not_logged_unless_wanted(
    serve: Callable[[Settings], LiveServer], folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "meshtide.access")
    httpx.get(f"{serve(Settings(directory=folder)).url}/healthz")
    assert records(caplog) == []


def test_a_fault_is_answered_with_the_id_under_which_it_is_logged(
    serve: Callable[[Settings], LiveServer],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    live = serve(Settings(directory=folder))
    seen = []

    def fail(_self: object, _id: str) -> None:
        seen.append(request_id())
        raise ZeroDivisionError("on purpose")

    monkeypatch.setattr(library.Library, "find", fail)
    before = metrics.REGISTRY.get_sample_value("meshtide_errors_total", {"part": "http"}) or 0.0
    answer = httpx.get(f"{live.url}/meshes/small.tide", headers={"X-Request-ID": "faulty-1"})
    assert (answer.status_code, answer.json()["error"]) == (500, "internal")
    assert "faulty-1" in answer.json()["message"]
    assert "on purpose" not in answer.text
    assert seen == ["faulty-1"]
    assert metrics.REGISTRY.get_sample_value("meshtide_errors_total", {"part": "http"}) == before + 1
    assert "ZeroDivisionError: on purpose" in caplog.text
    with connect(f"{live.socket_url}/meshes/small/stream") as connection, pytest.raises(ConnectionClosed) as closed:
        while True:
            connection.recv(5)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1011


async def test_a_fault_in_any_websocket_closes_it() -> None:
    async def failing(scope: Any, receive: Any, send: Any) -> None:
        await WebSocket(scope, receive, send).accept()
        raise ZeroDivisionError

    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "websocket.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    await Observation(failing)({"type": "websocket", "headers": [], "path": "/"}, receive, send)
    assert [message["type"] for message in sent] == ["websocket.accept", "websocket.close"]
    assert sent[1]["code"] == 1011


async def test_an_answer_that_was_cut_off_is_not_taken_for_a_whole_one() -> None:
    async def failing(_scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        raise ZeroDivisionError

    async def send(_message: Any) -> None:
        pass

    with pytest.raises(ConnectionAbortedError, match="request chosen-2 was cut off"):
        await Observation(failing)(
            {"type": "http", "method": "GET", "headers": [(b"x-request-id", b"chosen-2")], "path": "/"},
            None,  # type: ignore[arg-type]
            send,
        )


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("error", [ClientDisconnected(), ConnectionResetError(104, "reset"), BrokenPipeError()])
async def test_who_leaves_before_all_is_sent_is_no_fault(
    kind: str, error: OSError, caplog: pytest.LogCaptureFixture
) -> None:
    part = "stream" if kind == "websocket" else kind
    before = metrics.REGISTRY.get_sample_value("meshtide_errors_total", {"part": part})
    cuts = []

    async def answering(_scope: Any, _receive: Any, send: Any) -> None:
        try:
            await send({"type": f"{kind}.response.start", "status": 200, "headers": []})
        except OSError as reason:
            raise RuntimeError("a framework may wrap it") from reason

    async def send(_message: Any) -> None:
        raise error

    class Transport:
        def abort(self) -> None:
            cuts.append(1)

    scope = {"type": kind, "headers": [], "path": "/", "state": {STATE: Transport()}}
    await Observation(answering)(scope, None, send)  # type: ignore[arg-type]
    assert cuts == [1]
    assert not caplog.records
    assert metrics.REGISTRY.get_sample_value("meshtide_errors_total", {"part": part}) == before


async def test_who_leaves_before_all_is_asked_is_no_fault(caplog: pytest.LogCaptureFixture) -> None:
    async def reading(scope: Any, receive: Any, _send: Any) -> None:
        await Request(scope, receive).body()

    async def receive() -> dict[str, Any]:
        return {"type": "http.disconnect"}

    scope = {"type": "http", "method": "POST", "headers": [], "path": "/"}
    await Observation(reading)(scope, receive, None)  # type: ignore[arg-type]
    assert not caplog.records


@pytest.mark.parametrize("kind", ["http", "websocket"])
async def test_a_fault_is_one_though_nobody_is_there_to_hear_of_it(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    async def failing(_scope: Any, _receive: Any, _send: Any) -> None:
        raise ZeroDivisionError

    async def send(_message: Any) -> None:
        raise ClientDisconnected

    scope = {"type": kind, "method": "GET", "headers": [], "path": "/"}
    await Observation(failing)(scope, None, send)  # type: ignore[arg-type]
    assert [record.message for record in caplog.records] == ["a fault of the server"]
