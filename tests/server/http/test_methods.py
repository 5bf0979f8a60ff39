"""HEAD, OPTIONS and refusals of methods, at every address that the server has."""

import re
import socket
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import httpx
import pytest
from fastapi import APIRouter
from pydantic import SecretStr

from meshtide_server.http.methods import add_heads, allowed_methods

from ..conftest import LiveServer, running
from ..http.routes.test_ingest import WRITER, finished, post, settings_for
from ..made_streams import make_stream

_OTHER = {"date", "x-request-id", "content-length", "transfer-encoding"}


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    folder = tmp_path_factory.mktemp("meshes")
    (folder / "scans" / "old").mkdir(parents=True)
    (folder / "small.tide").write_bytes(make_stream())
    (folder / "scans" / "old" / "vase.tide").write_bytes(make_stream(3))
    settings = settings_for(
        folder, folder / "data", recursive=True, allowed_origins="https://a.example", metrics="open"
    )
    with running(settings) as server:
        yield server


@pytest.fixture(scope="module")
def job(live: LiveServer) -> str:
    identifier: str = post(live.url, "bad.obj", b"no mesh").json()["id"]
    finished(live.url, identifier)
    return identifier


@pytest.fixture(scope="module")
def addresses(live: LiveServer, job: str) -> dict[str, set[str]]:
    """Every address of the OpenAPI document, with the methods that it tells."""
    digest = httpx.get(f"{live.url}/meshes/small").json()["packets"][0]["sha256"]
    paths = httpx.get(f"{live.url}/openapi.json").json()["paths"]
    names = {"mesh_id": "small", "digest": digest, "job_id": job}
    return {
        re.sub(r"\{(\w+)\}", lambda found: names[found[1]], path): {method.upper() for method in operations}
        for path, operations in paths.items()
    }


def test_head_is_get_without_its_body(live: LiveServer, addresses: dict[str, set[str]]) -> None:
    readable = [path for path, methods in addresses.items() if "GET" in methods]
    assert len(readable) > 10
    for path in (*readable, "/docs", "/openapi.json", "/meshes/scans/old/vase", "/meshes/scans/old/vase.tide"):
        got, head = httpx.get(live.url + path), httpx.head(live.url + path)
        assert head.status_code == got.status_code == 200, path
        assert head.content == b""
        told, expected = dict(head.headers), dict(got.headers)
        assert {name: told[name] for name in told.keys() - _OTHER} == {
            name: expected[name] for name in expected.keys() - _OTHER
        }, path
        if path != "/metrics":  # which counts these requests
            assert told.get("content-length") == expected.get("content-length"), path


def test_head_sends_nothing_behind_its_headers(live: LiveServer, addresses: dict[str, set[str]]) -> None:
    host, port = live.url.removeprefix("http://").split(":")
    paths = [path for path, methods in addresses.items() if "GET" in methods]
    asked = b"".join(f"HEAD {path} HTTP/1.1\r\nHost: h\r\n\r\n".encode() for path in paths)
    with socket.create_connection((host, int(port)), timeout=10.0) as connection:
        connection.sendall(asked + b"HEAD /healthz HTTP/1.1\r\nHost: h\r\nConnection: close\r\n\r\n")
        answer = b""
        while data := connection.recv(1 << 16):
            answer += data
    heads = answer.split(b"\r\n\r\n")
    assert heads.pop() == b""
    assert len(heads) == len(paths) + 1
    assert all(head.startswith(b"HTTP/1.1 200 ") for head in heads)


def test_head_knows_ranges_and_conditions(live: LiveServer) -> None:
    url = f"{live.url}/meshes/scans/old/vase"
    answer = httpx.head(f"{url}.tide", headers={"Range": "bytes=5-9"})  # ranges are for GET (RFC 9110, section 14.2)
    assert (answer.status_code, answer.headers["accept-ranges"]) == (200, "bytes")
    assert answer.headers["content-length"] == str(len(make_stream(3)))
    for path in (url, f"{url}.tide", f"{url}/header", f"{live.url}/meshes", f"{live.url}/tags"):
        etag = httpx.head(path).headers["etag"]
        assert httpx.head(path, headers={"If-None-Match": etag}).status_code == 304
    assert httpx.head(f"{live.url}/meshes/none").status_code == 404
    assert httpx.head(f"{live.url}/jobs/none/events").status_code == 404


def test_options_and_refusals_tell_all_methods(live: LiveServer, addresses: dict[str, set[str]]) -> None:
    for path, methods in {**addresses, "/docs": {"GET"}, "/meshes/scans/old/vase": {"GET"}}.items():
        expected = sorted(methods | {"OPTIONS"} | ({"HEAD"} if "GET" in methods else set()))
        answer = httpx.options(live.url + path)
        told = answer.headers["allow"].split(", ")
        if path.endswith(".tide"):  # which could be an id that somebody has chosen, as far as the address tells
            assert set(expected) <= set(told)
            continue
        assert (answer.status_code, told) == (204, expected), path
        for method in sorted({"GET", "POST", "PUT", "PATCH", "DELETE", "TRACE"} - set(expected)):
            refused = httpx.request(method, live.url + path, headers=WRITER)
            assert refused.status_code == 405, (method, path)
            assert refused.headers["allow"].split(", ") == expected, (method, path)
            assert refused.json()["error"] == "method-not-allowed"
    assert httpx.options(f"{live.url}/nothing/here").status_code == 404


def test_the_whole_server_is_asked_with_a_star(live: LiveServer) -> None:
    host, port = live.url.removeprefix("http://").split(":")
    answers = []
    for method in ("OPTIONS", "GET"):
        connection = HTTPConnection(host, int(port), timeout=10.0)
        connection.request(method, "*")
        answers.append(connection.getresponse())
        connection.close()
    assert answers[0].status == 204
    assert answers[0].headers["Allow"] == "DELETE, GET, HEAD, OPTIONS, PATCH, POST, PUT"
    assert answers[1].status == 404


def test_pages_of_other_origins_are_told_what_they_may_do(live: LiveServer) -> None:
    headers = {"Origin": "https://a.example", "Access-Control-Request-Method": "GET"}
    answer = httpx.options(f"{live.url}/meshes/scans/old/vase.tide", headers=headers)
    assert (answer.status_code, answer.headers["access-control-allow-origin"]) == (200, "https://a.example")
    assert "GET" in answer.headers["access-control-allow-methods"]
    headers["Origin"] = "https://b.example"
    answer = httpx.options(f"{live.url}/meshes/small.tide", headers=headers)
    assert answer.status_code == 400
    assert "access-control-allow-origin" not in answer.headers


def test_reading_takes_its_token_with_head_too(folder: Path, tmp_path: Path) -> None:
    token = "token-of-a-reader-0001"  # noqa: S105 - of this test's server
    with running(settings_for(folder, tmp_path / "data", read_tokens=(SecretStr(token),))) as server:
        for path in ("/meshes", "/meshes/small", "/meshes/small.tide", "/meshes/small/header", "/tags", "/jobs/none"):
            assert httpx.head(server.url + path).status_code == 401, path
            assert httpx.head(server.url + path, headers={"Authorization": f"Bearer {token}"}).status_code in {200, 404}


def test_what_answers_head_already_is_left_as_it_is() -> None:
    router = APIRouter()

    @router.get("/a")
    async def first() -> None: ...

    @router.head("/b")
    @router.get("/b")
    async def second() -> None: ...

    assert add_heads(router) is router
    assert len(router.routes) == 4
    add_heads(router)
    assert len(router.routes) == 4
    assert allowed_methods(router.routes, "/a") == allowed_methods(router.routes, "/b") == ["GET", "HEAD", "OPTIONS"]
    assert allowed_methods(router.routes, "/c") == []
