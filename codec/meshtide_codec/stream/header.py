"""The stream header: everything that a receiver knows before the first packet.

It holds the quantization, the profile and its options, a table of all packets (kind, level, slice, length, CRC-32) and
a table of the states that a client can show: after how many packets, how many vertices and faces, and how far that
mesh is from the finest one. The core writes and reads its bytes (docs/format.md, Header).
"""

from __future__ import annotations

import math
import zlib
from ctypes import byref
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.errors import OptionError
from meshtide_codec.limits import Limits
from meshtide_codec.packets import Packet, PacketKind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.profile import ProfileHeader

FORMAT_VERSION = 4
"""The one that this program writes and reads."""

HEADERS = {kind.number: kind for kind in (ClassicHeader, CompactHeader)}
"""The class of each profile's own fields, by the profile's number."""

TELLS_SIZES = frozenset({PacketKind.BASE, PacketKind.MAP_CONN, PacketKind.PREVIEW})
"""The packets that say what vertices and faces there are."""


@dataclass(frozen=True, slots=True)
class LevelEntry:
    """One state that a client can show.

    Args:
        level: number of the level, 0 the finest.
        packet_count: how many packets, in transmission order, have to be there.
        vertices: its vertex count.
        faces: its face count.
        rms: root mean square distance from the finest mesh, as a fraction of its bounding box's diagonal;
            a value of `stored_distances`.
        maximum: largest distance, in the same unit and likewise.
    """

    level: int
    packet_count: int
    vertices: int
    faces: int
    rms: float
    maximum: float

    @property
    def rank(self) -> float:
        """By which states are compared, the better the less: their RMS distance, as far as it says anything.

        Only level 0 is the finest mesh; another state that claims to be as near proves nothing that would make a later
        one worse.
        """
        return math.inf if self.level and self.rms == 0.0 else self.rms


@dataclass(frozen=True, slots=True)
class PacketEntry:
    """One row of the packet table.

    Args:
        kind: what the packet holds.
        level: the level that it helps to build.
        slice: which part of that level.
        length: bytes of its payload.
        checksum: CRC-32 of those bytes.
    """

    kind: PacketKind
    level: int
    slice: int
    length: int
    checksum: int

    @classmethod
    def of(cls, packet: Packet) -> PacketEntry:
        """The row for `packet`."""
        return cls(packet.kind, packet.level, packet.slice, len(packet.payload), zlib.crc32(packet.payload))


@dataclass(frozen=True)
class StreamHeader:
    """What a stream says of itself.

    Args:
        options: what the decoder of its profile needs to know.
        bits: B, quantization bits per coordinate.
        origin: (3,) position of grid point (0, 0, 0).
        extent: length of the grid's side.
        levels: the states that can be shown, in the order in which they become complete.
        packets: the packets, in transmission order.
    """

    options: ProfileHeader
    bits: int
    origin: tuple[float, float, float]
    extent: float
    levels: tuple[LevelEntry, ...]
    packets: tuple[PacketEntry, ...]

    @property
    def profile(self) -> str:
        """The coding profile: "compact" or "classic"."""
        return self.options.profile

    @property
    def vertices(self) -> int:
        """Vertices of the finest level."""
        return self.levels[-1].vertices

    @property
    def faces(self) -> int:
        """Faces of the finest level."""
        return self.levels[-1].faces

    @cached_property
    def packet_offsets(self) -> NDArray[np.int64]:
        """(packets + 1,) int64: where each packet starts, counted from the first; the last is their total length."""
        return np.concatenate([[0], np.cumsum([entry.length for entry in self.packets], dtype=np.int64)])

    def level_bytes(self, entry: LevelEntry) -> int:
        """Bytes of packets that `entry` needs."""
        return int(self.packet_offsets[entry.packet_count])

    @cached_property
    def size_bytes(self) -> int:
        """Bytes of the packets that say what vertices and faces there are, see `Limits.vertices_per_byte`."""
        return sum(packet.length for packet in self.packets if packet.kind in TELLS_SIZES)

    def entry(self, level: int) -> LevelEntry:
        """The row of the last state of `level`.

        Raises:
            KeyError: the stream has no such level.
        """
        for row in reversed(self.levels):
            if row.level == level:
                return row
        raise KeyError(level)

    def packet_count(self, level: int) -> int:
        """How many packets, from the first, a level needs; one without a state of its own needs the next finer's.

        Raises:
            KeyError: the stream has no level so fine.
        """
        for row in self.levels:
            if row.level == level:
                return self.entry(level).packet_count
        for row in self.levels:
            if row.level < level:
                return row.packet_count
        raise KeyError(level)

    def to_bytes(self) -> bytes:
        """The header as it is sent and stored.

        Raises:
            OptionError: it says something that no header can say.
        """
        rows = [(row.length, row.checksum, row.slice, row.level, row.kind) for row in self.packets]
        sizes = [(row.vertices, row.faces, row.rms, row.maximum, row.packet_count, row.level) for row in self.levels]
        try:
            packets, states = np.array(rows, core.PACKET), np.array(sizes, core.STATE)
        except OverflowError as error:
            raise OptionError(f"a packet or a level that no header can hold: {error}") from error
        header = core.Header(
            bits=self.bits,
            origin=self.origin,
            extent=self.extent,
            packets=packets.ctypes.data,
            packet_count=len(packets),
            states=states.ctypes.data,
            state_count=len(states),
        )
        kept = self.options.fill(header)
        handle, data = core.Handle("mt_stream_free"), core.Bytes()
        core.call("mt_stream_write", byref(header), byref(handle.pointer), byref(data))
        del kept
        return data.copied()

    @classmethod
    def from_bytes(cls, data: bytes | memoryview, limits: Limits | None = None) -> StreamHeader:
        """The header that `to_bytes` wrote, with every claim held against `limits`.

        Raises:
            LimitError: a claim over the limits.
            VersionError: it is of another format version.
            ContainerError: anything else that is wrong.
        """
        limits = limits or Limits()
        handle = parsed(data, limits)
        header = core.library().mt_stream_header(handle).contents
        packets = core.copied(header.packets, (header.packet_count,), core.PACKET)
        states = core.copied(header.states, (header.state_count,), core.STATE)
        for vertices, faces, *_, level in states.tolist():
            limits.check_mesh(vertices, faces, level=level)
        options = HEADERS[header.profile].of(header)
        return cls(
            options=options,
            bits=header.bits,
            origin=tuple(header.origin),
            extent=header.extent,
            levels=tuple(
                LevelEntry(level, needed, vertices, faces, rms, maximum)
                for vertices, faces, rms, maximum, needed, level in states.tolist()
            ),
            packets=tuple(
                PacketEntry(PacketKind(kind), level, part, length, checksum)
                for length, checksum, part, level, kind in packets.tolist()
            ),
        )


def parsed(data: bytes | memoryview, limits: Limits) -> core.Handle:
    """A header as the core reads it, for a decoder.

    Raises:
        LimitError, VersionError, ContainerError: as for `StreamHeader.from_bytes`.
    """
    handle = core.Handle("mt_stream_free")
    core.call("mt_stream_parse", bytes(data), len(data), byref(core.Limited.of(limits)), byref(handle.pointer))
    return handle


def check_version(version: int) -> None:
    """Raise VersionError unless this program reads streams of `version`."""
    if version != FORMAT_VERSION:
        raise core.version_error(version, FORMAT_VERSION)


def packet_table(packets: Sequence[Packet]) -> tuple[tuple[PacketEntry, ...], list[bytes]]:
    """The packet table of `packets`, and their bytes."""
    return tuple(PacketEntry.of(packet) for packet in packets), [packet.payload for packet in packets]
