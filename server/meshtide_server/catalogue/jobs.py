"""Jobs in the catalogue: a queue that many workers on many machines take from, each job taken by one of them.

A worker claims a job, sends heartbeats with its progress, and finishes or fails it. A job whose worker is not heard of
any more is released. A job that failed or was lost is tried once more, then it has failed, and its mesh with it.

Claims lock the row that they take and skip those that others hold (PostgreSQL: FOR UPDATE SKIP LOCKED); on SQLite, a
transaction that writes has the database to itself. What changes both a job and its mesh locks the job first, so that no
two transactions wait for each other.
"""

from __future__ import annotations

import json
import uuid
from typing import TYPE_CHECKING, Any

from sqlalchemy import and_, exists, func, insert, select, update

from meshtide_codec.printable import printable
from meshtide_server.catalogue.errors import UnknownJobError
from meshtide_server.catalogue.meshes import fail_mesh, get_mesh, micros, moment
from meshtide_server.catalogue.rows import UNFINISHED, Job, JobState, MeshDescription, now
from meshtide_server.catalogue.tables import job_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from datetime import timedelta

    from sqlalchemy import ColumnElement, RowMapping
    from sqlalchemy.ext.asyncio import AsyncConnection

    from meshtide_server.catalogue.database import Database

ATTEMPTS = 2
"""How often a job is begun at most."""
MOST_NOTES = 20
"""Lines that are kept of what was noted of a file."""
_NOT_BEGUN: dict[str, Any] = {
    "state": JobState.QUEUED.value,
    "attempts": job_table.c.attempts - 1,
    "owner": None,
    "heartbeat": None,
    "stage": "waiting",
    "progress": 0.0,
}


class Jobs:
    """The jobs of a catalogue.

    Every method may raise `DatabaseUnavailableError`.

    Args:
        database: of them.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    async def get(self, job_id: str) -> Job:
        """The job of that id.

        Raises:
            UnknownJobError: there is none; jobs go with their meshes.
        """
        async with self._database.reading() as connection:
            return await _get(connection, job_id)

    async def list(self, *, mesh_id: str | None = None, state: JobState | None = None, limit: int = 100) -> list[Job]:
        """Jobs, the newest first; those of a mesh, those in a state."""
        conditions: list[ColumnElement[bool]] = []
        if mesh_id is not None:
            conditions.append(job_table.c.mesh_id == mesh_id)
        if state is not None:
            conditions.append(job_table.c.state == state.value)
        statement = select(job_table).where(and_(True, *conditions))
        async with self._database.reading() as connection:
            ordered = statement.order_by(job_table.c.created.desc(), job_table.c.id).limit(limit)
            return [_job(row) for row in (await connection.execute(ordered)).mappings()]

    async def progress(self, mesh_ids: Sequence[str]) -> dict[str, tuple[str, float]]:
        """What is being done for each of these meshes that waits or is encoded, and the fraction of it that is done."""
        columns = (job_table.c.mesh_id, job_table.c.stage, job_table.c.progress)
        unfinished = job_table.c.state.in_([JobState.QUEUED.value, JobState.RUNNING.value])
        statement = select(*columns).where(and_(job_table.c.mesh_id.in_(mesh_ids), unfinished))
        async with self._database.reading() as connection:
            return {mesh_id: (stage, done) for mesh_id, stage, done in (await connection.execute(statement)).all()}

    async def counts(self) -> dict[JobState, int]:
        """How many jobs are in which state."""
        async with self._database.reading() as connection:
            rows = await connection.execute(select(job_table.c.state, func.count()).group_by(job_table.c.state))
            counts = dict.fromkeys(JobState, 0)
            counts.update({JobState(state): number for state, number in rows.all()})
        return counts

    async def claim(self, owner: str) -> Job | None:
        """Take the job that has waited longest; nobody else gets it. None if none waits.

        A job for the same file with the same options as one that runs waits for it: its stream will serve both.

        Args:
            owner: who takes it, a name that no other worker has.
        """
        twin = job_table.alias()
        running = and_(twin.c.state == JobState.RUNNING.value, twin.c.source_key == job_table.c.source_key)
        waiting = (
            select(job_table.c.id)
            .where(job_table.c.state == JobState.QUEUED.value)
            .where(~exists().where(and_(running, twin.c.options == job_table.c.options)))
            .order_by(job_table.c.created, job_table.c.id)
            .limit(1)
            .with_for_update(skip_locked=True)
        )
        async with self._database.writing() as connection:
            job_id = (await connection.execute(waiting)).scalar()
            if job_id is None:
                return None
            values = {
                "state": JobState.RUNNING.value,
                "attempts": job_table.c.attempts + 1,
                "owner": owner,
                "heartbeat": micros(now()),
                "stage": "starting",
                "progress": 0.0,
            }
            await connection.execute(update(job_table).where(job_table.c.id == job_id).values(**values))
            return await _get(connection, job_id)

    async def heartbeat(self, job_id: str, owner: str, stage: str, progress: float) -> bool:
        """Report that the owner works on a job, and how far it is.

        Returns:
            Whether the job is still the owner's; if not, it was released or its mesh deleted: stop working on it.
        """
        values = {"heartbeat": micros(now()), "stage": stage, "progress": min(max(progress, 0.0), 1.0)}
        async with self._database.writing() as connection:
            return await _update_owned(connection, job_id, owner, values)

    async def note(self, job_id: str, owner: str, notes: Sequence[str]) -> bool:
        """Keep what whoever sent the file should know of it, in place of what was noted before.

        Args:
            job_id: the job.
            owner: who works on it.
            notes: lines; no more than `MOST_NOTES` are kept, and one that counts the rest.

        Returns:
            Whether the job was the owner's; if not, nothing was noted.
        """
        kept = [printable(note) for note in notes[:MOST_NOTES]]
        if len(notes) > MOST_NOTES:
            kept.append(f"and {len(notes) - MOST_NOTES} more")
        async with self._database.writing() as connection:
            return await _update_owned(connection, job_id, owner, {"notes": json.dumps(kept)})

    async def finish(self, job_id: str, owner: str) -> bool:
        """Note that a job is done.

        Returns:
            Whether it was the owner's; if not, nothing was noted.
        """
        async with self._database.writing() as connection:
            return await finish_job(connection, job_id, owner)

    async def fail(self, job_id: str, owner: str, error: str, *, retry: bool = True) -> Job | None:
        """Note that an attempt has failed: the job is queued again, or has failed for good, and its mesh with it.

        Args:
            job_id: the job.
            owner: who worked on it.
            error: why it failed.
            retry: whether another attempt may go better.

        Returns:
            The job as it is now; None if it was not the owner's, and nothing was noted.
        """
        async with self._database.writing() as connection:
            mine = and_(job_table.c.id == job_id, _owned_by(owner))
            row = (await connection.execute(select(job_table).where(mine).with_for_update())).mappings().first()
            return await _end_attempt(connection, _job(row), error, retry=retry) if row is not None else None

    async def hand_back(self, job_id: str, owner: str) -> bool:
        """Queue a job again whose owner ends; the attempt does not count.

        Returns:
            Whether it was the owner's; if not, nothing was noted.
        """
        async with self._database.writing() as connection:
            return await _update_owned(connection, job_id, owner, _NOT_BEGUN)

    async def hand_back_all(self, owner: str) -> int:
        """Queue all jobs again of an owner who ends; these attempts do not count.

        Returns:
            How many there were.
        """
        async with self._database.writing() as connection:
            statement = update(job_table).where(_owned_by(owner)).values(**_NOT_BEGUN)
            return (await connection.execute(statement)).rowcount

    async def release_lost(self, older_than: timedelta) -> Sequence[Job]:
        """Take jobs from owners that were not heard of for so long; they are queued again, or have failed.

        Args:
            older_than: longer than an owner's heartbeats are apart, and than machines' clocks differ.

        Returns:
            The jobs that were released, as they are now.
        """
        limit = micros(now() - older_than)
        lost = and_(job_table.c.state == JobState.RUNNING.value, job_table.c.heartbeat < limit)
        async with self._database.writing() as connection:
            rows = await connection.execute(select(job_table).where(lost).with_for_update(skip_locked=True))
            jobs = [_job(row) for row in rows.mappings().all()]
            return [
                await _end_attempt(connection, job, f"its worker {job.owner} was not heard of any more", retry=True)
                for job in jobs
            ]


async def enqueue_job(
    connection: AsyncConnection,
    mesh_id: str,
    source_key: str,
    options: Mapping[str, Any] | None,
    description: MeshDescription | None = None,
) -> Job:
    """Have an uploaded file encoded, within a transaction.

    Args:
        connection: the transaction's.
        mesh_id: the mesh, which is in the catalogue.
        source_key: the file in the store.
        options: how to encode it, as JSON knows it.
        description: of the mesh once it is encoded.

    Raises:
        UnknownMeshError: there is no such mesh.
    """
    await get_mesh(connection, mesh_id)
    job_id = uuid.uuid4().hex
    row = {
        "id": job_id,
        "mesh_id": mesh_id,
        "source_key": source_key,
        "options": json.dumps(dict(options or {}), sort_keys=True),
        "state": JobState.QUEUED.value,
        "attempts": 0,
        "stage": "waiting",
        "progress": 0.0,
        "created": micros(now()),
        "description": None if description is None else json.dumps(description._asdict()),
    }
    await connection.execute(insert(job_table).values(**row))
    return await _get(connection, job_id)


async def has_unfinished_job(connection: AsyncConnection, mesh_id: str) -> bool:
    """Whether something is queued or runs for a mesh, within a transaction."""
    unfinished = job_table.c.state.in_([state.value for state in UNFINISHED])
    found = select(job_table.c.id).where(job_table.c.mesh_id == mesh_id, unfinished).limit(1)
    return (await connection.execute(found)).scalar() is not None


async def lock_jobs(connection: AsyncConnection, mesh_id: str) -> None:
    """Lock the jobs of a mesh before the mesh itself is changed."""
    await connection.execute(select(job_table.c.id).where(job_table.c.mesh_id == mesh_id).with_for_update())


async def end_earlier_jobs(connection: AsyncConnection, mesh_id: str) -> None:
    """End within a transaction what is queued or runs for a mesh: a later upload takes its place."""
    unfinished = job_table.c.state.in_([state.value for state in UNFINISHED])
    values = {
        "state": JobState.FAILED.value,
        "owner": None,
        "stage": "failed",
        "error": "a later upload under the same id replaced it",
        "finished": micros(now()),
    }
    await connection.execute(update(job_table).where(job_table.c.mesh_id == mesh_id, unfinished).values(**values))


async def finish_job(connection: AsyncConnection, job_id: str, owner: str) -> bool:
    """Note within a transaction that a job is done; see `Jobs.finish`."""
    values = {
        "state": JobState.DONE.value,
        "owner": None,
        "stage": "done",
        "progress": 1.0,
        "error": None,
        "finished": micros(now()),
    }
    return await _update_owned(connection, job_id, owner, values)


async def _end_attempt(connection: AsyncConnection, job: Job, error: str, *, retry: bool) -> Job:
    again = retry and job.attempts < ATTEMPTS
    values: dict[str, Any] = {"owner": None, "heartbeat": None, "error": error, "progress": 0.0}
    if again:
        values |= {"state": JobState.QUEUED.value, "stage": "waiting"}
    else:
        values |= {"state": JobState.FAILED.value, "stage": "failed", "finished": micros(now())}
        await fail_mesh(connection, job.mesh_id, error)
    await connection.execute(update(job_table).where(job_table.c.id == job.id).values(**values))
    return await _get(connection, job.id)


async def _update_owned(connection: AsyncConnection, job_id: str, owner: str, values: dict[str, Any]) -> bool:
    mine = and_(job_table.c.id == job_id, _owned_by(owner))
    return bool((await connection.execute(update(job_table).where(mine).values(**values))).rowcount)


def _owned_by(owner: str) -> ColumnElement[bool]:
    return and_(job_table.c.state == JobState.RUNNING.value, job_table.c.owner == owner)


async def _get(connection: AsyncConnection, job_id: str) -> Job:
    row = (await connection.execute(select(job_table).where(job_table.c.id == job_id))).mappings().first()
    if row is None:
        raise UnknownJobError(job_id)
    return _job(row)


def _job(row: RowMapping) -> Job:
    return Job(
        id=row["id"],
        mesh_id=row["mesh_id"],
        source_key=row["source_key"],
        options=json.loads(row["options"]),
        state=JobState(row["state"]),
        attempts=row["attempts"],
        owner=row["owner"],
        heartbeat=None if row["heartbeat"] is None else moment(row["heartbeat"]),
        stage=row["stage"],
        progress=row["progress"],
        error=row["error"],
        created=moment(row["created"]),
        finished=None if row["finished"] is None else moment(row["finished"]),
        description=None if row["description"] is None else _description(json.loads(row["description"])),
        notes=() if row["notes"] is None else tuple(json.loads(row["notes"])),
    )


def _description(fields: dict[str, Any]) -> MeshDescription:
    return MeshDescription(fields["name"], tuple(fields["tags"]), fields["licence"], fields["source"])
