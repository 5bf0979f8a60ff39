import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from meshtide_server.catalogue import Catalogue, MeshRecord
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.settings import Settings
from meshtide_server.store import open_store

from ...conftest import LiveServer, running
from ...made_streams import make_stream

TOKEN = "a-token-of-these-tests"  # noqa: S105 - of a server that the tests start
WRITER = {"Authorization": f"Bearer {TOKEN}"}


@pytest.fixture
def live(tmp_path: Path, folder: Path) -> Iterator[LiveServer]:
    """A server that has "small" in its folder, "vase" published, and "slow" waiting for its job."""
    settings = Settings.model_validate(
        {
            "directory": folder,
            "data": tmp_path / "data",
            "write_tokens": TOKEN,
            "rescan_seconds": 0,
            "catalogue_seconds": 60,
        }
    )

    async def fill() -> None:
        catalogue = await Catalogue.open(settings.database_url)
        publication = Publication("vase", "vase.obj", ("clay", "scan"), "all rights reserved")
        await publish(open_store(settings.store_url), catalogue, make_stream(3), publication)
        await catalogue.meshes.add(MeshRecord("slow", "slow.obj", ("scan",)))
        await catalogue.close()

    asyncio.run(fill())
    with running(settings) as server:
        yield server


def change(live: LiveServer, mesh: str, headers: dict[str, str] = WRITER, **told: object) -> httpx.Response:
    return httpx.patch(f"{live.url}/meshes/{mesh}", json=told, headers=headers)


def test_a_change_is_seen_at_once_and_leaves_the_stream_alone(live: LiveServer) -> None:
    before = httpx.get(f"{live.url}/meshes/vase")
    file = httpx.get(f"{live.url}/meshes/vase.tide")
    answer = change(live, "vase", tags=["scan", "amphora", "scan"], licence="CC BY 4.0")
    assert answer.status_code == 200, answer.text
    assert (answer.json()["tags"], answer.json()["licence"]) == (["amphora", "scan"], "CC BY 4.0")
    assert (answer.json()["name"], answer.json()["vertices"]) == ("vase.obj", 1600)
    after = httpx.get(f"{live.url}/meshes/vase", headers={"If-None-Match": before.headers["etag"]})
    assert (after.json()["tags"], after.json()["licence"]) == (["amphora", "scan"], "CC BY 4.0")
    assert after.json()["created"] == before.json()["created"]
    assert after.json()["updated"] > before.json()["updated"]
    held = {"If-None-Match": file.headers["etag"]}
    assert httpx.get(f"{live.url}/meshes/vase.tide", headers=held).status_code == 304
    listed = httpx.get(f"{live.url}/meshes", params={"tag": "amphora", "licence": "by"}).json()
    assert [mesh["id"] for mesh in listed] == ["vase"]
    assert change(live, "vase", tags=[], name="Vase").json()["tags"] == []
    assert httpx.get(f"{live.url}/meshes/vase").json()["name"] == "Vase"


def test_what_cannot_be_changed_is_told(live: LiveServer) -> None:
    assert change(live, "vase", {}, name="x").status_code == 401
    for mesh, status, code in (
        ("nothing", 404, "unknown-mesh"),
        ("small", 409, "folder-mesh"),
        ("slow", 409, "encoding"),
    ):
        answer = change(live, mesh, name="x")
        assert (answer.status_code, answer.json()["error"]) == (status, code)


ODD_CHANGES: tuple[dict[str, object], ...] = (
    {},
    {"name": ""},
    {"name": "a\x00"},
    {"name": "x" * 201},
    {"tags": ["x" * 101]},
    {"tags": ["a"] * 51},
    {"tags": "a"},
    {"licence": "\x00"},
    {"licence": "x" * 20_001},
    {"id": "other"},
    {"size": 3},
)


def test_odd_changes_are_refused(live: LiveServer) -> None:
    for told in ODD_CHANGES:
        answer = change(live, "vase", **told)
        assert (answer.status_code, answer.json()["error"]) == (422, "invalid"), told


def test_tags_are_listed(live: LiveServer, serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    answer = httpx.get(f"{live.url}/tags")
    assert answer.json() == [{"tag": "scan", "meshes": 2}, {"tag": "clay", "meshes": 1}]
    assert httpx.get(f"{live.url}/tags", params={"limit": 1}).json() == [{"tag": "scan", "meshes": 2}]
    held = {"If-None-Match": answer.headers["etag"]}
    assert httpx.get(f"{live.url}/tags", headers=held).status_code == 304
    assert httpx.get(f"{live.url}/tags", params={"limit": 0}).status_code == 422
    alone = serve(Settings(directory=folder, rescan_seconds=0))
    assert httpx.get(f"{alone.url}/tags").json() == []
    assert change(alone, "small", name="x").status_code in {401, 403}
