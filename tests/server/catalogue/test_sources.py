"""Who needs which uploaded file, on both databases."""

from __future__ import annotations

import asyncio
import random
from collections.abc import AsyncIterator
from datetime import timedelta

import pytest

from meshtide_server.catalogue import Catalogue, Job, JobState, MeshExistsError, MeshRecord
from meshtide_server.encoding.uploads import receive
from meshtide_server.hosting.collecting import collect_orphans
from meshtide_server.store import ObjectInfo
from meshtide_server.store.memory import MemoryStore

KEY = "sources/a.obj"
NO_TIME = timedelta(0)
LONG = timedelta(hours=1)


async def collected(catalogue: Catalogue, key: str = KEY) -> bool:
    """Whether an object may be deleted now."""
    removed: list[str] = []

    async def remove(found: str) -> None:
        removed.append(found)

    done = await catalogue.sources.collect(key, remove)
    assert removed == ([key] if done else [])
    assert await catalogue.sources.needed([key, "sources/other.obj"]) == (set() if done else {key})
    return done


async def test_a_file_is_needed_until_its_job_has_ended(catalogue: Catalogue) -> None:
    assert await collected(catalogue)
    note = await catalogue.sources.expect(KEY)
    assert not await collected(catalogue)
    await catalogue.add_with_job(MeshRecord("a", "a"), KEY, {}, note=note)
    assert await catalogue.sources.forget_abandoned(NO_TIME) == 0
    for retry in (True, False):
        assert not await collected(catalogue)
        job = await catalogue.jobs.claim("me")
        assert job is not None
        assert not await collected(catalogue)
        await catalogue.jobs.fail(job.id, "me", "a crash", retry=retry)
    assert await collected(catalogue)


async def test_each_upload_of_the_same_bytes_needs_the_file(catalogue: Catalogue) -> None:
    first, second = [await catalogue.sources.expect(KEY) for _ in range(2)]
    _, job = await catalogue.add_with_job(MeshRecord("a", "a"), KEY, {}, note=first)
    await catalogue.jobs.claim("me")
    assert await catalogue.jobs.finish(job.id, "me")
    assert not await collected(catalogue)  # the second one has found it in the store
    with pytest.raises(MeshExistsError):
        await catalogue.add_with_job(MeshRecord("a", "a"), KEY, {}, note=second)
    assert not await collected(catalogue)
    await catalogue.add_with_job(MeshRecord("b", "b"), KEY, {}, note=second)
    await catalogue.delete("b")
    assert await collected(catalogue)


async def test_uploads_that_never_became_jobs_are_given_up(catalogue: Catalogue) -> None:
    await catalogue.sources.expect(KEY)
    assert await catalogue.sources.forget_abandoned(LONG) == 0
    assert not await collected(catalogue)
    assert await catalogue.sources.forget_abandoned(NO_TIME) == 1
    assert await collected(catalogue)


async def test_nothing_is_expected_while_a_file_is_deleted(catalogue: Catalogue) -> None:
    order: list[str] = []

    async def upload() -> None:
        await catalogue.sources.expect(KEY)
        order.append("expected")

    async def remove(_: str) -> None:
        order.append("deleting")
        tasks.append(asyncio.create_task(upload()))
        await asyncio.sleep(0.2)
        order.append("deleted")

    tasks: list[asyncio.Task[None]] = []
    assert await catalogue.sources.collect(KEY, remove)
    await asyncio.gather(*tasks)
    assert order == ["deleting", "deleted", "expected"]


async def test_many_keys_are_asked_for_at_once(catalogue: Catalogue) -> None:
    await catalogue.add_with_job(MeshRecord("a", "a"), "sources/777.obj", {})
    await catalogue.sources.expect("sources/1234.obj")
    found = await catalogue.sources.needed(f"sources/{number}.obj" for number in range(1300))
    assert found == {"sources/777.obj", "sources/1234.obj"}


class SlowStore(MemoryStore):
    """A store that takes its time, so that everything happens in between."""

    async def head(self, key: str) -> ObjectInfo:
        await asyncio.sleep(0.002)
        return await super().head(key)

    async def delete(self, key: str) -> None:
        await asyncio.sleep(0.002)
        await super().delete(key)


class Traffic:
    """Uploads of the same few files, workers, and the search for orphans, each of whom may die at any step."""

    def __init__(self, catalogue: Catalogue, seed: int) -> None:
        self.catalogue = catalogue
        self.store = SlowStore()
        self.pick = random.Random(seed)
        self.uploading = True
        self.attempts = 0

    async def upload(self, first: int) -> None:
        for number in range(first, first + 10):
            received = await receive(self.body(), ".obj", self.store, self.catalogue, limit=10, stall_seconds=5.0)
            if self.pick.random() < 0.8:  # else killed before it was acknowledged
                mesh, options = MeshRecord(f"m{number}", "a"), {"bits": number}
                await self.catalogue.add_with_job(mesh, received.key, options, note=received.note)

    async def body(self) -> AsyncIterator[bytes]:
        yield self.pick.choice((b"one", b"two", b"three"))

    async def work(self, owner: str) -> None:
        while True:
            job = await self.catalogue.jobs.claim(owner)
            if job is not None:
                await self.attempt(job, owner)
            elif not self.uploading:
                return
            await asyncio.sleep(0.005)

    async def attempt(self, job: Job, owner: str) -> None:
        assert await self.store.get(job.source_key)
        if self.pick.random() < 0.3:
            await self.catalogue.jobs.fail(job.id, owner, "a crash", retry=self.pick.random() < 0.5)
        else:
            await self.catalogue.jobs.finish(job.id, owner)
        self.attempts += 1
        if self.pick.random() < 0.7:  # else killed before it could
            await self.catalogue.sources.collect(job.source_key, self.store.delete)

    async def sweep(self) -> None:
        while self.uploading:
            await collect_orphans(self.store, self.catalogue, LONG)
            await asyncio.sleep(0.01)


@pytest.mark.parametrize("seed", [1, 2])
async def test_no_job_ever_misses_its_file_whoever_dies_when(catalogue: Catalogue, seed: int) -> None:
    traffic = Traffic(catalogue, seed)
    others = asyncio.gather(*(traffic.work(f"worker {number}") for number in range(3)), traffic.sweep())
    await asyncio.gather(*(traffic.upload(100 * turn) for turn in range(3)))
    traffic.uploading = False
    await others
    assert traffic.attempts > 10
    assert not (await catalogue.jobs.counts())[JobState.QUEUED]
    await collect_orphans(traffic.store, catalogue, NO_TIME)
    assert [info.key async for info in traffic.store.list()] == []
