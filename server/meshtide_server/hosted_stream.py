"""A stream that the server may send: its header in memory, its packets read where they lie.

`load_stream` checks every packet against the header's table once, before anybody is sent a byte of it; sessions and
downloads then open the bytes anew, so that a file that was replaced meanwhile is noticed.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

from meshtide_codec.errors import ContainerError, TruncatedError
from meshtide_codec.stream.container import PREAMBLE_BYTES, ContainerReader, check_packet, fingerprint

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from meshtide_codec.limits import Limits
    from meshtide_codec.stream.header import LevelEntry, StreamHeader
    from meshtide_server.storage import OpenStorage, Storage

CHUNK = 1 << 16
"""Bytes read at a time until the header is known."""


class StoppedError(Exception):
    """The server is shutting down; what was under way is of no more use."""


class OpenStream:
    """A hosted stream with its bytes open: what a ServerSession sends from. A context manager."""

    def __init__(self, stream: HostedStream, opened: OpenStorage) -> None:
        self._stream = stream
        self._opened = opened

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def header(self) -> StreamHeader:
        """The stream's header."""
        return self._stream.header

    @property
    def header_bytes(self) -> bytes:
        """The header as it is sent."""
        return self._stream.header_bytes

    def packet_part(self, index: int, start: int, end: int) -> bytes:
        """Bytes `start` to `end` of packet `index`."""
        offset = self._stream.packet_offset(index)
        return self._opened.read(offset + start, offset + end)

    def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end` of the whole file."""
        return self._opened.read(start, end)

    async def load(self) -> None:
        """Bring what the last `packet_part` or `read` has missed with AbsentError, for the next one."""
        await self._opened.load()

    async def fetch(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end` of the whole file, while others have their turn."""
        return await self._opened.fetch(start, end)

    def close(self) -> None:
        """Let go of the bytes; may be called twice."""
        self._opened.close()


@dataclass(frozen=True)
class HostedStream:
    """A checked stream and where it lies.

    Args:
        header: its header.
        header_bytes: the same as it is sent.
        storage: the whole `.tide` file.
        packet_digests: SHA-256 of each packet's bytes, the address of the packet.
    """

    header: StreamHeader
    header_bytes: bytes
    storage: Storage
    packet_digests: tuple[bytes, ...] = field(repr=False)

    @property
    def size(self) -> int:
        """Bytes of the whole file."""
        return self.storage.size

    @property
    def fingerprint(self) -> str:
        """In hexadecimal, what tells this stream from all others; the header holds every packet's checksum."""
        return fingerprint(self.header_bytes).hex()

    @property
    def etag(self) -> str:
        """The strong entity tag of the file."""
        return f'"{self.fingerprint}"'

    def packet_offset(self, index: int) -> int:
        """Where packet `index` starts in the file; one past the last packet is the file's end."""
        return PREAMBLE_BYTES + len(self.header_bytes) + int(self.header.packet_offsets[index])

    def level_bytes(self, entry: LevelEntry) -> int:
        """How much of the file, from its start, `entry` needs."""
        return self.packet_offset(entry.packet_count)

    def open(self) -> OpenStream:
        """Open the stream for one session or one download.

        Raises:
            StreamError: the file is gone or another one by now.
        """
        return OpenStream(self, self.storage.open())


def load_stream(
    storage: Storage, limits: Limits | None = None, stopping: Callable[[], bool] = lambda: False
) -> HostedStream:
    """Read the header and check every packet of a stream; holds one packet at a time in memory.

    Args:
        storage: the whole `.tide` file.
        limits: what the header may claim.
        stopping: is asked between packets whether to give up.

    Raises:
        ContainerError, TruncatedError, PacketError, LimitError: the bytes are damaged, cut off, foreign, or too large.
        StoppedError: `stopping` said so.
        OSError: they cannot be read.
    """
    reader = ContainerReader(limits)
    size = storage.size
    with storage.open() as opened:
        position = 0
        while reader.header is None and position < size:
            end = min(position + CHUNK, size)
            reader.feed(opened.read(position, end))
            position = end
        if reader.header is None:
            reader.finish()
        header = reader.header
        assert header is not None  # noqa: S101 - finish() has raised otherwise
        stream = HostedStream(header, reader.header_bytes, storage, ())
        digests = []
        for index, entry in enumerate(header.packets):
            if stopping():
                raise StoppedError
            start = stream.packet_offset(index)
            if start + entry.length > size:
                raise TruncatedError(
                    f"the file ends after {size} of {stream.packet_offset(-1)} bytes; "
                    f"{index} of {len(header.packets)} packets are whole",
                    level=entry.level,
                    packet=entry.kind.label,
                    offset=size - start,
                )
            data = opened.read(start, start + entry.length)
            check_packet(header, index, data)
            digests.append(hashlib.sha256(data).digest())
    if stream.packet_offset(-1) != size:
        surplus = size - stream.packet_offset(-1)
        raise ContainerError(f"{surplus} bytes follow the last packet; the file is damaged", offset=size - surplus)
    return replace(stream, packet_digests=tuple(digests))
