"""A stream that the server may send: its header in memory, its packets read where they lie.

`load_stream` checks every packet against the header's table once, before anybody is sent a byte of it; sessions and
downloads then open the bytes anew, so that a file that was replaced meanwhile is noticed.
"""

from __future__ import annotations

import hashlib
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from meshtide_codec.errors import ContainerError, TruncatedError
from meshtide_codec.stream.container import PREAMBLE_BYTES, ContainerReader, check_packet, fingerprint

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.limits import Limits
    from meshtide_codec.stream.header import LevelEntry, StreamHeader
    from meshtide_server.store.protocol import OpenRanges, RangeReader
    from meshtide_server.store.range_reader import FileReader, MemoryReader

CHUNK = 1 << 16
"""Bytes read at a time until the header is known."""


class StoppedError(Exception):
    """The server is shutting down; what was under way is of no more use."""


@dataclass(frozen=True)
class HostedStream:
    """A checked stream and where it lies.

    Args:
        header: its header.
        header_bytes: the same as it is sent.
        reader: of the whole `.tide` file.
        packet_digests: SHA-256 of each packet's bytes, the address of the packet.
    """

    header: StreamHeader
    header_bytes: bytes
    reader: RangeReader
    packet_digests: tuple[bytes, ...] = field(repr=False)

    @property
    def size(self) -> int:
        """Bytes of the whole file."""
        return self.packet_offset(-1)

    @property
    def fingerprint(self) -> str:
        """In hexadecimal, what distinguishes this stream from all others; the header holds every packet's checksum."""
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

    def open(self) -> OpenRanges:
        """Open the file for one session or one download, which has to close it.

        Raises:
            StreamError: it is gone or another one by now.
        """
        return self.reader.open()


def load_stream(
    file: FileReader | MemoryReader, limits: Limits | None = None, stopping: Callable[[], bool] = lambda: False
) -> HostedStream:
    """Read the header and check every packet of a stream; holds one packet at a time in memory.

    Args:
        file: the whole `.tide` file.
        limits: what the header may claim.
        stopping: is asked between packets whether to give up.

    Raises:
        ContainerError, TruncatedError, PacketError, LimitError: the bytes are damaged, cut off, foreign, or too large.
        StoppedError: `stopping` said so.
        OSError: they cannot be read.
    """
    reader = ContainerReader(limits)
    size = file.size
    with closing(file.open()) as opened:
        position = 0
        while reader.header is None and position < size:
            end = min(position + CHUNK, size)
            reader.feed(opened.at_hand(position, end))
            position = end
        if reader.header is None:
            reader.finish()
        header = reader.header
        assert header is not None  # noqa: S101 - finish() has raised otherwise
        stream = HostedStream(header, reader.header_bytes, file, ())
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
            data = opened.at_hand(start, start + entry.length)
            check_packet(header, index, data)
            digests.append(hashlib.sha256(data).digest())
    if stream.packet_offset(-1) != size:
        surplus = size - stream.packet_offset(-1)
        raise ContainerError(f"{surplus} bytes follow the last packet; the file is damaged", offset=size - surplus)
    return replace(stream, packet_digests=tuple(digests))
