"""Reading a `.tide` file from where it lies, without sockets or clocks (Sans-I/O).

`FileSession` says which bytes of the file it needs next, takes bytes in pieces of any size, and gives the same events
as a streaming session. Where ranges can be asked for, that is the header, then what is missing of the wanted packets in
one range; where they cannot, the file is fed from its first byte, and what is held already is passed over. The header
is always read anew: it shows whether what is held belongs to the same stream.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import ContainerError, StreamError, TruncatedError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import PREAMBLE_BYTES, ContainerReader, check_packet
from meshtide_codec.stream.session import DoneEvent, HeaderEvent, PacketEvent, Until
from meshtide_codec.stream.shortage import find_shortage

if TYPE_CHECKING:
    from meshtide_codec.stream.header import StreamHeader
    from meshtide_codec.stream.session import Event

FIRST_BYTES = 4096
"""What is asked for first when nothing is known: most headers have fewer, and the rest is of use too."""
_LENGTH_FIELD = slice(10, 14)
"""Where the preamble holds the length of the header."""


class FileSession:
    """The reader of one file.

    Args:
        until: how much of it is wanted.
        held_header: header bytes of a stream that was begun earlier, or empty.
        held: how many of its packets, from the first, are there already.
        limits: what the header may claim.
    """

    def __init__(
        self,
        *,
        until: Until | None = None,
        held_header: bytes = b"",
        held: int = 0,
        limits: Limits | None = None,
    ) -> None:
        self._until = until or Until()
        self._limits = limits or Limits()
        self._held_header = held_header
        self._held = held if held_header else 0
        self._reader = ContainerReader(self._limits)
        self._preamble_read = False
        self._pending = bytearray()
        self._position = 0
        self._start = 0
        self._index = 0
        self._wanted = 0
        self._more = True
        self._sent_packets = self._sent_bytes = 0
        self._problem: StreamError | None = None
        self.header: StreamHeader | None = None
        self.finished = False
        self.received_bytes = 0
        """Bytes of the file that have arrived, those that were passed over included."""

    @property
    def position(self) -> int:
        """Which byte of the file comes next."""
        return self._position + len(self._pending)

    def wanted(self) -> tuple[int, int]:
        """The range [start, end) of the file that is needed next; not empty until the session is finished."""
        if self.header is not None:
            return self.position, self._offset(self._wanted)
        if self._preamble_read:
            return self.position, self._header_end()
        first = PREAMBLE_BYTES + len(self._held_header) if self._held_header else FIRST_BYTES
        return self.position, first

    def feed(self, data: bytes | memoryview) -> list[Event]:
        """Take the bytes of the file that follow those before.

        Returns:
            What became complete by them; if it ends before damaged bytes, `check` raises what is wrong with those.

        Raises:
            ContainerError, PacketError, LimitError: they are damaged, foreign, or over the limits.
        """
        self.check()
        self.received_bytes += len(data)
        if self.finished:
            return []
        self._pending += data
        events: list[Event] = []
        try:
            if self.header is None:
                self._read_header(events)
            if self.header is not None:
                self._pass_over()
                self._read_packets(self.header, events)
        except StreamError as error:
            self._problem = error
            if not events:
                raise
        return events

    def check(self) -> None:
        """Raise what is wrong with the bytes after those of the last events, if anything is."""
        if self._problem is not None:
            raise self._problem

    def skip(self) -> None:
        """Go on where the first byte stands that is of use, as a range does; nothing is pending then."""
        if self.header is not None and self.position < self._start:
            self._pending.clear()
            self._position = self._start

    def end(self, size: int) -> None:
        """Take note that the file has no more than `size` bytes.

        Raises:
            TruncatedError: it should have.
        """
        self.check()
        if self.finished:
            return
        if size == 0:
            raise TruncatedError("the file is empty; nothing can be decoded")
        if self.header is None:
            raise TruncatedError(f"the file ends after {size} bytes, inside its header; nothing can be decoded")
        entry = self.header.packets[self._index]
        raise TruncatedError(
            f"the file ends after {size} bytes; {find_shortage(self.header, range(self._index), self._wanted)}",
            level=entry.level,
            packet=entry.kind.label,
            offset=max(size - self._offset(self._index), 0),
        )

    def _read_header(self, events: list[Event]) -> None:
        if not self._preamble_read:
            if len(self._pending) < PREAMBLE_BYTES:
                return
            self._reader.feed(bytes(self._pending[:PREAMBLE_BYTES]))  # raises if it is not a preamble
            self._preamble_read = True
        end = self._header_end()
        if len(self._pending) < end:
            return
        self._reader.feed(bytes(self._pending[PREAMBLE_BYTES:end]))
        header, header_bytes = self._reader.header, self._reader.header_bytes
        assert header is not None  # noqa: S101 - it has been fed to its end
        self.header = header
        resumed = header_bytes == self._held_header
        self._index = self._held if resumed else 0
        bound = self._until.packet_count(header, len(header_bytes))
        self._wanted = max(bound, self._index)
        self._more = bound < len(header.packets)
        self._start = self._offset(self._index)
        events.append(HeaderEvent(header, header_bytes, resumed))

    def _pass_over(self) -> None:
        """Drop what is pending of the header and of packets that are held."""
        surplus = min(self._start - self._position, len(self._pending))
        if surplus > 0:
            del self._pending[:surplus]
            self._position += surplus

    def _read_packets(self, header: StreamHeader, events: list[Event]) -> None:
        done = 0
        while self._position + done == self._offset(self._index) and self._index < self._wanted:
            length = header.packets[self._index].length
            if len(self._pending) - done < length:
                break
            data = bytes(self._pending[done : done + length])
            events.append(PacketEvent(self._index, check_packet(header, self._index, data), data))
            done += length
            self._index += 1
            self._sent_packets += 1
            self._sent_bytes += length
        del self._pending[:done]
        self._position += done
        self._start = self._offset(self._index)
        if self._index >= self._wanted:
            if self._wanted == len(header.packets) and self._pending:
                raise ContainerError(
                    f"{len(self._pending)} bytes follow the last packet; the file is damaged", offset=self._position
                )
            self.finished = True
            events.append(DoneEvent(self._sent_packets, self._sent_bytes, more=self._more))

    def _header_end(self) -> int:
        return PREAMBLE_BYTES + int.from_bytes(self._pending[_LENGTH_FIELD], "little")

    def _offset(self, index: int) -> int:
        assert self.header is not None  # noqa: S101 - asked for only once it is there
        return PREAMBLE_BYTES + len(self._reader.header_bytes) + int(self.header.packet_offsets[index])
