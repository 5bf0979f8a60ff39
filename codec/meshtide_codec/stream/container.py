"""The `.tide` file: magic, version, header, then the packets in transmission order.

The header comes first, so any web server can host the file, a Range request fetches any packet, and a file that is
cut off is a coarser mesh. `ContainerReader` takes the bytes in pieces of any size, from a disk or from a socket.

===========  =====  ===================================================================
bytes        type   content
===========  =====  ===================================================================
0-7          bytes  magic: 0x89 "TIDE" 0x0D 0x0A 0x1A
8-9          <u2    format version
10-13        <u4    length of the header
14-17        <u4    CRC-32 of the header
18-          bytes  header (`packed_header`), then the packets, without gaps
===========  =====  ===================================================================
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from typing import TYPE_CHECKING

from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import ContainerError, LimitError, PacketError, StreamError, TruncatedError
from meshtide_codec.limits import Limits
from meshtide_codec.packets import MAGIC, Packet
from meshtide_codec.stream.header import FORMAT_VERSION, StreamHeader, check_version

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_PREAMBLE = struct.Struct("<8sHII")
PREAMBLE_BYTES = _PREAMBLE.size


def preamble(header_bytes: bytes) -> bytes:
    """What stands in front of the packets in a file: magic, version, and the header with its length and checksum."""
    return _PREAMBLE.pack(MAGIC, FORMAT_VERSION, len(header_bytes), zlib.crc32(header_bytes)) + header_bytes


def fingerprint(header_bytes: bytes) -> bytes:
    """32 bytes that two streams share only if they are the same stream (the header holds each packet's checksum)."""
    return hashlib.sha256(header_bytes).digest()


def write_container(header: StreamHeader, packets: Iterable[bytes]) -> bytes:
    """The whole file of a stream, given its packets' bytes in the order of the header's table."""
    return preamble(header.to_bytes()) + b"".join(packets)


def check_packet(header: StreamHeader, index: int, data: bytes | memoryview) -> Packet:
    """The packet that `data` holds, verified against row `index` of the header's packet table.

    Raises:
        PacketError: wrong length or checksum.
    """
    entry = header.packets[index]
    if len(data) != entry.length:
        raise PacketError(
            f"packet {index} has {len(data)} bytes where the header promises {entry.length}",
            level=entry.level,
            packet=entry.kind.label,
        )
    checksum = zlib.crc32(data)
    if checksum != entry.checksum:
        raise PacketError(
            f"checksum is {checksum:08x}, the header says {entry.checksum:08x}; packet {index} is damaged",
            level=entry.level,
            packet=entry.kind.label,
            offset=0,
        )
    return Packet(entry.kind, entry.level, entry.slice, bytes(data))


class ContainerReader:
    """Reads a `.tide` file that arrives in pieces (Sans-I/O).

    Args:
        limits: what the header may claim.

    `feed` returns the packets that a piece completed; `header` is None until the header is there. An error leaves
    what was read before usable, and is raised again by every later call.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        check_type("limits", limits, Limits, type(None))
        self._pending = bytearray()
        self._start = 0
        self._error: Exception | None = None
        self.header: StreamHeader | None = None
        self.header_bytes = b""
        self.packets: list[Packet] = []
        self.consumed = 0
        """Bytes of whole parts (preamble, header, packets) read so far: where a download would resume."""

    @property
    def complete(self) -> bool:
        """Whether every packet of the header's table has been read."""
        return self.header is not None and len(self.packets) == len(self.header.packets)

    def feed(self, data: bytes | memoryview) -> list[Packet]:
        """Take the next piece of the file; returns the packets that are now complete.

        Raises:
            ContainerError, PacketError, LimitError: the bytes are damaged, foreign, or over the limits.
        """
        if self._error is not None:
            raise self._error
        check_type("a stream's data", data, bytes, bytearray, memoryview, remedy="Path.read_bytes reads a file")
        self._pending += data
        first_new = len(self.packets)
        try:
            self._read()
        except Exception as error:
            self._error = error
            raise
        return self.packets[first_new:]

    def finish(self) -> None:
        """Raise TruncatedError unless the file is complete."""
        if self.header is None and not self._pending:
            raise TruncatedError("the file is empty; nothing can be decoded")
        if self.header is None:
            raise TruncatedError(
                f"the file ends after {len(self._pending)} bytes, inside its header; nothing can be decoded"
            )
        if not self.complete:
            index = len(self.packets)
            entry = self.header.packets[index]
            raise TruncatedError(
                f"the file ends after {self.consumed + len(self._pending)} bytes; "
                f"{index} of {len(self.header.packets)} packets are whole and usable",
                level=entry.level,
                packet=entry.kind.label,
                offset=len(self._pending),
            )

    def _read(self) -> None:
        if self.header is None:
            self._take(self._read_header())
            if self.header is None:
                return
        while not self.complete:
            index = len(self.packets)
            length = self.header.packets[index].length
            if len(self._pending) < self._start + length:
                break
            with memoryview(self._pending) as view, view[self._start : self._start + length] as part:
                packet = check_packet(self.header, index, part)
            self.packets.append(packet)
            self._take(length)
        del self._pending[: self._start]
        self._start = 0
        if self.complete and self._pending:
            raise ContainerError(
                f"{len(self._pending)} bytes follow the last packet; the file is damaged", offset=self.consumed
            )

    def _take(self, length: int) -> None:
        """Count bytes of a whole part; they are dropped from what is pending at the end of a piece."""
        self._start += length
        self.consumed += length

    def _read_header(self) -> int:
        """Read preamble and header if they are there; returns how many pending bytes they took."""
        known = bytes(self._pending[: len(MAGIC)])
        if known != MAGIC[: len(known)]:
            raise ContainerError("not a .tide file: the first bytes are foreign", offset=0)
        if len(self._pending) < PREAMBLE_BYTES:
            return 0
        _, version, length, checksum = _PREAMBLE.unpack_from(self._pending)
        length = int(length)
        check_version(version)
        if length > self._limits.header_bytes:
            raise LimitError(
                f"the file claims a header of {length} bytes; this decoder accepts {self._limits.header_bytes}",
                offset=10,
            )
        end = PREAMBLE_BYTES + length
        if len(self._pending) < end:
            return 0
        header_bytes = bytes(self._pending[PREAMBLE_BYTES:end])
        if zlib.crc32(header_bytes) != checksum:
            raise ContainerError("the header's checksum is wrong; the file is damaged", offset=14)
        self.header = StreamHeader.from_bytes(header_bytes, self._limits)
        self.header_bytes = header_bytes
        return end


def read_container(data: bytes | memoryview, limits: Limits | None = None) -> tuple[StreamHeader, Sequence[Packet]]:
    """Header and packets of a whole `.tide` file.

    Raises:
        TruncatedError: the file ends early.
        ContainerError, PacketError, LimitError: the bytes are damaged, foreign, or over the limits.
    """
    reader = ContainerReader(limits)
    reader.feed(data)
    reader.finish()
    assert reader.header is not None  # noqa: S101 - finish() has made sure
    return reader.header, reader.packets


def read_available(
    data: bytes | memoryview, limits: Limits | None = None
) -> tuple[StreamHeader, Sequence[Packet], StreamError | None]:
    """Header, the whole packets before the first damage or the end, and the error met there (None if complete).

    Raises:
        TruncatedError, ContainerError, LimitError: not even the header can be read.
    """
    reader = ContainerReader(limits)
    problem: StreamError | None = None
    try:
        reader.feed(data)
        reader.finish()
    except StreamError as error:
        if reader.header is None:
            raise
        problem = error
    assert reader.header is not None  # noqa: S101 - raised above otherwise
    return reader.header, reader.packets, problem
