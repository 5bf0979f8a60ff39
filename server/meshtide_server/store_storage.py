"""A stream that lies in a store that is no folder: read from there by ranges, through a cache in memory.

What is fetched at a time is a block: whole packets that follow each other, up to BLOCK_BYTES of them, or one packet
that is larger. Only whole packets can be held against the SHA-256 that the catalogue has of each, so nothing that the
store returns is sent, or kept, before it was. The header comes from the catalogue and is never asked for.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from bisect import bisect_right
from typing import TYPE_CHECKING, Self

from meshtide_codec.errors import TransferError
from meshtide_codec.stream.container import preamble
from meshtide_server import metrics
from meshtide_server.storage import AbsentError, Closing
from meshtide_server.store import DamagedObjectError, MissingObjectError, ObjectRangeError, StoreError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_codec.stream.header import StreamHeader
    from meshtide_server.block_cache import BlockCache
    from meshtide_server.store import Store

logger = logging.getLogger("meshtide.server")

BLOCK_BYTES = 1 << 20
"""What a store is asked for at a time: enough for its latency not to matter, little enough to wait for."""


class StoreStorage:
    """The `.tide` file of a stream in a store.

    Args:
        store: where it is.
        key: of the object.
        header: of the stream.
        header_bytes: the same as it stands in the file.
        digests: SHA-256 of each packet's bytes.
        cache: keeps blocks of this and other streams.

    Raises:
        StoreError: a packet is larger than all that the cache may keep.
    """

    def __init__(
        self,
        store: Store,
        key: str,
        header: StreamHeader,
        header_bytes: bytes,
        digests: tuple[bytes, ...],
        cache: BlockCache,
    ) -> None:
        self._store = store
        self.key = key
        self._header = header
        self._digests = digests
        self.cache = cache
        self.front = preamble(header_bytes)
        """The file's bytes in front of the first packet."""
        self._offsets = [len(self.front) + int(offset) for offset in header.packet_offsets]
        self._firsts = _first_packets(self._offsets, min(BLOCK_BYTES, cache.budget))
        self.starts = [self._offsets[index] for index in self._firsts]
        """Where each block begins, and the last one ends."""
        largest = max((end - start for start, end in zip(self.starts, self.starts[1:], strict=False)), default=0)
        if largest > cache.budget:
            raise StoreError(
                f"object {key!r} has a packet of {largest} bytes, and the cache takes {cache.budget}; "
                "raise MESHTIDE_STORE_CACHE_MIB"
            )

    @property
    def size(self) -> int:
        """Its size in bytes."""
        return self._offsets[-1]

    def open(self) -> OpenObject:
        """Open it for reading; nothing is fetched before something is asked for."""
        return OpenObject(self)

    def unchanged(self) -> bool:
        """What has an address made of its bytes never changes."""
        return True

    async def block(self, index: int) -> bytes:
        """A block of the file, from the cache or from the store.

        Raises:
            StoreError: the store does not give it.
            DamagedObjectError: it gives something else.
        """
        size = self.starts[index + 1] - self.starts[index]
        return await self.cache.get((self.key, index), size, lambda: self._fetch(index))

    async def _fetch(self, index: int) -> bytes:
        start, end = self.starts[index], self.starts[index + 1]
        try:
            data = await self._read(start, end)
            await asyncio.to_thread(self._verify, index, data)
        except (TransferError, OSError) as error:
            damaged = isinstance(error, DamagedObjectError)
            metrics.store_read(metrics.ReadOutcome.DAMAGED if damaged else metrics.ReadOutcome.FAILED, 0)
            logger.log(logging.ERROR if damaged else logging.WARNING, "%s", error)
            raise
        metrics.store_read(metrics.ReadOutcome.DONE, len(data))
        return data

    async def _read(self, start: int, end: int) -> bytes:
        """Bytes of the object; that it is gone, or shorter than it was, is damage, and no passing trouble."""
        try:
            return await self._store.get_range(self.key, start, end)
        except MissingObjectError as error:
            raise DamagedObjectError(f"object {self.key!r} is gone from the store; publish the mesh again") from error
        except ObjectRangeError as error:
            raise DamagedObjectError(f"object {self.key!r} is damaged: {error}; publish the mesh again") from error

    def _verify(self, index: int, data: bytes) -> None:
        start, end = self.starts[index], self.starts[index + 1]
        if len(data) != end - start:
            raise DamagedObjectError(
                f"object {self.key!r} is damaged: {len(data)} bytes came of the {end - start} from byte {start}"
            )
        view = memoryview(data)
        for packet in range(self._firsts[index], self._firsts[index + 1]):
            part = view[self._offsets[packet] - start : self._offsets[packet + 1] - start]
            if hashlib.sha256(part).digest() != self._digests[packet]:
                entry = self._header.packets[packet]
                raise DamagedObjectError(
                    f"object {self.key!r} is damaged: packet {packet} ({entry.kind.label}, level {entry.level}) "
                    f"at byte {self._offsets[packet]} has another SHA-256; publish the mesh again"
                )

    def __repr__(self) -> str:
        return f"StoreStorage({self.key}, {self.size} bytes)"


class OpenObject(Closing):
    """A stream in a store, open for one reader."""

    def __init__(self, storage: StoreStorage) -> None:
        self._storage = storage
        self._missing = 0
        self._brought: tuple[int, bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, if they are in memory.

        Raises:
            AbsentError: they are not; `load` brings them.
        """
        brought, self._brought = self._brought, None  # a reader that is paused must not hold on to it
        parts = []
        for index, first, last in self._pieces(start, end):
            block = (
                brought[1] if brought and brought[0] == index else self._storage.cache.find((self._storage.key, index))
            )
            if block is None:
                self._missing = index
                raise AbsentError
            parts.append(block[first:last])
        return self._join(start, end, parts)

    async def load(self) -> None:
        """Bring what the last `read` missed, for the next one.

        Raises:
            StoreError: the store does not give it, or gives something else.
        """
        self._brought = self._missing, await self._storage.block(self._missing)

    async def fetch(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, from wherever they are.

        Raises:
            StoreError: the store does not give them, or gives something else.
        """
        parts = []
        for index, first, last in self._pieces(start, end):
            parts.append((await self._storage.block(index))[first:last])
        return self._join(start, end, parts)

    def _join(self, start: int, end: int, parts: list[bytes]) -> bytes:
        front = self._storage.front[start:end]
        return parts[0] if len(parts) == 1 and not front else b"".join((front, *parts))

    def _pieces(self, start: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Each block that holds some of the bytes, and which of its bytes they are."""
        starts = self._storage.starts
        position = max(start, starts[0])
        index = bisect_right(starts, position) - 1
        while position < end:
            stop = min(end, starts[index + 1])
            yield index, position - starts[index], stop - starts[index]
            position, index = stop, index + 1


def _first_packets(offsets: list[int], largest: int) -> list[int]:
    """The first packet of each block, and one past the last packet.

    >>> _first_packets([50, 60, 70, 270, 271], 100)
    [0, 2, 3, 4]
    """
    firsts = [0]
    for packet in range(1, len(offsets) - 1):
        if offsets[packet + 1] - offsets[firsts[-1]] > largest:
            firsts.append(packet)
    return [*firsts, len(offsets) - 1]
