"""The meshes of store and catalogue as this server shows them, brought up to date again and again.

Whatever another server of the same catalogue adds, replaces or removes is seen here a moment later, without a restart.
Streams are read from files: those of a store in a folder where they lie; those of any other store are copied once to a
folder of this server, checked against their SHA-256, and deleted when no mesh here needs them any more. So a store is
asked once for each stream, not once for each client.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_codec.stream.header import StreamHeader
from meshtide_server.catalogue import MeshQuery, MeshState
from meshtide_server.catalogue.meshes import LARGEST_PAGE
from meshtide_server.catalogue.rows import now
from meshtide_server.hosted_mesh import HostedMesh, Source
from meshtide_server.hosted_stream import HostedStream
from meshtide_server.packet_index import PacketIndex
from meshtide_server.storage import FileStorage
from meshtide_server.store import StoreError, stream_key
from meshtide_server.store.local import LocalStore

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from meshtide_server.catalogue import Catalogue, MeshRecord
    from meshtide_server.store import Store

logger = logging.getLogger("meshtide.server")


class KeptMeshes:
    """The meshes of one store and catalogue.

    Args:
        store: holds their streams.
        catalogue: knows them.
        copies: folder of this server for copies of streams whose store is no folder.
    """

    def __init__(self, store: Store, catalogue: Catalogue, copies: Path) -> None:
        self.store = store
        self.catalogue = catalogue
        self._copies = LocalStore(copies)
        self._meshes: dict[str, HostedMesh] = {}
        self._updated: dict[str, datetime] = {}
        self._streams: dict[str, HostedStream] = {}
        self.packets = PacketIndex()
        """The packets of their streams, which it knows by SHA-256."""
        self._swept = False
        self._refreshing = asyncio.Lock()
        self._refreshed: datetime | None = None

    @property
    def meshes(self) -> dict[str, HostedMesh]:
        """All of them as they were at the last refresh, by their ids."""
        return self._meshes

    async def refresh(self) -> None:
        """Bring the meshes to the state of the catalogue; one whose stream cannot be had stays as it was.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer; nothing was changed.
        """
        async with self._refreshing:  # what one has read must not hide what a later one has
            begun = now()
            await self._refresh()
            self._refreshed = begun

    async def refresh_since(self, moment: datetime) -> None:
        """Bring the meshes to what the catalogue knew at `moment`, or later.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer; nothing was changed.
        """
        if self._refreshed is None or self._refreshed <= moment:
            await self.refresh()

    async def _refresh(self) -> None:
        records = await self._records()
        meshes: dict[str, HostedMesh] = {}
        for record in records:
            known = self._meshes.get(record.id)
            if known is not None and self._updated.get(record.id) == record.updated:
                meshes[record.id] = known
                continue
            try:
                meshes[record.id] = await self._shown(record)
                self._updated[record.id] = record.updated
            except (MeshtideError, OSError) as error:
                logger.warning("the stream of %s cannot be had now: %s", record.id, error)
                if known is not None:
                    meshes[record.id] = known
        self._meshes = meshes
        self._updated = {mesh_id: when for mesh_id, when in self._updated.items() if mesh_id in meshes}
        await self._forget({record.stream for record in records})

    async def reason_to_wait(self) -> str | None:
        """Nothing, if the catalogue answers.

        Raises:
            DatabaseUnavailableError: it does not.
        """
        await self.catalogue.check()
        return None

    async def close(self) -> None:
        """Let go of store and catalogue."""
        await self.store.close()
        await self.catalogue.close()

    async def _records(self) -> list[MeshRecord]:
        query = MeshQuery(limit=LARGEST_PAGE)
        records: list[MeshRecord] = []
        while True:
            page = await self.catalogue.meshes.list(query)
            records += page.meshes
            if page.next is None:
                return records
            query = replace(query, after=page.next)

    async def _shown(self, record: MeshRecord) -> HostedMesh:
        mesh = HostedMesh(record.id, Source(record.name), record=record)
        if record.state == MeshState.FAILED:
            mesh.fail(record.reason or "it failed")
        elif record.state == MeshState.READY and record.stream is not None:
            mesh.succeed(await self._stream(record.stream))
        return mesh

    async def _stream(self, sha256: str) -> HostedStream:
        found = self._streams.get(sha256)
        if found is not None and await asyncio.to_thread(found.storage.unchanged):
            return found
        record = await self.catalogue.streams.get(sha256)
        if record is None:
            raise StoreError(f"stream {sha256} has left the catalogue; its mesh will follow")
        header = await asyncio.to_thread(StreamHeader.from_bytes, record.header)
        storage = await asyncio.to_thread(FileStorage, await self._file(sha256))
        if storage.size != record.size:
            raise StoreError(f"{storage.path} has {storage.size} bytes, the catalogue knows {record.size}")
        self._streams[sha256] = HostedStream(header, record.header, storage, record.packets)
        self.packets.add(sha256, self._streams[sha256])
        return self._streams[sha256]

    async def _file(self, sha256: str) -> Path:
        """The file of a stream, copied if its store is no folder."""
        key = stream_key(sha256)
        if isinstance(self.store, LocalStore):
            return self.store.path(key)
        with suppress(StoreError):
            await self._copies.head(key)
            return self._copies.path(key)
        data = await self.store.get(key)
        if await asyncio.to_thread(lambda: hashlib.sha256(data).hexdigest()) != sha256:
            raise StoreError(f"object {key!r} in the store is damaged: its bytes have another SHA-256")
        await self._copies.put(key, data)
        return self._copies.path(key)

    async def _forget(self, needed: set[str | None]) -> None:
        """Let go of streams, and delete copies, that no mesh here needs."""
        if not self._swept:  # what an earlier process has left
            self._swept = True
            keys = {stream_key(sha256) for sha256 in needed if sha256 is not None}
            stale = [info.key async for info in self._copies.list("streams") if info.key not in keys]
            for key in stale:
                await self._copies.delete(key)
        for sha256 in self._streams.keys() - needed:
            del self._streams[sha256]
            self.packets.remove(sha256)
            await self._copies.delete(stream_key(sha256))
