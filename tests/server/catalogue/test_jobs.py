import asyncio
import sys
from contextlib import suppress
from datetime import timedelta

import pytest

from meshtide_codec.printable import LONGEST_TEXT
from meshtide_server.catalogue import (
    Catalogue,
    Job,
    JobState,
    MeshExistsError,
    MeshRecord,
    Status,
    UnknownJobError,
    UnknownMeshError,
)
from meshtide_server.catalogue.jobs import MOST_NOTES
from meshtide_server.catalogue.rows import UNFINISHED

NO_TIME = timedelta(0)


async def queued(catalogue: Catalogue, mesh_id: str = "a") -> Job:
    return (await catalogue.add_with_job(MeshRecord(mesh_id, mesh_id), f"sources/{mesh_id}.obj", {"bits": 12}))[1]


async def test_the_life_of_a_job(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    assert (job.state, job.attempts, job.options, job.source_key) == (JobState.QUEUED, 0, {"bits": 12}, "sources/a.obj")
    claimed = await catalogue.jobs.claim("me")
    assert claimed is not None
    assert (claimed.id, claimed.state, claimed.owner, claimed.attempts) == (job.id, JobState.RUNNING, "me", 1)
    assert await catalogue.jobs.claim("you") is None
    assert await catalogue.jobs.heartbeat(job.id, "me", "levels", 0.5)
    assert not await catalogue.jobs.heartbeat(job.id, "you", "levels", 0.9)
    now = await catalogue.jobs.get(job.id)
    assert (now.stage, now.progress) == ("levels", 0.5)
    assert not await catalogue.jobs.finish(job.id, "you")
    assert await catalogue.jobs.finish(job.id, "me")
    done = await catalogue.jobs.get(job.id)
    assert (done.state, done.progress, done.owner) == (JobState.DONE, 1.0, None)
    assert done.finished is not None
    assert not await catalogue.jobs.heartbeat(job.id, "me", "late", 0.1)


async def test_notes_of_a_file_are_kept_within_bounds_by_the_owner(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    assert job.notes == ()
    await catalogue.jobs.claim("me")
    assert not await catalogue.jobs.note(job.id, "you", ["late"])
    assert await catalogue.jobs.note(job.id, "me", ["normals (3): not kept", "\x1b[31m"])
    assert (await catalogue.jobs.get(job.id)).notes == ("normals (3): not kept", r"\x1b[31m")
    assert await catalogue.jobs.note(job.id, "me", [f"{number:5000}" for number in range(MOST_NOTES + 3)])
    notes = (await catalogue.jobs.get(job.id)).notes
    assert (len(notes), notes[-1]) == (MOST_NOTES + 1, "and 3 more")
    assert max(map(len, notes)) <= LONGEST_TEXT


async def test_a_job_is_tried_twice(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    for attempt, state in ((1, JobState.QUEUED), (2, JobState.FAILED)):
        await catalogue.jobs.claim("me")
        failed = await catalogue.jobs.fail(job.id, "me", f"crash {attempt}")
        assert failed is not None
        assert (failed.state, failed.error, failed.attempts) == (state, f"crash {attempt}", attempt)
    assert await catalogue.jobs.claim("me") is None
    mesh = await catalogue.meshes.get("a")
    assert (mesh.state, mesh.reason) == (Status.FAILED, "crash 2")


async def test_a_job_that_cannot_go_better_is_not_tried_again(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    await catalogue.jobs.claim("me")
    assert await catalogue.jobs.fail(job.id, "you", "not mine") is None
    failed = await catalogue.jobs.fail(job.id, "me", "not a mesh", retry=False)
    assert failed is not None
    assert failed.state == JobState.FAILED


async def test_jobs_of_lost_owners_are_released(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    await catalogue.jobs.claim("lost")
    assert await catalogue.jobs.release_lost(timedelta(minutes=1)) == []
    (released,) = await catalogue.jobs.release_lost(NO_TIME)
    assert (released.id, released.state) == (job.id, JobState.QUEUED)
    assert "worker lost was not heard of" in (released.error or "")
    assert not await catalogue.jobs.finish(job.id, "lost")
    await catalogue.jobs.claim("lost too")
    (failed,) = await catalogue.jobs.release_lost(NO_TIME)
    assert failed.state == JobState.FAILED
    assert (await catalogue.meshes.get("a")).state == Status.FAILED


async def test_jobs_are_taken_in_their_order_and_listed_in_reverse(catalogue: Catalogue) -> None:
    jobs = [await queued(catalogue, f"m{number}") for number in range(4)]
    taken = [await catalogue.jobs.claim("me") for _ in range(2)]
    assert [job.id for job in taken if job] == [job.id for job in jobs[:2]]
    assert [job.mesh_id for job in await catalogue.jobs.list()] == ["m3", "m2", "m1", "m0"]
    assert [job.mesh_id for job in await catalogue.jobs.list(state=JobState.QUEUED, limit=1)] == ["m3"]
    assert [job.mesh_id for job in await catalogue.jobs.list(mesh_id="m1")] == ["m1"]
    assert await catalogue.jobs.counts() == {
        JobState.QUEUED: 2,
        JobState.RUNNING: 2,
        JobState.DONE: 0,
        JobState.FAILED: 0,
    }


async def test_jobs_go_with_their_meshes(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    await catalogue.jobs.claim("me")
    await catalogue.delete("a")
    assert not await catalogue.jobs.heartbeat(job.id, "me", "levels", 0.5)
    with pytest.raises(UnknownJobError, match="there is no job"):
        await catalogue.jobs.get(job.id)


async def test_a_mesh_is_replaced_only_on_demand(catalogue: Catalogue) -> None:
    first = await queued(catalogue)
    await catalogue.jobs.claim("me")
    with pytest.raises(MeshExistsError):
        await queued(catalogue)
    await catalogue.add_with_job(MeshRecord("a", "new"), "sources/b.obj", {}, replace=True)
    assert (await catalogue.meshes.get("a")).name == "new"
    assert len(await catalogue.jobs.list(mesh_id="a")) == 2
    replaced = await catalogue.jobs.get(first.id)
    assert (replaced.state, replaced.error) == (JobState.FAILED, "a later upload under the same id replaced it")
    assert not await catalogue.jobs.heartbeat(first.id, "me", "levels", 0.5)
    claimed = await catalogue.jobs.claim("me")
    assert claimed is not None
    assert claimed.source_key == "sources/b.obj"
    assert (await catalogue.meshes.get("a")).state == Status.ENCODING


async def test_jobs_for_one_file_wait_for_each_other(catalogue: Catalogue) -> None:
    for mesh_id, bits in (("a", 12), ("b", 12), ("c", 10)):
        await catalogue.add_with_job(MeshRecord(mesh_id, mesh_id), "sources/same.obj", {"bits": bits})
    claimed = [await catalogue.jobs.claim("me") for _ in range(3)]
    assert [job and job.mesh_id for job in claimed] == ["a", "c", None]
    assert claimed[0] is not None
    assert await catalogue.jobs.finish(claimed[0].id, "me")
    twin = await catalogue.jobs.claim("you")
    assert twin is not None
    assert twin.mesh_id == "b"


async def test_an_owner_who_ends_hands_back_all_its_jobs(catalogue: Catalogue) -> None:
    for mesh_id in "abc":
        await queued(catalogue, mesh_id)
    mine = [await catalogue.jobs.claim("me") for _ in range(2)]
    other = await catalogue.jobs.claim("you")
    assert other is not None
    assert await catalogue.jobs.hand_back_all("me") == len(mine)
    assert await catalogue.jobs.hand_back_all("me") == 0
    assert (await catalogue.jobs.get(other.id)).state == JobState.RUNNING
    for job in mine:
        assert job is not None
        back = await catalogue.jobs.get(job.id)
        assert (back.state, back.attempts, back.owner) == (JobState.QUEUED, 0, None)


async def test_concurrent_claimers_share_the_jobs(catalogue: Catalogue) -> None:
    expected = {(await queued(catalogue, f"m{number}")).id for number in range(30)}

    async def work(owner: str) -> list[str]:
        mine: list[str] = []
        while job := await catalogue.jobs.claim(owner):
            mine.append(job.id)
            assert await catalogue.jobs.finish(job.id, owner)
        return mine

    shares = await asyncio.gather(*(work(f"worker {number}") for number in range(6)))
    taken = [job for share in shares for job in share]
    assert len(taken) == len(expected)
    assert set(taken) == expected


CLAIMER = """
import asyncio, sys
from meshtide_server.catalogue import Catalogue

async def work():
    catalogue = await Catalogue.open(sys.argv[1])
    while job := await catalogue.jobs.claim(sys.argv[2]):
        print(job.id)
    await catalogue.close()

asyncio.run(work())
"""


async def test_claimers_of_several_processes_share_the_jobs(catalogue: Catalogue, database_url: str) -> None:
    expected = {(await queued(catalogue, f"m{number}")).id for number in range(20)}
    claimers = [
        await asyncio.create_subprocess_exec(
            sys.executable, "-c", CLAIMER, database_url, f"process {number}", stdout=asyncio.subprocess.PIPE
        )
        for number in range(2)
    ]
    shares = [(await claimer.communicate())[0].decode().split() for claimer in claimers]
    taken = [job for share in shares for job in share]
    assert len(taken) == len(expected)
    assert set(taken) == expected


async def test_a_job_that_is_handed_back_has_lost_no_attempt(catalogue: Catalogue) -> None:
    job = await queued(catalogue)
    for _ in range(3):
        assert (await catalogue.jobs.claim("me")) is not None
        assert not await catalogue.jobs.hand_back(job.id, "you")
        assert await catalogue.jobs.hand_back(job.id, "me")
        again = await catalogue.jobs.get(job.id)
        assert (again.state, again.owner, again.attempts) == (JobState.QUEUED, None, 0)
    assert not await catalogue.jobs.hand_back(job.id, "me")


async def test_replacing_deleting_failing_and_losing_jobs_at_once_gets_in_nobodys_way(catalogue: Catalogue) -> None:
    stop = asyncio.Event()

    async def replace(number: int) -> None:
        for _ in range(25):
            await catalogue.add_with_job(MeshRecord("a", "a"), f"sources/{number}.obj", {}, replace=True)

    async def delete() -> None:
        while not stop.is_set():
            with suppress(UnknownMeshError):
                await catalogue.delete("a")
            await asyncio.sleep(0.005)

    async def work(owner: str) -> None:
        while not stop.is_set():
            job = await catalogue.jobs.claim(owner)
            if job is not None:
                await catalogue.jobs.fail(job.id, owner, "a crash", retry=False)
            await catalogue.jobs.release_lost(NO_TIME)
            await asyncio.sleep(0)

    others = asyncio.gather(delete(), work("me"), work("you"))
    await asyncio.gather(*(replace(number) for number in range(3)))
    stop.set()
    await others
    live = [job for job in await catalogue.jobs.list(mesh_id="a", limit=1000) if job.state in UNFINISHED]
    assert len(live) <= 1


async def test_of_uploads_under_one_id_at_once_one_job_is_left(catalogue: Catalogue) -> None:
    for _ in range(5):
        await asyncio.gather(
            *(
                catalogue.add_with_job(MeshRecord("a", "a"), f"sources/{number}.obj", {}, replace=True)
                for number in range(6)
            )
        )
        jobs = await catalogue.jobs.list(mesh_id="a", state=JobState.QUEUED)
        assert len(jobs) == 1
