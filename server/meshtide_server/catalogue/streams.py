"""Streams and their packets in the catalogue, and the streams in the store that no mesh needs.

A stream's object is in the store before the stream is in the catalogue, and stays there for a while after it has left:
it is noted as unused before it is put, the note goes when the stream is registered, and comes back when the last mesh
that has the stream is gone. Objects that were unused for long enough are deleted. Whether a process is killed before,
between or after these steps, no mesh is ever listed whose object is missing, and no object stays for ever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sqlalchemy import and_, delete, exists, insert, select, update

from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_codec.stream.header import StreamHeader
from meshtide_server.catalogue.meshes import micros
from meshtide_server.catalogue.rows import PacketLocation, StreamRecord, now
from meshtide_server.catalogue.tables import mesh_table, packet_table, stream_table, unused_table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import timedelta

    from sqlalchemy.ext.asyncio import AsyncConnection

    from meshtide_server.catalogue.database import Database


class Streams:
    """The streams of a catalogue.

    Every method may raise `DatabaseUnavailableError`.

    Args:
        database: of them.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    async def get(self, sha256: str) -> StreamRecord | None:
        """The stream of that SHA-256, or None."""
        async with self._database.reading() as connection:
            statement = select(stream_table).where(stream_table.c.sha256 == sha256)
            row = (await connection.execute(statement)).mappings().first()
            if row is None:
                return None
            packets = select(packet_table.c.sha256).where(packet_table.c.stream_sha256 == sha256)
            digests = (await connection.execute(packets.order_by(packet_table.c.position))).scalars().all()
        return StreamRecord(
            sha256=row["sha256"],
            fingerprint=row["fingerprint"],
            header=row["header"],
            size=row["size"],
            packets=tuple(bytes.fromhex(digest) for digest in digests),
        )

    async def present(self, digests: Sequence[str]) -> set[str]:
        """Those of these streams that are in the catalogue, by SHA-256."""
        statement = select(stream_table.c.sha256).where(stream_table.c.sha256.in_(digests))
        async with self._database.reading() as connection:
            return set((await connection.execute(statement)).scalars())

    async def find_packet(self, sha256: str) -> PacketLocation | None:
        """Where a packet lies whose bytes have that SHA-256; None if no mesh's stream has it."""
        columns = (packet_table.c.stream_sha256, packet_table.c.position, packet_table.c.start, packet_table.c.length)
        async with self._database.reading() as connection:
            statement = select(*columns).where(packet_table.c.sha256 == sha256).limit(1)
            row = (await connection.execute(statement)).first()
        return PacketLocation(*row) if row is not None else None

    async def note_unused(self, sha256: str) -> None:
        """Note that an object is about to be put that no mesh has yet; does nothing for a stream that meshes have."""
        async with self._database.locked() as connection:
            await note_if_unused(connection, sha256)

    async def unused(self, older_than: timedelta) -> list[str]:
        """The SHA-256 of streams in the store that no mesh has needed for so long."""
        statement = select(unused_table.c.sha256).where(unused_table.c.since <= micros(now() - older_than))
        async with self._database.reading() as connection:
            return list((await connection.execute(statement.order_by(unused_table.c.sha256))).scalars())


async def register_stream(connection: AsyncConnection, stream: StreamRecord) -> None:
    """Note a stream, whose object is in the store, and its packets."""
    known = await connection.execute(select(stream_table.c.sha256).where(stream_table.c.sha256 == stream.sha256))
    if known.first() is None:
        row = {
            "sha256": stream.sha256,
            "fingerprint": stream.fingerprint,
            "header": stream.header,
            "size": stream.size,
        }
        await connection.execute(insert(stream_table).values(**row))
        await connection.execute(insert(packet_table), _packet_rows(stream))
    await connection.execute(delete(unused_table).where(unused_table.c.sha256 == stream.sha256))


async def note_if_unused(connection: AsyncConnection, sha256: str) -> None:
    """Take a stream out of the catalogue that no mesh has, and note its object as unused from now on."""
    used = (await connection.execute(select(exists().where(mesh_table.c.stream_sha256 == sha256)))).scalar()
    if used:
        return
    await connection.execute(delete(stream_table).where(stream_table.c.sha256 == sha256))
    since = micros(now())
    renewed = update(unused_table).where(unused_table.c.sha256 == sha256).values(since=since)
    if (await connection.execute(renewed)).rowcount == 0:
        await connection.execute(insert(unused_table).values(sha256=sha256, since=since))


async def forget_unused(connection: AsyncConnection, sha256: str, older_than: timedelta) -> bool:
    """Remove the note of an unused stream; returns whether it still stood, and is that old."""
    old = and_(unused_table.c.sha256 == sha256, unused_table.c.since <= micros(now() - older_than))
    return bool((await connection.execute(delete(unused_table).where(old))).rowcount)


async def streams_without_mesh(connection: AsyncConnection) -> list[str]:
    """The SHA-256 of streams in the catalogue that no mesh has, such as those of meshes that were replaced."""
    needed = exists().where(mesh_table.c.stream_sha256 == stream_table.c.sha256)
    return list((await connection.execute(select(stream_table.c.sha256).where(~needed))).scalars())


def _packet_rows(stream: StreamRecord) -> list[dict[str, object]]:
    header = StreamHeader.from_bytes(stream.header)
    start = PREAMBLE_BYTES + len(stream.header)
    return [
        {
            "stream_sha256": stream.sha256,
            "position": position,
            "sha256": digest.hex(),
            "start": start + int(header.packet_offsets[position]),
            "length": entry.length,
        }
        for position, (digest, entry) in enumerate(zip(stream.packets, header.packets, strict=True))
    ]
