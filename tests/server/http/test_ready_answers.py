from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from meshtide_server.http.ready_answers import HOLDS, LARGEST_BODY, SECONDS, ReadyAnswers, plain
from meshtide_server.http.routes import meshes as routes
from meshtide_server.settings import Settings

from ..conftest import LiveServer
from ..made_streams import make_stream

HEADERS = [(b"host", b"localhost")]


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


class Application:
    """Counts how often it is asked; its answer is as long as the path says."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.holds = True
        self.status = 200

    async def __call__(self, scope: Any, _receive: Any, send: Any) -> None:
        self.asked.append(scope["path"])
        scope["state"][HOLDS] = lambda: self.holds
        scope["route"] = "the route"
        body = bytes(int(scope["path"].rsplit("/", 1)[1]))
        await send({"type": "http.response.start", "status": self.status, "headers": [(b"etag", b"1")]})
        await send({"type": "http.response.body", "body": body[:5], "more_body": True})
        await send({"type": "http.response.body", "body": body[5:]})


async def ask(
    layer: ReadyAnswers, path: str, method: str = "GET", headers: Any = HEADERS, query: bytes = b""
) -> tuple[Any, ...]:
    """Status, headers and length of an answer, and the route that is counted."""
    said: list[Any] = []

    async def send(message: Any) -> None:
        said.append(message)

    scope = {"type": "http", "path": path, "raw_path": path.encode(), "method": method, "headers": headers}
    scope |= {"query_string": query, "state": {}}
    await layer(scope, None, send)  # type: ignore[arg-type]
    length = sum(len(message["body"]) for message in said[1:])
    return said[0]["status"], said[0]["headers"], length, scope["route"]


async def test_an_answer_is_given_again_for_a_while() -> None:
    app, clock = Application(), Clock()
    layer = ReadyAnswers(app, clock=clock)
    first = await ask(layer, "/a/10")
    assert first == (200, [(b"etag", b"1")], 10, "the route")
    first[1].append((b"x-request-id", b"another layer's"))
    assert await ask(layer, "/a/10") == (200, [(b"etag", b"1")], 10, "the route")
    assert len(app.asked) == 1
    for other in ({"method": "HEAD"}, {"query": b"x"}, {"headers": [(b"range", b"bytes=0-1")]}):
        await ask(layer, "/a/10", **other)  # type: ignore[arg-type]
    assert len(app.asked) == 4
    clock.now = SECONDS
    await ask(layer, "/a/10")
    assert len(app.asked) == 5


async def test_what_no_longer_holds_or_was_no_success_or_is_long_is_not_given_again() -> None:
    app = Application()
    layer = ReadyAnswers(app)
    await ask(layer, "/a/10")
    app.holds = False
    await ask(layer, "/a/10")
    assert len(app.asked) == 2
    app.holds, app.status = True, 404
    for path in ("/b/10", f"/c/{LARGEST_BODY + 1}"):
        before = len(app.asked)
        await ask(layer, path)
        await ask(layer, path)
        app.status = 200
        assert len(app.asked) == before + 2
    await ask(layer, f"/c/{LARGEST_BODY}")
    assert len(layer) == 2


async def test_what_was_not_asked_for_the_longest_gives_way_and_writing_makes_all_new() -> None:
    app = Application()
    layer = ReadyAnswers(app, budget=25)
    for path in ("/a/10", "/b/10", "/a/10", "/c/10"):
        await ask(layer, path)
    assert len(app.asked) == 3
    await ask(layer, "/a/10")
    await ask(layer, "/b/10")
    assert len(app.asked) == 4
    await ask(layer, "/a/1", "DELETE")
    assert len(layer) == 0
    await ask(layer, "/d/25")
    assert len(layer) == 1


async def test_without_a_budget_everything_is_asked() -> None:
    app = Application()
    layer = ReadyAnswers(app, budget=0)
    await ask(layer, "/a/10")
    await ask(layer, "/a/10")
    assert len(app.asked) == 2


@pytest.mark.parametrize(
    ("name", "value"),
    [
        (b"range", b"bytes=0-"),
        (b"if-range", b'"a"'),
        (b"if-modified-since", b"x"),
        (b"authorization", b"Bearer x"),
        (b"origin", b"https://a.example"),
        (b"upgrade", b"websocket"),
        (b"content-length", b"0"),
        (b"transfer-encoding", b"chunked"),
    ],
)
def test_decisive_headers(name: bytes, value: bytes) -> None:
    assert plain([*HEADERS, (b"connection", b"Keep-Alive"), (b"user-agent", b"x")])
    assert not plain([*HEADERS, (name, value)])


def packets(live: LiveServer) -> list[str]:
    detail = httpx.get(f"{live.url}/meshes/small").raise_for_status().json()
    return [f"{live.url}/packets/{packet['sha256']}" for packet in detail["packets"]]


def test_an_answer_that_is_ready_is_the_same_as_the_first(
    serve: Callable[[Settings], LiveServer], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = serve(Settings(directory=folder))
    first = httpx.get(f"{live.url}/meshes/small.tide")
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
        whole = httpx.get(url)
        answer = client.get(url, headers=headers)
        assert client.head(url).content == b""
        again = client.get(url)
    assert answer.status_code == status
    assert answer.headers.get("x-request-id") == headers.get("X-Request-ID", answer.headers["x-request-id"])
    assert ("close" in answer.headers.get("connection", "")) == ("Connection" in headers)
    assert again.content == whole.content


def test_a_file_that_changes_is_not_given_again(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder, rescan_seconds=0))
    assert httpx.get(f"{live.url}/meshes/small.tide").status_code == 200
    (folder / "small.tide").write_bytes(make_stream(2))
    assert httpx.get(f"{live.url}/meshes/small.tide").status_code == 503


def test_where_reading_takes_a_token_each_request_is_looked_at(
    serve: Callable[[Settings], LiveServer], folder: Path
) -> None:
    live = serve(Settings(directory=folder, read_tokens="r3ad-r3ad-r3ad-r3ad"))
    url = f"{live.url}/meshes/small.tide"
    assert httpx.get(url, headers={"Authorization": "Bearer r3ad-r3ad-r3ad-r3ad"}).status_code == 200
    assert httpx.get(url).status_code == 401
