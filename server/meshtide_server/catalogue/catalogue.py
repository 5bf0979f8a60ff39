"""The catalogue: opening it, and what concerns meshes, streams and jobs at once, in one transaction each."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any, Self

from sqlalchemy import delete, select, text

from meshtide_server.catalogue.database import Database
from meshtide_server.catalogue.errors import UnknownMeshError
from meshtide_server.catalogue.jobs import (
    Jobs,
    end_earlier_jobs,
    enqueue_job,
    finish_job,
    has_unfinished_job,
    lock_jobs,
)
from meshtide_server.catalogue.meshes import Meshes, add_mesh, get_mesh, put_mesh
from meshtide_server.catalogue.migrations import migrate
from meshtide_server.catalogue.rows import MeshDescription, Status
from meshtide_server.catalogue.sources import Sources, forget_pending
from meshtide_server.catalogue.streams import (
    Streams,
    forget_unused,
    note_if_unused,
    register_stream,
    streams_without_mesh,
)
from meshtide_server.catalogue.tables import mesh_table

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping

    from sqlalchemy.ext.asyncio import AsyncConnection

    from meshtide_server.catalogue.rows import Job, MeshRecord, StreamRecord

UNUSED_FOR = timedelta(hours=1)
"""How long an unused stream stays in the store: longer than an upload takes, and than a download that still runs."""


class Catalogue:
    """A catalogue, open; make one with `Catalogue.open`. Many processes may have the same one open.

    Every method may raise `DatabaseUnavailableError`.

    Args:
        database: with the newest schema.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self.meshes = Meshes(database)
        self.streams = Streams(database)
        self.jobs = Jobs(database)
        self.sources = Sources(database)

    @classmethod
    async def open(cls, url: str) -> Self:
        """Open a catalogue, which is made if it is not there yet, and brought to the newest schema.

        Args:
            url: ``sqlite:///file.db`` or ``postgresql://user:password@host/name``.

        Raises:
            OptionError: it is no such address, or the extra `postgres` is not installed.
            NewerSchemaError: the database was made by a newer program.
            DatabaseUnavailableError: it cannot be reached.
        """
        database = Database(url)
        try:
            async with database.writing() as connection:
                await migrate(connection)
        except BaseException:
            await database.close()
            raise
        return cls(database)

    async def close(self) -> None:
        """Let go of all connections; may be called twice."""
        await self._database.close()

    async def check(self) -> None:
        """Ask the database for something small, to see whether it answers."""
        async with self._database.reading() as connection:
            await connection.execute(text("SELECT 1"))

    async def add_with_job(
        self,
        mesh: MeshRecord,
        source_key: str,
        options: Mapping[str, Any],
        *,
        replace: bool = False,
        note: str | None = None,
    ) -> tuple[MeshRecord, Job]:
        """Add a mesh and the job that makes its stream, in one transaction.

        Earlier jobs of a mesh that is replaced end with this, so that none of them can replace the later one. A mesh
        that can be served stays as it is until the job has made another stream, and for good if it does not.

        Args:
            mesh: with state ENCODING.
            source_key: the uploaded file in the store.
            options: how to encode it, as JSON knows it.
            replace: whether a mesh of that id is replaced.
            note: that the file was expected, which ends with this: its job needs it from now on.

        Raises:
            MeshExistsError: there is a mesh of that id, and `replace` is not set.
        """
        # Of uploads under one id at once, the later one has to see the job of the earlier one.
        async with self._database.locked() if replace else self._database.writing() as connection:
            if replace:
                await end_earlier_jobs(connection, mesh.id)
            description = None
            served = await _served_mesh(connection, mesh.id) if replace else None
            if served is not None:
                record, description = served, MeshDescription(mesh.name, mesh.tags, mesh.licence, mesh.source)
            else:
                record = await (put_mesh if replace else add_mesh)(connection, mesh)
            if note is not None:
                await forget_pending(connection, note)
            return record, await enqueue_job(connection, record.id, source_key, options, description)

    async def register(
        self,
        mesh: MeshRecord,
        stream: StreamRecord,
        present: Callable[[], Awaitable[bool]],
        *,
        replace: bool = True,
        job: tuple[str, str] | None = None,
    ) -> MeshRecord | None:
        """Show a mesh with its stream: stream, packets, mesh and the job's end in one transaction.

        Args:
            mesh: with state READY and this stream.
            stream: whose object is in the store.
            present: asks the store whether it is; it is asked while no unused objects are deleted.
            replace: whether a mesh of that id is replaced.
            job: id and owner of the job that made the stream, which is done with this.

        Returns:
            The mesh as it stands now, or None, with nothing changed: the object is not there, put it again.

        Raises:
            MeshExistsError: there is a mesh of that id, and `replace` is not set.
            UnknownMeshError: the job is not its owner's any more: it was given to another one, or the mesh deleted.
        """
        async with self._database.locked() as connection:
            if not await present():
                return None
            if job is not None and not await finish_job(connection, *job):
                raise UnknownMeshError(mesh.id)
            before = select(mesh_table.c.stream_sha256).where(mesh_table.c.id == mesh.id)
            old = (await connection.execute(before)).scalar()
            await register_stream(connection, stream)
            record = await (put_mesh if replace else add_mesh)(connection, mesh)
            if old is not None and old != stream.sha256:
                await note_if_unused(connection, old)
            return record

    async def change(
        self,
        mesh_id: str,
        *,
        name: str | None = None,
        tags: tuple[str, ...] | None = None,
        licence: str | None = None,
    ) -> MeshRecord:
        """Change a mesh's name, tags or licence; what is None stays as it is.

        Returns:
            The mesh as it stands now; one that is being encoded, or encoded again, is not changed, for its job brings
            all of this: its state is ENCODING then.

        Raises:
            UnknownMeshError: there is none.
        """
        async with self._database.writing() as connection:
            row = select(mesh_table.c.id).where(mesh_table.c.id == mesh_id).with_for_update()
            await connection.execute(row)  # an upload that replaces the mesh waits, or was before this
            record = await get_mesh(connection, mesh_id)
            if record.state == Status.ENCODING or await has_unfinished_job(connection, mesh_id):
                return replace(record, state=Status.ENCODING)
            changed = replace(
                record,
                name=record.name if name is None else name,
                tags=record.tags if tags is None else tags,
                licence=record.licence if licence is None else licence,
            )
            return await put_mesh(connection, changed)

    async def delete(self, mesh_id: str) -> MeshRecord:
        """Remove a mesh, its jobs, and its stream if no other mesh has it; returns what was removed.

        The stream's object stays in the store until `collect` removes it.

        Raises:
            UnknownMeshError: there is none.
        """
        async with self._database.locked() as connection:
            record = await get_mesh(connection, mesh_id)
            await lock_jobs(connection, mesh_id)
            await connection.execute(delete(mesh_table).where(mesh_table.c.id == mesh_id))
            if record.stream is not None:
                await note_if_unused(connection, record.stream)
            return record

    async def collect(self, remove: Callable[[str], Awaitable[None]], older_than: timedelta = UNUSED_FOR) -> list[str]:
        """Have objects deleted that no mesh has needed for a while; several processes may do so at once.

        Args:
            remove: deletes the object of the stream with that SHA-256 from the store; no error if it is not there.
            older_than: for how long they must have been unused.

        Returns:
            The SHA-256 of the streams whose objects were deleted.
        """
        async with self._database.locked() as connection:
            for sha256 in await streams_without_mesh(connection):
                await note_if_unused(connection, sha256)
        removed = []
        for sha256 in await self.streams.unused(older_than):
            async with self._database.locked() as connection:
                if await forget_unused(connection, sha256, older_than):
                    await remove(sha256)
                    removed.append(sha256)
        return removed

    def __repr__(self) -> str:
        return f"Catalogue({self._database})"


async def _served_mesh(connection: AsyncConnection, mesh_id: str) -> MeshRecord | None:
    """The mesh of that id, if it can be served, within a transaction."""
    try:
        record = await get_mesh(connection, mesh_id)
    except UnknownMeshError:
        return None
    return record if record.state == Status.READY else None
