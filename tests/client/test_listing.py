from __future__ import annotations

import json
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_client.listing import HostedMesh, list_meshes
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, TransferError

if TYPE_CHECKING:
    from collections.abc import Iterator

READY: dict[str, Any] = {
    "id": "vase",
    "name": "vase.ply",
    "status": "ready",
    "stage": None,
    "progress": 1.0,
    "reason": None,
    "vertices": 100,
    "faces": 200,
    "levels": 4,
    "bytes": 500,
}
ENCODING = READY | {
    "id": "cup",
    "status": "encoding",
    "stage": "levels",
    "progress": 0.25,
    "vertices": None,
    "faces": None,
    "levels": None,
    "bytes": None,
}


@contextmanager
def answering(body: bytes, status: int = 200) -> Iterator[str]:
    """A web server that gives one answer to everything."""
    asked: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(status)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Be silent."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    assert set(asked) <= {"/meshes", "/meshes/index.json"}


@pytest.mark.parametrize("wrapped", [False, True])
def test_meshes_are_listed(wrapped: bool) -> None:
    rows = [READY, ENCODING]
    with answering(json.dumps({"meshes": rows} if wrapped else rows).encode()) as url:
        meshes = list_meshes(url)
    assert meshes[0] == HostedMesh(**READY)
    assert meshes[1].stage == "levels"
    assert meshes[1].vertices is None


def test_a_server_may_host_nothing() -> None:
    with answering(b"[]") as url:
        assert list_meshes(url) == ()


@pytest.mark.parametrize(
    "body",
    [
        b"<html>hello</html>",
        b"",
        b"null",
        b"42",
        b'{"meshes": 3}',
        b'{"rooms": []}',
        b"[3]",
        b"[[]]",
        b"[{}]",
        json.dumps([READY | {"vertices": -1}]).encode(),
        json.dumps([READY | {"vertices": "many"}]).encode(),
        json.dumps([READY | {"progress": 2.0}]).encode(),
        json.dumps([READY | {"id": 7}]).encode(),
        json.dumps([READY | {"name": "x" * 2000}]).encode(),
        b"[" * 100_000,
    ],
)
def test_what_is_no_list_of_meshes_is_told(body: bytes) -> None:
    with answering(body) as url, pytest.raises(ProtocolError, match="does not list meshes"):
        list_meshes(url)


def test_a_refusal_is_told_in_the_servers_words() -> None:
    body = json.dumps({"error": "too-busy", "message": "come back later"}).encode()
    with answering(body, 503) as url, pytest.raises(PeerError, match="come back later") as caught:
        list_meshes(url)
    assert caught.value.code == "too-busy"


def test_another_web_server_is_told() -> None:
    with answering(b"not here", 404) as url, pytest.raises(ProtocolError, match="HTTP status 404; check the address"):
        list_meshes(url)


def test_no_server_is_told() -> None:
    with pytest.raises(TransferError, match=r"cannot reach http://127\.0\.0\.1:9"):
        list_meshes("http://127.0.0.1:9")


def test_no_address_is_told() -> None:
    with pytest.raises(OptionError, match="write it like http://localhost:8000"):
        list_meshes("localhost")
