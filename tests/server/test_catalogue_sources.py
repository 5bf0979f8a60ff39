"""Who needs which uploaded file, on both databases."""

from __future__ import annotations

import asyncio
from datetime import timedelta

import pytest

from meshtide_server.catalogue import Catalogue, MeshExistsError, MeshRecord

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
