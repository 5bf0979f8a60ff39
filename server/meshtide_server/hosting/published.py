"""The meshes of store and catalogue, as this server shows them: looked up when they are asked for.

The catalogue may know a hundred thousand meshes; what a server has in memory are those that were asked for lately, and
parts of their streams. Lists come from the catalogue page by page. What is in memory is held against the catalogue
every few seconds, so whatever another server replaces or removes is seen here a moment later; what it adds, at once.

Streams that lie on this machine are read there; all others by blocks, through a cache.
"""

from __future__ import annotations

import asyncio
import logging
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING

from meshtide_codec.stream.header import StreamHeader
from meshtide_server.catalogue import Catalogue, Status, UnknownMeshError
from meshtide_server.hosting.block_cache import BlockCache
from meshtide_server.hosting.block_reader import BlockReader
from meshtide_server.hosting.identifiers import is_id
from meshtide_server.hosting.mesh import HostedMesh, MeshSource
from meshtide_server.hosting.packet_index import PacketIndex, PacketPlace
from meshtide_server.hosting.single_flight import SingleFlight
from meshtide_server.hosting.stream import HostedStream
from meshtide_server.store import DamagedObjectError, MissingObjectError, StoreError, open_store, stream_key

if TYPE_CHECKING:
    from collections.abc import Container, Mapping, Sequence

    from meshtide_codec.stream.mesh_query import MeshQuery
    from meshtide_server.catalogue import MeshRecord, StreamRecord
    from meshtide_server.settings import Settings
    from meshtide_server.store import Store
    from meshtide_server.store.protocol import RangeReader

logger = logging.getLogger("meshtide.server")

KNOWN = 1000
"""Meshes, and streams, that are kept in memory at most; others are looked up in the catalogue."""
KNOWN_PACKETS = 1 << 16
"""Packets of the streams that are, at most; each takes about half a kilobyte."""


LISTS_AT_A_TIME = 4
"""A search may look at every mesh; whoever wants one mesh, or readiness, must not wait behind a crowd of them."""
ATTEMPTS = 3
"""How often a mesh is looked up that is replaced, or may have been, while it is."""


class _StreamGoneError(StoreError):
    """A stream has left the catalogue since it was named."""


class PublishedMeshes:
    """The meshes of one store and catalogue.

    Args:
        store: holds their streams.
        catalogue: knows them.
        cache: for parts of streams, if the store is not a folder.
    """

    def __init__(self, store: Store, catalogue: Catalogue, cache: BlockCache) -> None:
        self.store = store
        self.catalogue = catalogue
        self.cache = cache
        self._counts = dict.fromkeys(Status, 0)
        self._records: OrderedDict[str, MeshRecord] = OrderedDict()
        self._streams: OrderedDict[str, HostedStream] = OrderedDict()
        self._packets = PacketIndex()
        self._packet_count = 0
        self._lists = asyncio.Semaphore(LISTS_AT_A_TIME)
        self._refreshing = asyncio.Lock()
        self._round = 0
        """Of refreshes; what was read before the last one began is not kept."""
        self._meshes_sought: SingleFlight[str, HostedMesh | None] = SingleFlight()
        self._streams_sought: SingleFlight[str, HostedStream] = SingleFlight()

    @property
    def counts(self) -> Mapping[Status, int]:
        """How many were in which state at the last refresh."""
        return self._counts

    def known(self, mesh_id: str) -> HostedMesh | None:
        """A mesh that is in memory with its stream."""
        record = self._records.get(mesh_id)
        stream = self._streams.get(record.stream or "") if record is not None else None
        if record is None or stream is None:
            return None
        self._records.move_to_end(mesh_id)
        self._streams.move_to_end(record.stream or "")
        return shown(record, stream)

    async def find(self, mesh_id: str) -> HostedMesh | None:
        """The mesh of that id, or None.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer.
            StoreError, OSError: its stream cannot be had.
        """
        known = self.known(mesh_id)
        if known is not None or not is_id(mesh_id):
            return known
        return await self._meshes_sought.do(mesh_id, lambda: self._look_up(mesh_id))

    async def find_packet(self, digest: bytes) -> PacketPlace | None:
        """Where the packet whose bytes have that SHA-256 lies; raises as `find` does."""
        known = self._packets.find(digest)
        if known is not None:
            return known
        location = await self.catalogue.streams.find_packet(digest.hex())
        try:
            return PacketPlace(await self._stream(location.stream), location.position) if location is not None else None
        except _StreamGoneError:
            return None

    async def page(self, query: MeshQuery, without: Container[str], limit: int) -> tuple[list[HostedMesh], bool]:
        """The meshes that are asked for, in the order of their ids, and whether there are more.

        Args:
            query: which ones.
            without: ids that are left out, for the server has other meshes under them.
            limit: how many at most.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer.
        """
        found: list[HostedMesh] = []
        while True:
            async with self._lists:
                page = await self.catalogue.meshes.list(query, limit - len(found))
            found += [shown(record) for record in page.meshes if record.id not in without]
            if page.next is None or len(found) == limit:
                await self._tell_progress(found)
                return found, page.next is not None
            query = replace(query, after=page.next)

    async def ids(self, start: str) -> set[str]:
        """The ids that begin so; raises as `page` does."""
        return set(await self.catalogue.meshes.ids(start))

    async def tags(self, limit: int) -> list[tuple[str, int]]:
        """Tags and how many meshes have each, those of most meshes first; raises as `page` does."""
        async with self._lists:
            return await self.catalogue.meshes.tags(limit)

    async def refresh(self) -> None:
        """Forget what has changed in the catalogue since it was looked up.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer; nothing was changed.
        """
        async with self._refreshing:
            await self._refresh()

    async def refresh_mesh(self, mesh_id: str) -> None:
        """Forget one mesh if it has changed in the catalogue since it was looked up.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer; nothing was changed.
        """
        record = self._records.get(mesh_id)
        if record is None:
            self._round += 1  # what is being looked up now may be older than what has just changed
        elif (await self.catalogue.meshes.updated([mesh_id])).get(mesh_id) != record.updated:
            await self.refresh()

    async def _refresh(self) -> None:
        self._round += 1
        records, streams = dict(self._records), dict(self._streams)
        updated = await self.catalogue.meshes.updated(list(records))
        present = await self.catalogue.streams.present(list(streams))
        self._counts = await self.catalogue.meshes.count()
        for mesh_id, record in records.items():
            if updated.get(mesh_id) != record.updated and self._records.get(mesh_id) is record:
                del self._records[mesh_id]
        unchanged = await asyncio.to_thread(lambda: {key for key, each in streams.items() if each.reader.unchanged()})
        for sha256 in streams.keys() - (present & unchanged):
            self._forget(sha256)

    async def reason_to_wait(self) -> str | None:
        """Nothing, if the catalogue answers.

        Raises:
            DatabaseUnavailableError: it does not.
        """
        await self.catalogue.check()
        return None

    async def close(self) -> None:
        """Let go of store and catalogue."""
        await self._meshes_sought.close()
        await self._streams_sought.close()
        await self.cache.close()
        await self.store.close()
        await self.catalogue.close()

    async def _look_up(self, mesh_id: str) -> HostedMesh | None:
        found: HostedMesh | None = None
        for _ in range(ATTEMPTS):
            begun = self._round
            try:
                record = await self.catalogue.meshes.get(mesh_id)
            except UnknownMeshError:
                return None
            if record.state != Status.READY or record.stream is None:
                mesh = shown(record)
                await self._tell_progress([mesh])
                return mesh
            try:
                found = shown(record, await self._stream(record.stream))
            except _StreamGoneError:  # replaced or deleted in this moment
                continue
            if begun == self._round:
                self._remember(record)
                break
        if found is None:
            raise StoreError(f"the stream of {mesh_id} left the catalogue {ATTEMPTS} times; what replaces it so often?")
        return found

    async def _tell_progress(self, meshes: Sequence[HostedMesh]) -> None:
        """Note in meshes that are being encoded how far they are."""
        waiting = {mesh.id: mesh for mesh in meshes if mesh.status == Status.ENCODING}
        for mesh_id, (stage, done) in (await self.catalogue.jobs.progress(list(waiting))).items() if waiting else ():
            waiting[mesh_id].advance(stage, done)

    def _remember(self, record: MeshRecord) -> None:
        self._records[record.id] = record
        self._records.move_to_end(record.id)
        if len(self._records) > KNOWN:
            self._records.popitem(last=False)

    async def _stream(self, sha256: str) -> HostedStream:
        known = self._streams.get(sha256)
        return known or await self._streams_sought.do(sha256, lambda: self._look_up_stream(sha256))

    async def _look_up_stream(self, sha256: str) -> HostedStream:
        record = await self.catalogue.streams.get(sha256)
        if record is None:
            raise _StreamGoneError(f"stream {sha256} has left the catalogue")
        header = await asyncio.to_thread(StreamHeader.from_bytes, record.header)
        reader = await self._open(record, header)
        stream = HostedStream(header, record.header, reader, record.packets)
        self._streams[sha256] = stream
        self._packets.add(sha256, stream)
        self._packet_count += len(record.packets)
        while len(self._streams) > KNOWN or (self._packet_count > KNOWN_PACKETS and len(self._streams) > 1):
            self._forget(next(iter(self._streams)))
        return stream

    async def _open(self, record: StreamRecord, header: StreamHeader) -> RangeReader:
        """What reads the stream: where it lies if that is near, else through the cache."""
        key = stream_key(record.sha256)
        try:
            reader = await self.store.open_range_reader(key)
        except MissingObjectError as error:
            raise _damaged(f"object {key!r} is gone from the store") from error
        if not reader.is_near:
            reader = BlockReader(reader, key, header, record.header, record.packets, self.cache)
        if reader.size != record.size:
            raise _damaged(f"stream {record.sha256} has {reader.size} bytes, the catalogue knows {record.size}")
        return reader

    def _forget(self, sha256: str) -> None:
        stream = self._streams.pop(sha256, None)
        if stream is not None:
            self._packets.remove(sha256)
            self._packet_count -= len(stream.packet_digests)
            self.cache.forget(stream_key(sha256))


async def open_published(settings: Settings) -> PublishedMeshes:
    """The meshes of the store and the catalogue that are set.

    Raises:
        OptionError: one of them cannot be used.
        StoreError, DatabaseUnavailableError: one of them does not answer.
    """
    store = await asyncio.to_thread(open_store, settings.store_url)
    catalogue = await Catalogue.open(settings.database_url)
    published = PublishedMeshes(store, catalogue, BlockCache(settings.store_cache_mib << 20))
    await published.refresh()
    return published


def _damaged(what: str) -> DamagedObjectError:
    logger.error("%s; publish the mesh again", what)
    return DamagedObjectError(f"{what}; publish the mesh again")


def shown(record: MeshRecord, stream: HostedStream | None = None) -> HostedMesh:
    """A mesh of the catalogue as the server shows it; one that is ready may have its stream looked up later."""
    mesh = HostedMesh(record.id, MeshSource(record.name), record=record)
    if record.state == Status.FAILED:
        mesh.fail(record.reason or "it failed")
    elif record.state == Status.READY:
        mesh.succeed(stream)
    return mesh
