from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from meshtide_codec.errors import StreamError
from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Box, Catalogue, JobState, MeshExistsError, MeshRecord, Status, UnknownMeshError
from meshtide_server.hosting.collecting import collect_unused
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.store import Store, StoreError, stream_key
from meshtide_server.store.local import LocalStore
from meshtide_server.store.memory import MemoryStore

from ..made_streams import make_stream

BUNNY = Publication("bunny", "bunny.obj", ("scan", "animal", "scan"), "CC0", "ab" * 32)


@pytest.fixture
def database_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/catalogue.db"


@pytest.fixture(params=["memory", "local"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    return MemoryStore() if request.param == "memory" else LocalStore(tmp_path / "store")


async def keys(store: Store) -> list[str]:
    return [info.key async for info in store.list()]


@pytest.mark.parametrize("as_file", [False, True])
async def test_a_published_stream_is_kept_and_described(
    store: Store, catalogue: Catalogue, tmp_path: Path, as_file: bool
) -> None:
    data = make_stream()
    (tmp_path / "bunny.tide").write_bytes(data)
    mesh = await publish(store, catalogue, tmp_path / "bunny.tide" if as_file else data, BUNNY)
    assert mesh == await catalogue.meshes.get("bunny")
    assert (mesh.state, mesh.size, mesh.vertices, mesh.faces, mesh.levels) == (
        Status.READY,
        len(data),
        1600,
        3196,
        3,
    )
    assert (mesh.tags, mesh.licence, mesh.source) == (("animal", "scan"), "CC0", "ab" * 32)
    assert mesh.box == Box((0.0, -1.0, 0.5), (2.0, 1.0, 2.5))
    assert await store.get(stream_key(mesh.stream or "")) == data
    location = await catalogue.streams.find_packet((await packets(catalogue, mesh))[3].hex())
    assert location is not None
    assert len(await store.get_range(stream_key(location.stream), location.offset, location.offset + location.length))


async def packets(catalogue: Catalogue, mesh: MeshRecord) -> tuple[bytes, ...]:
    record = await catalogue.streams.get(mesh.stream or "")
    assert record is not None
    return record.packets


@pytest.mark.parametrize("data", [b"", b"hello", make_stream()[:-1], make_stream() + b"x"])
async def test_what_is_no_whole_stream_leaves_nothing(store: Store, catalogue: Catalogue, data: bytes) -> None:
    with pytest.raises(StreamError):
        await publish(store, catalogue, data, BUNNY)
    assert await keys(store) == []
    assert (await catalogue.meshes.list(MeshQuery())).meshes == ()


async def test_meshes_share_a_stream_until_the_last_is_gone(store: Store, catalogue: Catalogue) -> None:
    data = make_stream()
    await publish(store, catalogue, data, BUNNY)
    await publish(store, catalogue, data, replace(BUNNY, id="copy"))
    assert len(await keys(store)) == 1
    await catalogue.delete("bunny")
    assert await collect_unused(store, catalogue) == []
    await catalogue.delete("copy")
    assert await collect_unused(store, catalogue) == []  # not yet: a download may still run
    assert len(await keys(store)) == 1
    await catalogue.collect(lambda sha256: store.delete(stream_key(sha256)), timedelta(0))
    assert await keys(store) == []


async def test_ids_are_replaced_only_on_demand(store: Store, catalogue: Catalogue) -> None:
    first = await publish(store, catalogue, make_stream(1), BUNNY)
    with pytest.raises(MeshExistsError):
        await publish(store, catalogue, make_stream(2), BUNNY, overwrite=False)
    assert (await catalogue.meshes.get("bunny")).stream == first.stream
    second = await publish(store, catalogue, make_stream(2), BUNNY)
    assert second.stream != first.stream
    assert second.created == first.created


async def test_a_crash_after_the_put_shows_nothing_and_can_be_repeated(catalogue: Catalogue) -> None:
    class Crashing(MemoryStore):
        async def head(self, key: str) -> object:  # type: ignore[override]
            if self._objects:
                raise StoreError("the cable is cut")
            return await super().head(key)

    crashing = Crashing()
    with pytest.raises(StoreError, match="cable"):
        await publish(crashing, catalogue, make_stream(), BUNNY)
    assert len(await keys(crashing)) == 1
    with pytest.raises(UnknownMeshError):
        await catalogue.meshes.get("bunny")
    assert len(await catalogue.streams.unused(timedelta(0))) == 1
    sound = MemoryStore()
    sound._objects = crashing._objects
    await publish(sound, catalogue, make_stream(), BUNNY)
    assert await catalogue.streams.unused(timedelta(0)) == []


async def test_an_object_that_vanishes_each_time_is_told(catalogue: Catalogue) -> None:
    class Forgetful(MemoryStore):
        async def put(self, key: str, data: object) -> object:  # type: ignore[override]
            return key, data

    with pytest.raises(StoreError, match="was put 3 times and is not there"):
        await publish(Forgetful(), catalogue, make_stream(), BUNNY)


async def test_a_job_is_done_with_its_mesh(store: Store, catalogue: Catalogue) -> None:
    _, job = await catalogue.add_with_job(MeshRecord("bunny", "bunny.obj"), "sources/bunny.obj", {})
    await catalogue.jobs.claim("me")
    await publish(store, catalogue, make_stream(), BUNNY, job=(job.id, "me"))
    assert (await catalogue.jobs.get(job.id)).state == JobState.DONE
    with pytest.raises(UnknownMeshError):
        await publish(store, catalogue, make_stream(), BUNNY, job=(job.id, "me"))
