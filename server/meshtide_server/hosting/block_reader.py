"""A stream that lies elsewhere: read from there by blocks, through a cache in memory.

What is fetched at a time is a block: whole packets that follow each other, up to BLOCK_BYTES of them, or one packet
that is larger. Only whole packets can be held against the SHA-256 that the catalogue has of each, so nothing that the
store returns is sent, or kept, before it was. The header comes from the catalogue and is never asked for.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from bisect import bisect_right
from typing import TYPE_CHECKING

from meshtide_codec.errors import TransferError
from meshtide_codec.stream.container import preamble
from meshtide_server.operations import metrics
from meshtide_server.store import DamagedObjectError, MissingObjectError, ObjectRangeError, StoreError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_codec.stream.header import StreamHeader
    from meshtide_server.hosting.block_cache import BlockCache
    from meshtide_server.store.protocol import RangeReader

logger = logging.getLogger("meshtide.server")

BLOCK_BYTES = 1 << 20
"""What a store is asked for at a time: enough for its latency not to matter, little enough to wait for."""


class BlockReader:
    """The `.tide` file of a stream that lies elsewhere.

    Args:
        reader: reads it there.
        key: of the object, under which the cache knows it.
        header: of the stream.
        header_bytes: the same as it is in the file.
        digests: SHA-256 of each packet's bytes.
        cache: keeps blocks of this and other streams.

    Raises:
        StoreError: a packet is larger than all that the cache may keep.
    """

    is_near = False

    def __init__(
        self,
        reader: RangeReader,
        key: str,
        header: StreamHeader,
        header_bytes: bytes,
        digests: tuple[bytes, ...],
        cache: BlockCache,
    ) -> None:
        self._reader = reader
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

    def open(self) -> OpenBlocks:
        """Open it for reading; nothing is fetched before something is asked for."""
        return OpenBlocks(self)

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
        opened = self._reader.open()
        try:
            return await opened.read(start, end)
        except MissingObjectError as error:
            raise DamagedObjectError(f"object {self.key!r} is gone from the store; publish the mesh again") from error
        except ObjectRangeError as error:
            raise DamagedObjectError(f"object {self.key!r} is damaged: {error}; publish the mesh again") from error
        finally:
            opened.close()

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
        return f"BlockReader({self.key}, {self.size} bytes)"


class OpenBlocks:
    """A stream that lies elsewhere, open for one reader."""

    def __init__(self, blocks: BlockReader) -> None:
        self._blocks = blocks

    def at_hand(self, start: int, end: int) -> bytes | None:
        """Bytes `start` to `end`, if all of them are in memory."""
        parts = []
        for index, first, last in self._pieces(start, end):
            block = self._blocks.cache.find((self._blocks.key, index))
            if block is None:
                return None
            parts.append(block[first:last])
        return self._join(start, end, parts)

    async def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, from wherever they are.

        Raises:
            StoreError: the store does not give them, or gives something else.
        """
        parts = []
        for index, first, last in self._pieces(start, end):
            parts.append((await self._blocks.block(index))[first:last])
        return self._join(start, end, parts)

    def close(self) -> None:
        """Nothing to let go of."""

    def _join(self, start: int, end: int, parts: list[bytes]) -> bytes:
        front = self._blocks.front[start:end]
        return parts[0] if len(parts) == 1 and not front else b"".join((front, *parts))

    def _pieces(self, start: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Each block that holds some of the bytes, and which of its bytes they are."""
        starts = self._blocks.starts
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
