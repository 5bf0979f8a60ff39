from __future__ import annotations

import json
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs

import pytest

from meshtide_client.remote.listing import BoundingBox, ListedMesh, list_meshes
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, TransferError
from meshtide_codec.stream.mesh_query import MeshQuery

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

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


Answer = tuple[int, bytes, dict[str, str]]


@contextmanager
def web_server(answer: Callable[[str], Answer]) -> Iterator[str]:
    """A web server that answers each path and query with a status, a body and headers."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            status, body, headers = answer(self.path)
            self.send_response(status)
            for name, value in (headers | {"Content-Length": str(len(body))}).items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Be silent."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextmanager
def answering(body: bytes, status: int = 200) -> Iterator[str]:
    """A web server that gives one answer to everything."""
    asked: list[str] = []

    def answer(path: str) -> Answer:
        asked.append(path.partition("?")[0])
        return status, body, {}

    with web_server(answer) as url:
        yield url
    assert set(asked) <= {"/meshes", "/meshes/index.json"}


@contextmanager
def paging(rows: list[dict[str, Any]], page: int, *, stuck: bool = False) -> Iterator[tuple[str, list[str]]]:
    """A server that gives `page` rows at a time, and the queries that it was asked."""
    queries: list[str] = []

    def answer(path: str) -> Answer:
        queries.append(path.partition("?")[2])
        asked = parse_qs(queries[-1])
        after = "" if stuck else asked.get("after", [""])[0]
        found = [row for row in rows if row["id"] > after]
        size = min(page, int(asked["limit"][0]))
        link = {"Link": f'</elsewhere?q=x&after={found[size - 1]["id"]}>; rel="next"'} if len(found) > size else {}
        return 200, json.dumps(found[:size]).encode(), link

    with web_server(answer) as url:
        yield url, queries


@pytest.mark.parametrize("wrapped", [False, True])
def test_meshes_are_listed(wrapped: bool) -> None:
    rows = [READY, ENCODING]
    with answering(json.dumps({"meshes": rows} if wrapped else rows).encode()) as url:
        meshes = list_meshes(url)
    assert meshes[0] == ListedMesh(**READY)
    assert meshes[1].stage == "levels"
    assert meshes[1].vertices is None


MANY = [READY | {"id": f"mesh-{number}"} for number in range(7)]


def test_pages_are_followed_to_the_end() -> None:
    told: list[int] = []
    with paging(MANY, 3) as (url, queries):
        meshes = list_meshes(url, search=MeshQuery(text="mesh"), progress=told.append)
    assert [mesh.id for mesh in meshes] == [row["id"] for row in MANY]
    assert told == [3, 6, 7]
    assert queries == ["q=mesh&limit=1000", "q=mesh&after=mesh-2&limit=1000", "q=mesh&after=mesh-5&limit=1000"]


@pytest.mark.parametrize("limit", [1, 3, 4, 7, 20])
def test_no_more_than_asked_for(limit: int) -> None:
    with paging(MANY, 3) as (url, queries):
        assert len(list_meshes(url, limit=limit)) == min(limit, 7)
    assert len(queries) == -(-min(limit, 7) // 3)


def test_pages_that_do_not_end_are_told() -> None:
    with paging(MANY, 3, stuck=True) as (url, _), pytest.raises(ProtocolError, match="again and again"):
        list_meshes(url)


def test_what_is_known_of_a_published_mesh() -> None:
    row = READY | {
        "tags": ["clay", "scan"],
        "licence": "CC BY 4.0",
        "created": "2026-11-02T09:30:00Z",
        "updated": "2026-11-03T09:30:00Z",
        "box": {"minimum": [0, 0, 0], "maximum": [1, 2, 3.5]},
    }
    with answering(json.dumps([row]).encode()) as url:
        (mesh,) = list_meshes(url)
    assert (mesh.tags, mesh.licence, mesh.created) == (("clay", "scan"), "CC BY 4.0", "2026-11-02T09:30:00Z")
    assert mesh.updated == "2026-11-03T09:30:00Z"
    assert mesh.box == BoundingBox((0.0, 0.0, 0.0), (1.0, 2.0, 3.5))


def test_a_static_copy_cannot_be_searched() -> None:
    def answer(path: str) -> Answer:
        return 200, json.dumps({"meshes": [READY]}).encode() if path == "/meshes/index.json" else b"<html>", {}

    with web_server(answer) as url:
        assert [mesh.id for mesh in list_meshes(url, limit=5)] == ["vase"]
        with pytest.raises(OptionError, match="static copy, which cannot be searched"):
            list_meshes(url, search=MeshQuery(tags=("clay",)))


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
        json.dumps([READY | {"tags": "clay"}]).encode(),
        json.dumps([READY | {"tags": [7]}]).encode(),
        json.dumps([READY | {"box": {"minimum": [0, 0], "maximum": [1, 1, 1]}}]).encode(),
        json.dumps([READY | {"box": [0]}]).encode(),
        json.dumps([READY | {"licence": 4}]).encode(),
        b"[" * 100_000,
    ],
)
def test_what_is_no_list_of_meshes_is_told(body: bytes) -> None:
    with answering(body) as url, pytest.raises(ProtocolError, match="does not list meshes"):
        list_meshes(url)


@pytest.mark.parametrize("body", [b"[{}]", b"[7]", b'["a"]', json.dumps([READY | {"box": [0]}]).encode()])
def test_what_is_wrong_with_a_list_is_told_in_words_of_this_program(body: bytes) -> None:
    with answering(body) as url, pytest.raises(ProtocolError, match="a member is missing, or of another kind"):
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
