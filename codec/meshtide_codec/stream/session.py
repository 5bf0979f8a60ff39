"""The streaming session, both ends of it, without sockets or clocks (Sans-I/O).

`ServerSession` is fed the client's frames and says what to send, one frame or one part of a packet at a time, never
more bytes than the client has granted; where the packets lie, and how they are read, is not its business.
`ClientSession` is fed the server's frames, checks and joins them, and yields packets and the frames that grant more
credit. A client that reconnects says what it holds; no packet that it holds is sent again. What a server claims of the
stream's end is not believed: the client works out which packets are due, and is finished only when it holds them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from meshtide_codec.errors import OptionError, PeerError, ProtocolError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import PREAMBLE_BYTES, check_packet, fingerprint
from meshtide_codec.stream.header import StreamHeader
from meshtide_codec.stream.messages import (
    LARGEST_PART,
    LONGEST_TEXT,
    PROTOCOL_VERSION,
    Credit,
    Done,
    Error,
    HeaderPart,
    Hello,
    PacketPart,
    decode_message,
    encode_message,
)
from meshtide_codec.stream.shortage import find_shortage

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from meshtide_codec.packets import Packet, PacketKind

DEFAULT_WINDOW = 1 << 20
"""Bytes in flight that a client allows: at 50 ms round trip that is up to 20 MB/s."""


@dataclass(frozen=True, slots=True)
class PacketRange:
    """Bytes `start` to `end` of packet `index`, which are to be read and sent next."""

    index: int
    start: int
    end: int

    def frame(self, data: bytes) -> bytes:
        """The frame that carries them, once they are read."""
        return encode_message(PacketPart(self.index, self.start, data))


@dataclass(frozen=True, slots=True)
class Until:
    """How much of a stream is wanted; the first bound that is met ends it.

    Args:
        level: no more than this level needs (0 is the finest); the coarsest level if the stream has fewer.
        error: stop at the first state whose RMS distance is at most this fraction of the diagonal.
        size: the file so far (preamble, header and packets) stays within so many bytes.
    """

    level: int | None = None
    error: float | None = None
    size: int | None = None

    def __post_init__(self) -> None:
        for name in ("level", "error", "size"):
            value = getattr(self, name)
            if value is not None and not value >= 0:
                raise OptionError(f"the bound on the {name} must not be negative: {value}")

    def packet_count(self, header: StreamHeader, header_length: int) -> int:
        """How many packets, from the first, `header`'s stream needs to meet the bounds."""
        count = len(header.packets)
        if self.level is not None:
            coarser = [row.packet_count for row in header.levels if row.level >= self.level]
            count = min(count, max(coarser, default=header.levels[0].packet_count))
        if self.error is not None:
            count = min([count, *(row.packet_count for row in header.levels if row.rms <= self.error)])
        if self.size is not None:
            left = self.size - PREAMBLE_BYTES - header_length
            fitting = int((header.packet_offsets[1:] <= left).sum())
            count = min(count, fitting)
        return count


class ServerSession:
    """The server's end of one stream.

    Args:
        mesh: id of the mesh that the connection is for.
        header: of its stream.
        header_bytes: the same as it is sent.

    Feed each frame of the client to `receive`; send what `next` names until it returns None, which means that nothing
    may be sent before the client grants more credit, or that all is sent (`finished`).
    """

    def __init__(self, mesh: str, header: StreamHeader, header_bytes: bytes) -> None:
        self._mesh = mesh
        self._header = header
        self._header_bytes = header_bytes
        self._credit = 0
        self._runs: Iterator[_Run] | None = None
        self._run: _Run | None = None
        self._offset = 0
        self.finished = False
        self.sent_bytes = 0
        """Bytes of parts named so far."""
        self.sent_by_kind: dict[PacketKind | None, int] = {}
        """The same by kind of packet, None for the header; whoever counts them may clear it."""

    @property
    def greeted(self) -> bool:
        """Whether the client's hello has arrived."""
        return self._runs is not None

    def receive(self, frame: bytes | str) -> None:
        """Take one frame of the client.

        Raises:
            ProtocolError: it is malformed, or comes out of turn.
            PeerError: the client gave up.
        """
        message = decode_message(frame)
        if isinstance(message, Error):
            raise PeerError(message.code, message.message)
        if isinstance(message, Hello) and self._runs is None:
            self._greet(message)
        elif isinstance(message, Credit) and self._runs is not None:
            if not message.size:
                raise ProtocolError("a credit of 0 bytes grants nothing; it is not to be sent")
            self._credit += message.size
        else:
            raise ProtocolError(f"{type(message).__name__} is not expected here")

    def next(self) -> bytes | PacketRange | None:
        """What to send next: a frame, or a part of a packet, which is to be read; None while there is nothing."""
        if self._runs is None or self.finished:
            return None
        if self._run is None:
            self._run, self._offset = next(self._runs), 0
        run, start = self._run, self._offset
        size = min(run.length - start, LARGEST_PART, self._credit)
        if size == 0 and run.length:
            return None
        self._credit -= size
        self.sent_bytes += size
        if size:
            self.sent_by_kind[run.kind] = self.sent_by_kind.get(run.kind, 0) + size
        self._offset += size
        if self._offset == run.length:
            self._run = None
        self.finished = run.is_last
        return run.part(start, start + size)

    def _greet(self, hello: Hello) -> None:
        if hello.protocol != PROTOCOL_VERSION:
            raise ProtocolError(
                f"the client speaks protocol version {hello.protocol}, this server version {PROTOCOL_VERSION}"
            )
        if hello.mesh != self._mesh:
            raise ProtocolError(f"hello asks for mesh {hello.mesh!r} on the connection of {self._mesh!r}")
        self._credit = hello.credit
        self._runs = self._plan(hello)

    def _plan(self, hello: Hello) -> Iterator[_Run]:
        """All that has to be sent, in order; the last run is Done."""
        header, header_bytes = self._header, self._header_bytes
        mark = fingerprint(header_bytes)
        resumed = hello.fingerprint == mark
        total = len(header_bytes)
        yield _Run(
            0 if resumed else total,
            lambda start, end: encode_message(HeaderPart(mark, total, start, header_bytes[start:end])),
        )
        until = Until(hello.until_level, hello.until_error, hello.until_bytes)
        wanted = until.packet_count(header, total)
        packets = size = 0
        for index in _missing(hello.held if resumed else (), wanted):
            entry = header.packets[index]
            yield _Run(entry.length, partial(PacketRange, index), entry.kind)
            packets += 1
            size += entry.length
        done = encode_message(Done(packets, size, more=wanted < len(header.packets)))
        yield _Run(0, lambda _start, _end: done, is_last=True)


@dataclass(frozen=True, slots=True)
class _Run:
    """Bytes that cost credit and follow each other, and what is to be sent for those from `start` to `end`."""

    length: int
    part: Callable[[int, int], bytes | PacketRange]
    kind: PacketKind | None = None
    is_last: bool = False


@dataclass(frozen=True, slots=True)
class HeaderEvent:
    """The stream's header is known; `resumed`: whether the packets held before still belong to it."""

    header: StreamHeader
    header_bytes: bytes
    resumed: bool


@dataclass(frozen=True, slots=True)
class PacketEvent:
    """Packet `index` is there and verified; `data` are its bytes as they are in a file."""

    index: int
    packet: Packet
    data: bytes


@dataclass(frozen=True, slots=True)
class DoneEvent:
    """All that was asked for is held; so many packets and bytes came now; `more`: whether the stream goes on.

    The session counts them itself; what the server says of them is not believed.
    """

    packets: int
    size: int
    more: bool


Event = HeaderEvent | PacketEvent | DoneEvent


class ClientSession:
    """The client's end of one stream.

    Args:
        mesh: id of the mesh.
        until: how much of it is wanted.
        held_header: header bytes of a stream that was begun earlier, or empty.
        held: indices of its packets that are there already.
        window: bytes in flight that the server is allowed.
        limits: what the header may claim.
    """

    def __init__(
        self,
        mesh: str,
        *,
        until: Until | None = None,
        held_header: bytes = b"",
        held: Iterable[int] = (),
        window: int = DEFAULT_WINDOW,
        limits: Limits | None = None,
    ) -> None:
        if window < 1:
            raise OptionError(f"the window must be at least 1 byte, not {window}")
        self._mesh = mesh
        self._until = until or Until()
        self._limits = limits or Limits()
        self._window = window
        self._ungranted = 0
        self._held_header = held_header
        self._held = set(held) if held_header else set()
        self._pending = bytearray()
        self._pending_index: int | None = None
        self._mark = b""
        self._wanted = 0
        self._packets = 0
        self._packet_bytes = 0
        self.header: StreamHeader | None = None
        self.finished = False
        self.received_bytes = 0
        """Bytes of parts received so far."""

    def hello(self) -> bytes:
        """The frame that opens the stream."""
        return encode_message(
            Hello(
                protocol=PROTOCOL_VERSION,
                mesh=self._mesh,
                fingerprint=fingerprint(self._held_header) if self._held_header else b"",
                held=_ranges(self._held),
                until_level=self._until.level,
                until_error=self._until.error,
                until_bytes=self._until.size,
                credit=self._window,
            )
        )

    def credit_frame(self) -> bytes | None:
        """A frame that grants the server what has been received since the last grant, once that is worth a frame."""
        if self.finished or 2 * self._ungranted < self._window:
            return None
        granted, self._ungranted = self._ungranted, 0
        return encode_message(Credit(granted))

    def receive(self, frame: bytes | str) -> list[Event]:
        """Take one frame of the server.

        Raises:
            ProtocolError: it is malformed or out of turn, or says that all is sent while packets are missing.
            PeerError: the server refused.
            StreamError: header or packet are damaged or over the limits.
        """
        if self.finished:
            raise ProtocolError("a message arrived after the end of the stream")
        message = decode_message(frame)
        if isinstance(message, HeaderPart) and self.header is None:
            return self._take_header(message)
        if isinstance(message, PacketPart) and self.header is not None:
            return self._take_packet(self.header, message)
        if isinstance(message, Done):
            return [self._end(self.header)]
        if isinstance(message, Error):
            raise PeerError(message.code, message.message)
        raise ProtocolError(f"{type(message).__name__} is not expected here")

    def _end(self, header: StreamHeader | None) -> DoneEvent:
        """The server says that it has sent everything; it counts only if all that is due is held."""
        if header is None:
            raise ProtocolError("the server says that all is sent before the header was")
        if (shortage := find_shortage(header, self._held, self._wanted)) is not None:
            raise ProtocolError(f"the server says that all is sent, but {shortage}")
        self.finished = True
        return DoneEvent(self._packets, self._packet_bytes, more=self._wanted < len(header.packets))

    def _begin(self, header_bytes: bytes, *, resumed: bool) -> list[Event]:
        self.header = StreamHeader.from_bytes(header_bytes, self._limits)
        self._wanted = self._until.packet_count(self.header, len(header_bytes))
        if not resumed:
            self._held.clear()
        return [HeaderEvent(self.header, header_bytes, resumed)]

    def _take_header(self, part: HeaderPart) -> list[Event]:
        if self._held_header and not part.data:
            if part.fingerprint != fingerprint(self._held_header):
                raise ProtocolError("the server skipped a header that this client does not hold")
            return self._begin(self._held_header, resumed=True)
        self._count(part.data)
        if part.offset != len(self._pending) or (self._mark and part.fingerprint != self._mark):
            raise ProtocolError("the parts of the header do not follow each other")
        if part.total > self._limits.header_bytes or part.offset + len(part.data) > part.total or not part.data:
            raise ProtocolError(f"a header of {part.total} bytes is announced; part at {part.offset} does not fit")
        self._mark = part.fingerprint
        self._pending += part.data
        if len(self._pending) < part.total:
            return []
        header_bytes = bytes(self._pending)
        self._pending.clear()
        if fingerprint(header_bytes) != part.fingerprint:
            raise ProtocolError("the header does not match its fingerprint")
        return self._begin(header_bytes, resumed=header_bytes == self._held_header)

    def _take_packet(self, header: StreamHeader, part: PacketPart) -> list[Event]:
        self._count(part.data)
        if part.index >= self._wanted or part.index in self._held:
            raise ProtocolError(f"packet {part.index} was not asked for")
        if self._pending_index not in (None, part.index) or part.offset != len(self._pending):
            raise ProtocolError(f"the parts of packet {part.index} do not follow each other")
        length = header.packets[part.index].length
        if (not part.data and length) or part.offset + len(part.data) > length:
            raise ProtocolError(f"a part of packet {part.index} does not fit its {length} bytes")
        self._pending_index = part.index
        self._pending += part.data
        if len(self._pending) < length:
            return []
        data = bytes(self._pending)
        self._pending.clear()
        self._pending_index = None
        packet = check_packet(header, part.index, data)
        self._held.add(part.index)
        self._packets += 1
        self._packet_bytes += length
        return [PacketEvent(part.index, packet, data)]

    def _count(self, data: bytes) -> None:
        self.received_bytes += len(data)
        self._ungranted += len(data)


def error_frame(code: str, message: str) -> bytes:
    """The frame with which either side gives up."""
    return encode_message(Error(code, message[:LONGEST_TEXT]))


def _missing(held: Iterable[tuple[int, int]], wanted: int) -> Iterator[int]:
    """Indices below `wanted` outside the ascending ranges `held`."""
    position = 0
    for first, end in held:
        yield from range(position, min(first, wanted))
        position = end
    yield from range(position, wanted)


def _ranges(indices: Iterable[int]) -> tuple[tuple[int, int], ...]:
    """Ascending [first, end) ranges of a set of indices."""
    ranges: list[tuple[int, int]] = []
    for index in sorted(indices):
        if ranges and ranges[-1][1] == index:
            ranges[-1] = (ranges[-1][0], index + 1)
        else:
            ranges.append((index, index + 1))
    return tuple(ranges)
