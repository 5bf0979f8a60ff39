from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from meshtide_server.catalogue import Catalogue, MeshRecord
from meshtide_server.hosted_mesh import Status
from meshtide_server.kept_meshes import KeptMeshes
from meshtide_server.publishing import Publication, publish
from meshtide_server.store import Store, stream_key
from meshtide_server.store.local import LocalStore
from meshtide_server.store.memory import MemoryStore

from .conftest import make_stream


class CountingStore(MemoryStore):
    reads = 0

    async def get(self, key: str) -> bytes:
        self.reads += 1
        return await super().get(key)


@pytest.fixture
async def catalogue(tmp_path: Path) -> AsyncIterator[Catalogue]:
    opened = await Catalogue.open(f"sqlite:///{tmp_path}/catalogue.db")
    yield opened
    await opened.close()


@pytest.fixture(params=["memory", "local"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    return CountingStore() if request.param == "memory" else LocalStore(tmp_path / "store")


def copies(tmp_path: Path) -> list[str]:
    return [path.name for path in (tmp_path / "copies").rglob("*.tide")]


async def test_meshes_come_change_and_go(store: Store, catalogue: Catalogue, tmp_path: Path) -> None:
    kept = KeptMeshes(store, catalogue, tmp_path / "copies")
    await kept.refresh()
    assert kept.meshes == {}
    await publish(store, catalogue, make_stream(1), Publication("a", "a.obj"))
    await catalogue.meshes.add(MeshRecord("b", "b.obj"))
    await kept.refresh()
    first = kept.meshes["a"]
    assert (first.status, kept.meshes["b"].status) == (Status.READY, Status.ENCODING)
    assert first.stream is not None
    with first.stream.open() as opened:
        assert opened.read(0, first.stream.size) == make_stream(1)
    assert len(first.stream.packet_digests) == 6
    await catalogue.meshes.fail("b", "not a mesh")
    await publish(store, catalogue, make_stream(2), Publication("a", "new.obj"))
    await kept.refresh()
    assert kept.meshes["b"].reason == "not a mesh"
    second = kept.meshes["a"]
    assert second.stream is not None
    assert second.stream.fingerprint != first.stream.fingerprint
    await kept.refresh()
    assert kept.meshes["a"] is second
    await catalogue.delete("a")
    await kept.refresh()
    assert set(kept.meshes) == {"b"}
    assert copies(tmp_path) == []


async def test_a_store_is_asked_once_for_each_stream(catalogue: Catalogue, tmp_path: Path) -> None:
    store = CountingStore()
    for identifier in ("a", "b"):
        await publish(store, catalogue, make_stream(), Publication(identifier, identifier))
    for _ in range(2):  # a server that starts again finds its copies
        kept = KeptMeshes(store, catalogue, tmp_path / "copies")
        await kept.refresh()
        await kept.refresh()
        assert all(mesh.status == Status.READY for mesh in kept.meshes.values())
    assert store.reads == 1
    assert len(copies(tmp_path)) == 1


async def test_a_damaged_object_is_not_shown(
    catalogue: Catalogue, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store = MemoryStore()
    mesh = await publish(store, catalogue, make_stream(), Publication("a", "a"))
    await store.put(stream_key(mesh.stream or ""), make_stream(5))
    kept = KeptMeshes(store, catalogue, tmp_path / "copies")
    await kept.refresh()
    assert kept.meshes == {}
    assert "is damaged: its bytes have another SHA-256" in caplog.text


async def test_two_servers_see_each_others_meshes(store: Store, catalogue: Catalogue, tmp_path: Path) -> None:
    second_catalogue = await Catalogue.open(f"sqlite:///{tmp_path}/catalogue.db")
    first = KeptMeshes(store, catalogue, tmp_path / "first")
    second = KeptMeshes(store, second_catalogue, tmp_path / "second")
    await publish(store, first.catalogue, make_stream(), Publication("a", "a"))
    await second.refresh()
    assert set(second.meshes) == {"a"}
    await second.catalogue.delete("a")
    await first.refresh()
    assert first.meshes == {}
    await second.close()
