"""Uploaded files in the store, and who needs them: uploads that are being taken, and jobs that wait or run.

An upload is noted before its object is put, or found in the store, and the note goes in the transaction that queues its
job. So at any moment from then on until the job has ended, the catalogue knows that the object is needed; and objects
are deleted under the same lock under which uploads are noted, so that none is deleted that an upload has just found.
Killed between these steps, a server leaves an object that nobody needs, or a note; both go later.
"""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING

from sqlalchemy import delete, insert, select, union

from meshtide_server.catalogue.meshes import micros
from meshtide_server.catalogue.rows import UNFINISHED, now
from meshtide_server.catalogue.tables import job_table, pending_table

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable
    from datetime import timedelta

    from sqlalchemy.ext.asyncio import AsyncConnection

    from meshtide_server.catalogue.database import Database

BATCH = 500
"""Keys in one question to the database."""


class Sources:
    """The uploaded files of a catalogue's store.

    Every method may raise `DatabaseUnavailableError`.

    Args:
        database: of them.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    async def expect(self, source_key: str) -> str:
        """Note that an upload is being taken: from now on nobody deletes its object.

        Args:
            source_key: the object, which is about to be put, or to be found in the store.

        Returns:
            The id of the note, for `Catalogue.add_with_job`.
        """
        note = uuid.uuid4().hex
        row = insert(pending_table).values(id=note, source_key=source_key, since=micros(now()))
        async with self._database.locked() as connection:
            await connection.execute(row)
        return note

    async def needed(self, source_keys: Iterable[str]) -> set[str]:
        """Those of the keys that an upload or a job needs."""
        keys = list(source_keys)
        found: set[str] = set()
        async with self._database.reading() as connection:
            for start in range(0, len(keys), BATCH):
                found |= await _needed(connection, keys[start : start + BATCH])
        return found

    async def collect(self, source_key: str, remove: Callable[[str], Awaitable[None]]) -> bool:
        """Have an object deleted unless somebody needs it.

        Args:
            source_key: the object.
            remove: deletes it from the store; no error if it is not there.

        Returns:
            Whether it was deleted.
        """
        async with self._database.locked() as connection:
            if await _needed(connection, [source_key]):
                return False
            await remove(source_key)
            return True

    async def forget_abandoned(self, older_than: timedelta) -> int:
        """Remove notes of uploads that never became jobs; returns how many.

        Args:
            older_than: longer than putting the largest upload takes.
        """
        async with self._database.writing() as connection:
            old = pending_table.c.since <= micros(now() - older_than)
            return (await connection.execute(delete(pending_table).where(old))).rowcount


async def forget_pending(connection: AsyncConnection, note: str) -> None:
    """Remove the note of an upload within the transaction that queues its job."""
    await connection.execute(delete(pending_table).where(pending_table.c.id == note))


async def _needed(connection: AsyncConnection, keys: list[str]) -> set[str]:
    """In one statement, so that an upload that becomes a job meanwhile is seen as the one or as the other."""
    pending = select(pending_table.c.source_key).where(pending_table.c.source_key.in_(keys))
    unfinished = job_table.c.state.in_([state.value for state in UNFINISHED])
    jobs = select(job_table.c.source_key).where(job_table.c.source_key.in_(keys), unfinished)
    return set((await connection.execute(union(pending, jobs))).scalars())
