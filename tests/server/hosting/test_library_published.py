"""A library that serves published meshes beside those of a folder, over real sockets, on several servers at once."""

import asyncio
import hashlib
import time
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from meshtide_server.catalogue import Catalogue, DatabaseUnavailableError
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.settings import Settings
from meshtide_server.store import open_store

from ..conftest import LiveServer
from ..made_streams import make_stream


def settings(data: Path, **more: object) -> Settings:
    return Settings.model_validate({"data": data, "catalogue_seconds": 0.05, "rescan_seconds": 0, **more})


def published(where: Settings, data: bytes, mesh_id: str, *tags: str) -> None:
    async def work() -> None:
        catalogue = await Catalogue.open(where.database_url)
        store = open_store(where.store_url)
        await publish(store, catalogue, data, Publication(mesh_id, f"{mesh_id}.obj", tags, "CC BY 4.0", "0a" * 32))
        await catalogue.close()

    asyncio.run(work())


def removed(where: Settings, mesh_id: str) -> None:
    async def work() -> None:
        catalogue = await Catalogue.open(where.database_url)
        await catalogue.delete(mesh_id)
        await catalogue.close()

    asyncio.run(work())


def eventually(server: LiveServer, path: str, status: int) -> httpx.Response:
    deadline = time.monotonic() + 10
    while True:
        answer = httpx.get(server.url + path)
        if answer.status_code == status or time.monotonic() > deadline:
            assert answer.status_code == status
            return answer
        time.sleep(0.02)


def test_two_servers_show_what_comes_and_goes(tmp_path: Path, serve: Callable[[Settings], LiveServer]) -> None:
    shared = settings(tmp_path / "data")
    servers = [serve(shared), serve(shared)]
    data = make_stream(7)
    published(shared, data, "vase", "pot")
    packet = hashlib.sha256(data[-5000:]).hexdigest()  # the last packet of make_stream
    for server in servers:
        assert eventually(server, "/meshes/vase.tide", 200).content == data
        assert eventually(server, f"/packets/{packet}", 200).content == data[-5000:]
        detail = httpx.get(f"{server.url}/meshes/vase").json()
        assert (detail["bytes"], detail["status"], detail["licence"]) == (len(data), "ready", "CC BY 4.0")
        assert (detail["tags"], detail["vertices"], detail["faces"]) == (["pot"], 1600, 3196)
        assert detail["box"] == {"minimum": [0.0, -1.0, 0.5], "maximum": [2.0, 1.0, 2.5]}
        assert (detail["sha256"], detail["source"]) == (hashlib.sha256(data).hexdigest(), "0a" * 32)
        assert detail["created"] is not None
        assert detail["created"] <= detail["updated"]
    removed(shared, "vase")
    for server in servers:
        eventually(server, "/meshes/vase", 404)
        eventually(server, f"/packets/{packet}", 404)


def test_a_restarted_server_shows_them_beside_its_folder(
    tmp_path: Path, folder: Path, serve: Callable[[Settings], LiveServer]
) -> None:
    both = settings(tmp_path / "data", directory=folder)
    published(both, make_stream(3), "vase", "clay")
    published(both, make_stream(4), "small")  # the folder has one of that id, which wins
    server = serve(both)
    listed = httpx.get(f"{server.url}/meshes").json()
    assert [mesh["id"] for mesh in listed] == ["small", "vase"]
    assert httpx.get(f"{server.url}/meshes/small.tide").content == make_stream()
    vase = listed[1]
    assert (vase["tags"], vase["licence"], vase["status"]) == (["clay"], "CC BY 4.0", "ready")
    assert vase["box"] == {"minimum": [0.0, -1.0, 0.5], "maximum": [2.0, 1.0, 2.5]}
    assert vase["created"] is not None
    assert (listed[0]["tags"], listed[0]["licence"], listed[0]["created"]) == ([], None, None)


def test_meshes_are_searched_and_paged(tmp_path: Path, folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    both = settings(tmp_path / "data", directory=folder)
    for number in range(4):
        published(both, make_stream(number), f"vase-{number}", "clay", "odd" if number % 2 else "even")
    server = serve(both)

    def ids(**query: object) -> list[str]:
        answer = httpx.get(f"{server.url}/meshes", params=query)  # type: ignore[arg-type]
        assert answer.status_code == 200
        return [mesh["id"] for mesh in answer.json()]

    assert ids(q="VASE") == ["vase-0", "vase-1", "vase-2", "vase-3"]
    assert ids(q="obj 2") == ["vase-2"]
    assert ids(tag=["clay", "odd"]) == ["vase-1", "vase-3"]
    assert ids(status="failed") == []
    assert ids(licence="by cc", limit=3) == ["vase-0", "vase-1", "vase-2"]
    assert ids(licence="nd") == ids(fewest_levels=4) == ids(created_after="2999-01-01") == []
    assert ids(created_before="2999-01-01T00:00:00Z", tag="odd") == ["vase-1", "vase-3"]
    assert ids(fewest_levels=3, most_levels=3, status="ready") == ["small", "vase-0", "vase-1", "vase-2", "vase-3"]
    assert ids(largest=10) == []
    assert ids(fewest_vertices=1600) == ["small", "vase-0", "vase-1", "vase-2", "vase-3"]
    assert ids(box="1.5,0,1,9,9,9", q="vase-1") == ["vase-1"]
    assert ids(box="3,0,1,9,9,9") == []
    answer = httpx.get(f"{server.url}/meshes", params={"limit": 2, "q": "s"})
    assert [mesh["id"] for mesh in answer.json()] == ["small", "vase-0"]
    assert answer.links["next"]["url"] == "/meshes?limit=2&q=s&after=vase-0"
    rest = httpx.get(server.url + answer.links["next"]["url"].replace("limit=2", "limit=3"))
    assert [mesh["id"] for mesh in rest.json()] == ["vase-1", "vase-2", "vase-3"]
    assert "next" not in rest.links


def test_lists_and_pages_are_sent_once(tmp_path: Path, folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    both = settings(tmp_path / "data", directory=folder)
    published(both, make_stream(3), "vase")
    server = serve(both)
    for path in ("/meshes?limit=1", "/meshes/vase", "/meshes/small"):
        first = httpx.get(server.url + path)
        held = {"If-None-Match": first.headers["etag"]}
        again = httpx.get(server.url + path, headers=held)
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", first.headers["etag"])
        assert again.links == first.links
        assert first.headers["cache-control"] == "no-cache"
        ranged = httpx.get(server.url + path, headers={"Range": "bytes=0-3", "If-Match": '"other"'})
        assert (ranged.status_code, ranged.content) == (200, first.content)
        if path != "/meshes/small":
            published(both, make_stream(4), "vase" if "vase" in path else "another")
            changed = eventually_changed(server, path, held)
            assert changed.headers["etag"] != first.headers["etag"]


def eventually_changed(server: LiveServer, path: str, headers: dict[str, str]) -> httpx.Response:
    deadline = time.monotonic() + 10
    while (answer := httpx.get(server.url + path, headers=headers)).status_code == 304:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return answer


def test_a_catalogue_that_does_not_answer_is_told(
    tmp_path: Path, folder: Path, serve: Callable[[Settings], LiveServer], monkeypatch: pytest.MonkeyPatch
) -> None:
    both = settings(tmp_path / "data", directory=folder, catalogue_seconds=0.5)
    published(both, make_stream(3), "vase")
    server = serve(both)
    assert httpx.get(f"{server.url}/meshes/vase.tide").status_code == 200
    catalogue = server.app.parts.library.published.catalogue

    async def broken(*_: object) -> None:
        raise DatabaseUnavailableError("the database postgresql://me@db.example/meshes: gone")

    for part, name in ((catalogue.meshes, "list"), (catalogue.meshes, "get"), (catalogue.meshes, "updated")):
        monkeypatch.setattr(part, name, broken)
    monkeypatch.setattr(catalogue.streams, "find_packet", broken)
    for path in ("/meshes", "/meshes/other", "/meshes/other.tide", f"/packets/{'0' * 64}"):
        answer = httpx.get(server.url + path)
        assert (answer.status_code, answer.json()["error"], answer.headers["retry-after"]) == (503, "not-ready", "1")
        assert "db.example" not in answer.text
    for path in ("/meshes/vase.tide", "/meshes/small", "/healthz", "/meshes/vase"):
        assert httpx.get(server.url + path).status_code == 200, path


def test_a_stream_that_is_gone_or_damaged_is_told(tmp_path: Path, serve: Callable[[Settings], LiveServer]) -> None:
    where = settings(tmp_path / "data")
    published(where, make_stream(3), "vase")
    (stream,) = (tmp_path / "data" / "store" / "streams").iterdir()
    server = serve(where)
    stream.write_bytes(b"short")
    answer = httpx.get(f"{server.url}/meshes/vase.tide")
    assert (answer.status_code, answer.json()["error"]) == (500, "mesh-failed")
    assert "its operator finds the details in the log" in answer.json()["message"]
    assert str(tmp_path) not in answer.text
    stream.unlink()
    assert httpx.get(f"{server.url}/meshes/vase").json()["error"] == "mesh-failed"
    published(where, make_stream(3), "vase")
    assert httpx.get(f"{server.url}/meshes/vase.tide").content == make_stream(3)


def test_foreign_questions_are_refused(folder: Path, serve: Callable[[Settings], LiveServer]) -> None:
    server = serve(Settings(directory=folder, rescan_seconds=0))
    queries = ["limit=0", "limit=x", "box=1,2,3", "box=a,b,c,d,e,f", "box=nan,0,0,1,1,1", "status=odd", "q=%00"]
    queries += ["tag=a%00", "licence=%00", "after=%00", "created_after=soon", "created_before=1e99", "tag=" + "x" * 201]
    queries += [f"{name}={1 << 63}" for name in ("smallest", "largest", "fewest_vertices", "most_levels")]
    for query in queries:
        answer = httpx.get(f"{server.url}/meshes?{query}")
        assert 400 <= answer.status_code < 500, query


def test_readiness_asks_the_catalogue(tmp_path: Path, serve: Callable[[Settings], LiveServer]) -> None:
    answer = httpx.get(f"{serve(settings(tmp_path / 'data')).url}/readyz")
    assert answer.status_code == 200
    assert answer.json()["parts"]["catalogue"] == "ok"
