"""Uploads on their way into the store, and out of it again."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import AsyncIterator
from datetime import timedelta
from pathlib import Path

import pytest

from meshtide_server.catalogue import Catalogue, MeshRecord
from meshtide_server.encoding.uploads import Upload, checked_suffix, receive
from meshtide_server.hosting.collecting import collect_orphans
from meshtide_server.refusals import RefusedError
from meshtide_server.store import MissingObjectError
from meshtide_server.store.memory import MemoryStore

NO_TIME = timedelta(0)
DATA = b"solid"
KEY = f"sources/{hashlib.sha256(DATA).hexdigest()}.stl"


@pytest.fixture
def database_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/catalogue.db"


@pytest.fixture
def store() -> MemoryStore:
    return MemoryStore()


async def body(*pieces: bytes, pause: float = 0.0) -> AsyncIterator[bytes]:
    for piece in pieces:
        await asyncio.sleep(pause)
        yield piece


async def take(store: MemoryStore, catalogue: Catalogue, pieces: AsyncIterator[bytes], limit: int = 100) -> Upload:
    return await receive(pieces, ".stl", store, catalogue, limit=limit, stall_seconds=0.2)


async def keys(store: MemoryStore) -> list[str]:
    return [info.key async for info in store.list()]


async def test_a_body_becomes_an_object_named_by_its_bytes(store: MemoryStore, catalogue: Catalogue) -> None:
    upload = await take(store, catalogue, body(b"so", b"", b"lid", pause=0.1))  # slow, but never for too long
    assert (upload.key, upload.sha256, upload.size) == (KEY, hashlib.sha256(DATA).hexdigest(), 5)
    assert await store.get(KEY) == DATA
    assert await catalogue.sources.needed([KEY]) == {KEY}
    again = await take(store, catalogue, body(DATA))
    assert again.key == KEY
    assert again.note != upload.note


@pytest.mark.parametrize(
    ("pieces", "status", "code"),
    [((b"x" * 60, b"x" * 41), 413, "too-large"), ((), 400, "empty"), ((b"", b""), 400, "empty")],
)
async def test_what_is_refused_leaves_nothing(
    store: MemoryStore, catalogue: Catalogue, pieces: tuple[bytes, ...], status: int, code: str
) -> None:
    with pytest.raises(RefusedError) as refusal:
        await take(store, catalogue, body(*pieces))
    assert (refusal.value.status, refusal.value.code) == (status, code)
    assert await keys(store) == []
    assert await catalogue.sources.forget_abandoned(NO_TIME) == 0


async def test_an_upload_that_stands_still_is_refused(store: MemoryStore, catalogue: Catalogue) -> None:
    with pytest.raises(RefusedError, match=r"nothing of the upload came for 0\.2 s") as refusal:
        await take(store, catalogue, body(DATA, DATA, pause=0.5))
    assert (refusal.value.status, refusal.value.code) == (408, "stalled")
    assert refusal.value.headers["Connection"] == "close"
    assert await keys(store) == []
    assert await catalogue.sources.forget_abandoned(NO_TIME) == 0


def test_formats_of_several_files_and_of_none_are_refused() -> None:
    assert checked_suffix("a.b.OBJ") == ".obj"
    assert checked_suffix("a.b.OBJ.GZ") == ".obj.gz"
    for name in ("a.gltf", "a.gltf.gz", "a.tide.gz", "a.gz", "a.ply.gz.gz", "a.exe", "a", ".obj/", "obj"):
        with pytest.raises(RefusedError) as refusal:
            checked_suffix(name)
        assert refusal.value.status == 415


async def test_bytes_that_are_uploaded_again_while_they_are_deleted_are_there(
    store: MemoryStore, catalogue: Catalogue
) -> None:
    first = await take(store, catalogue, body(DATA))
    _, job = await catalogue.add_with_job(MeshRecord("a", "a"), first.key, {}, note=first.note)
    await catalogue.jobs.claim("me")
    await catalogue.jobs.finish(job.id, "me")
    again: list[asyncio.Task[Upload]] = []

    async def remove(key: str) -> None:
        again.append(asyncio.create_task(take(store, catalogue, body(DATA))))
        await asyncio.sleep(0.1)  # time enough to find the object, if nothing kept the upload from it
        await store.delete(key)

    assert await catalogue.sources.collect(KEY, remove)
    second = await again[0]
    assert await store.get(second.key) == DATA
    assert not await catalogue.sources.collect(KEY, store.delete)
    await catalogue.add_with_job(MeshRecord("b", "b"), second.key, {}, note=second.note)
    assert await collect_orphans(store, catalogue, NO_TIME) == []
    assert await store.get(KEY) == DATA


async def test_what_a_killed_server_leaves_is_found_later(store: MemoryStore, catalogue: Catalogue) -> None:
    upload = await take(store, catalogue, body(DATA))  # killed between this and the next step
    assert await collect_orphans(store, catalogue) == []  # it may still be on its way
    assert await collect_orphans(store, catalogue, NO_TIME) == [KEY]
    with pytest.raises(MissingObjectError):
        await store.head(KEY)

    upload = await take(store, catalogue, body(DATA))
    _, job = await catalogue.add_with_job(MeshRecord("a", "a"), upload.key, {}, note=upload.note)
    await store.put("streams/other.tide", b"stays")
    await catalogue.jobs.claim("me")
    assert await collect_orphans(store, catalogue, NO_TIME) == []
    await catalogue.jobs.finish(job.id, "me")  # killed between this and the deletion
    assert await collect_orphans(store, catalogue) == [KEY]
    assert await keys(store) == ["streams/other.tide"]
