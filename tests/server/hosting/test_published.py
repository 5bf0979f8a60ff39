import asyncio
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Catalogue, DatabaseUnavailableError, MeshPage, MeshRecord, Status
from meshtide_server.hosting import published as kept_meshes
from meshtide_server.hosting.block_cache import BlockCache
from meshtide_server.hosting.published import PublishedMeshes
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.store import DamagedObjectError, Store, StoreError, stream_key
from meshtide_server.store.local import LocalStore
from meshtide_server.store.memory import MemoryStore

from ..made_streams import make_stream


class CountingStore(MemoryStore):
    reads = 0

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        self.reads += 1
        await asyncio.sleep(0)
        return await super().get_range(key, start, end)


@pytest.fixture(params=["memory", "local"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    return CountingStore() if request.param == "memory" else LocalStore(tmp_path / "store")


def published_of(store: Store, catalogue: Catalogue) -> PublishedMeshes:
    return PublishedMeshes(store, catalogue, BlockCache(1 << 20))


async def whole(kept: PublishedMeshes, mesh_id: str) -> bytes:
    mesh = await kept.find(mesh_id)
    assert mesh is not None
    assert mesh.stream is not None
    with closing(mesh.stream.open()) as opened:
        return await opened.read(0, mesh.stream.size)


async def listed(kept: PublishedMeshes, limit: int = 100, **search: object) -> list[str]:
    page, _ = await kept.page(MeshQuery(**search), {}, limit)  # type: ignore[arg-type]
    return [mesh.id for mesh in page]


async def test_meshes_come_change_and_go(store: Store, catalogue: Catalogue) -> None:
    kept = published_of(store, catalogue)
    assert await listed(kept) == []
    assert await kept.find("a") is None
    await publish(store, catalogue, make_stream(1), Publication("a", "a.obj"))
    await catalogue.meshes.add(MeshRecord("b", "b.obj"))
    assert await listed(kept) == ["a", "b"]
    assert await whole(kept, "a") == make_stream(1)
    first, other = await kept.find("a"), await kept.find("b")
    assert first is not None
    assert other is not None
    assert first.stream is not None
    assert (first.status, other.status, other.stream) == (Status.READY, Status.ENCODING, None)
    assert len(first.stream.packet_digests) == 6
    await kept.refresh()
    same = kept.known("a")
    assert same is not None
    assert same.stream is first.stream
    await catalogue.meshes.fail("b", "not a mesh")
    await publish(store, catalogue, make_stream(2), Publication("a", "new.obj"))
    await kept.refresh()
    assert kept.known("a") is None
    assert await whole(kept, "a") == make_stream(2)
    failed = await kept.find("b")
    assert failed is not None
    assert failed.reason == "not a mesh"
    assert kept.counts == {Status.READY: 1, Status.ENCODING: 0, Status.FAILED: 1}
    await catalogue.delete("a")
    await kept.refresh()
    assert await kept.find("a") is None
    assert await listed(kept) == ["b"]


async def test_one_mesh_is_brought_up_to_date(store: Store, catalogue: Catalogue) -> None:
    kept = published_of(store, catalogue)
    await publish(store, catalogue, make_stream(1), Publication("a", "a.obj"))
    await publish(store, catalogue, make_stream(3), Publication("b", "b.obj"))
    await whole(kept, "a")
    await publish(store, catalogue, make_stream(2), Publication("a", "a.obj"))
    await kept.refresh_mesh("b")  # which is not in memory
    assert await whole(kept, "a") == make_stream(1)
    await kept.refresh_mesh("a")
    assert await whole(kept, "a") == make_stream(2)
    known = kept.known("a")
    await kept.refresh_mesh("a")
    assert known is not None
    assert kept.known("a") is not None


@pytest.mark.parametrize("same_stream", [False, True])
async def test_what_changes_while_it_is_looked_up(
    store: Store, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch, *, same_stream: bool
) -> None:
    kept = published_of(store, catalogue)
    await publish(store, catalogue, make_stream(1), Publication("a", "old.obj"))
    get, go = catalogue.meshes.get, asyncio.Event()

    async def slow(mesh_id: str) -> MeshRecord:
        record = await get(mesh_id)
        await go.wait()
        return record

    monkeypatch.setattr(catalogue.meshes, "get", slow)
    reading = asyncio.create_task(kept.find("a"))
    await asyncio.sleep(0.05)
    await publish(store, catalogue, make_stream(1 if same_stream else 2), Publication("a", "new.obj"))
    await kept.refresh()
    go.set()
    found = await reading
    assert found is not None
    assert found.source.name == "new.obj"
    again = kept.known("a")
    assert again is not None
    assert again.source.name == "new.obj"


async def test_a_stream_that_is_always_gone_is_told(
    store: Store, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    await publish(store, catalogue, make_stream(1), Publication("a", "a.obj"))

    async def nothing(_: str) -> None:
        return None

    monkeypatch.setattr(catalogue.streams, "get", nothing)
    with pytest.raises(StoreError, match="left the catalogue 3 times"):
        await published_of(store, catalogue).find("a")


async def test_a_mesh_that_is_encoded_says_how_far_it_is(store: Store, catalogue: Catalogue) -> None:
    kept = published_of(store, catalogue)
    for mesh_id in ("a", "b"):
        await catalogue.add_with_job(MeshRecord(mesh_id, mesh_id), f"sources/{'0' * 64}.{mesh_id}", {})
    await catalogue.meshes.add(MeshRecord("c", "c"))
    job = await catalogue.jobs.claim("worker")
    assert job is not None
    await catalogue.jobs.heartbeat(job.id, "worker", "levels", 0.25)
    page, _ = await kept.page(MeshQuery(), {}, 10)
    assert [(mesh.stage, mesh.progress) for mesh in page] == [("levels", 0.25), ("waiting", 0.0), ("waiting", 0.0)]
    found = await kept.find("a")
    assert found is not None
    assert "levels, 25%" in found.not_ready_message


async def test_packets_are_found_wherever_they_are_known(store: Store, catalogue: Catalogue) -> None:
    kept = published_of(store, catalogue)
    await publish(store, catalogue, make_stream(1), Publication("a", "a.obj"))
    stream = await catalogue.streams.get((await catalogue.meshes.get("a")).stream or "")
    assert stream is not None
    for position, digest in enumerate(stream.packets):
        place = await kept.find_packet(digest)
        assert place is not None
        assert place.position == position
        assert place.stream.packet_digests == stream.packets
    assert await kept.find_packet(bytes(32)) is None
    await catalogue.delete("a")
    await kept.refresh()
    assert await kept.find_packet(stream.packets[0]) is None


async def test_a_store_is_asked_once_for_all_who_ask(catalogue: Catalogue) -> None:
    store = CountingStore()
    for identifier in ("a", "b"):
        await publish(store, catalogue, make_stream(), Publication(identifier, identifier))
    kept = published_of(store, catalogue)
    store.reads = 0
    streams = await asyncio.gather(*(whole(kept, identifier) for identifier in "ab" * 20))
    assert streams == [make_stream()] * 40
    assert store.reads == 1
    await catalogue.delete("a")
    await catalogue.delete("b")
    await kept.refresh()
    assert kept.cache.held == 0


async def test_the_catalogue_is_asked_once_for_all_who_ask(
    store: Store, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    await publish(store, catalogue, make_stream(), Publication("a", "a"))
    asked = watched(monkeypatch, catalogue)
    kept = published_of(store, catalogue)
    found = await asyncio.gather(*(kept.find("a") for _ in range(100)))
    assert len({id(mesh.stream) for mesh in found if mesh is not None}) == 1
    await kept.find("a")
    for odd in ("../a", "a\x00", "A", "x" * 1000, ""):
        assert await kept.find(odd) is None
    assert asked == ["a"]


def watched(monkeypatch: pytest.MonkeyPatch, catalogue: Catalogue) -> list[str]:
    """The ids that the catalogue is asked for from now on."""
    asked: list[str] = []
    get = catalogue.meshes.get

    async def noted(mesh_id: str) -> MeshRecord:
        asked.append(mesh_id)
        return await get(mesh_id)

    monkeypatch.setattr(catalogue.meshes, "get", noted)
    return asked


async def test_no_more_is_kept_in_memory_than_allowed(
    store: Store, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_meshes, "KNOWN", 3)
    monkeypatch.setattr(kept_meshes, "KNOWN_PACKETS", 12)
    kept = published_of(store, catalogue)
    for number in range(6):
        await publish(store, catalogue, make_stream(number), Publication(f"m{number}", "m"))
    for number in range(6):
        assert await whole(kept, f"m{number}") == make_stream(number)
    known = [number for number in range(6) if kept.known(f"m{number}") is not None]
    assert known == [4, 5]  # six packets each
    assert await whole(kept, "m0") == make_stream(0)
    await kept.refresh()


async def test_pages_leave_out_what_the_folder_has(store: Store, catalogue: Catalogue) -> None:
    kept = published_of(store, catalogue)
    for number in range(7):
        await catalogue.meshes.add(MeshRecord(f"m{number}", "m"))
    page, more = await kept.page(MeshQuery(), {"m0", "m2", "m3"}, 2)
    assert ([mesh.id for mesh in page], more) == (["m1", "m4"], True)
    page, more = await kept.page(MeshQuery(after="m4"), {"m0"}, 2)
    assert ([mesh.id for mesh in page], more) == (["m5", "m6"], False)
    page, more = await kept.page(MeshQuery(), {f"m{number}" for number in range(7)}, 2)
    assert (page, more) == ([], False)


async def test_a_crowd_that_searches_keeps_nobody_from_a_mesh(
    store: Store, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    await publish(store, catalogue, make_stream(), Publication("a", "a"))
    kept = published_of(store, catalogue)
    searching = most = 0
    go = asyncio.Event()
    ask = catalogue.meshes.list

    async def slow(query: MeshQuery, limit: int) -> MeshPage:
        nonlocal searching, most
        searching += 1
        most = max(most, searching)
        await go.wait()
        searching -= 1
        return await ask(query, limit)

    monkeypatch.setattr(catalogue.meshes, "list", slow)
    crowd = [asyncio.create_task(listed(kept)) for _ in range(30)]
    async with asyncio.timeout(10):
        assert await whole(kept, "a") == make_stream()
        await kept.refresh()
        go.set()
        assert await asyncio.gather(*crowd) == [["a"]] * 30
    assert most == kept_meshes.LISTS_AT_A_TIME


async def test_a_damaged_object_is_told(catalogue: Catalogue) -> None:
    store = MemoryStore()
    mesh = await publish(store, catalogue, make_stream(), Publication("a", "a"))
    await store.put(stream_key(mesh.stream or ""), make_stream(5))
    kept = published_of(store, catalogue)
    with pytest.raises(DamagedObjectError, match="is damaged: packet 0"):
        await whole(kept, "a")
    await store.put(stream_key(mesh.stream or ""), make_stream())
    assert await whole(kept, "a") == make_stream()


async def test_a_file_of_another_size_is_told(catalogue: Catalogue, tmp_path: Path) -> None:
    store = LocalStore(tmp_path / "store")
    mesh = await publish(store, catalogue, make_stream(), Publication("a", "a"))
    await store.put(stream_key(mesh.stream or ""), b"short")
    with pytest.raises(DamagedObjectError, match="has 5 bytes, the catalogue knows 7"):
        await published_of(store, catalogue).find("a")
    await store.delete(stream_key(mesh.stream or ""))
    with pytest.raises(DamagedObjectError, match="is gone from the store; publish the mesh again"):
        await published_of(store, catalogue).find("a")


async def test_a_file_that_was_put_anew_is_looked_up_again(catalogue: Catalogue, tmp_path: Path) -> None:
    store = LocalStore(tmp_path / "store")
    kept = published_of(store, catalogue)
    mesh = await publish(store, catalogue, make_stream(), Publication("a", "a"))
    assert await whole(kept, "a") == make_stream()
    await store.put(stream_key(mesh.stream or ""), make_stream())
    await kept.refresh()
    assert await whole(kept, "a") == make_stream()


async def test_what_is_in_memory_is_shown_without_the_catalogue(
    store: Store, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = published_of(store, catalogue)
    await publish(store, catalogue, make_stream(), Publication("a", "a"))
    await whole(kept, "a")

    def broken(*_: object) -> Callable[..., object]:
        raise DatabaseUnavailableError("gone")

    monkeypatch.setattr(catalogue.meshes, "updated", broken)
    monkeypatch.setattr(catalogue.meshes, "get", broken)
    with pytest.raises(DatabaseUnavailableError):
        await kept.refresh()
    assert await whole(kept, "a") == make_stream()
    with pytest.raises(DatabaseUnavailableError):
        await kept.find("b")


async def test_two_servers_see_each_others_meshes(
    store: Store,
    catalogue: Catalogue,
    database_url: str,
) -> None:
    second_catalogue = await Catalogue.open(database_url)
    first, second = published_of(store, catalogue), published_of(store, second_catalogue)
    await publish(store, first.catalogue, make_stream(), Publication("a", "a"))
    assert await listed(second) == ["a"]
    assert await whole(second, "a") == await whole(first, "a") == make_stream()
    await second.catalogue.delete("a")
    assert await listed(first) == []
    await first.refresh()
    assert await first.find("a") is None
    await second_catalogue.close()
