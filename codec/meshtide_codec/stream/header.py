"""The stream header: everything that a receiver knows before the first packet.

It holds the quantization, the profile and its options, a table of all packets (kind, level, slice, length, CRC-32) and
a table of the states that a client can show: after how many packets, how many vertices and faces, and how far that
mesh is from the finest one. `packed_header` tells how its bytes are laid out.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import ContainerError, LimitError, VersionError
from meshtide_codec.limits import Limits
from meshtide_codec.quantize import LARGEST_B, SMALLEST_B, has_distinct_points, has_finite_points
from meshtide_codec.stream import packed_header, plain_values
from meshtide_codec.stream.packed_header import PlainHeader
from meshtide_codec.stream.packets import LARGEST_LEVEL, LARGEST_SLICE, Packet, PacketKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

FORMAT_VERSION = packed_header.VERSION
"""The one that this program writes and reads."""
LARGEST_VERSION = 0x7F
"""A header that begins with a greater byte is none, of whatever version."""
LONGEST_NAME = 32


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

        Only level 0 is the finest mesh; another state that says it is as near tells nothing that would make a later
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
        profile: the coding profile, such as "classic".
        options: what the profile's decoder needs to know; plain msgpack values under string keys.
        bits: B, quantization bits per coordinate.
        origin: (3,) position of grid point (0, 0, 0).
        extent: length of the grid's side.
        levels: the states that can be shown, in the order in which they become complete.
        packets: the packets, in transmission order.
    """

    profile: str
    options: Mapping[str, Any]
    bits: int
    origin: tuple[float, float, float]
    extent: float
    levels: tuple[LevelEntry, ...]
    packets: tuple[PacketEntry, ...]

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
        """The header as it is sent and stored."""
        plain = PlainHeader(
            profile=self.profile,
            options=self.options,
            bits=self.bits,
            origin=self.origin,
            extent=self.extent,
            packets=[(int(row.kind), row.level, row.slice, row.length) for row in self.packets],
            checksums=[row.checksum for row in self.packets],
            states=[(row.level, row.packet_count, row.vertices, row.faces) for row in self.levels],
            distances=[(row.rms, row.maximum) for row in self.levels],
        )
        return packed_header.pack_header(plain)

    @classmethod
    def from_bytes(cls, data: bytes | memoryview, limits: Limits | None = None) -> StreamHeader:
        """The header that `to_bytes` wrote, with every claim held against `limits`.

        Raises:
            LimitError: a claim over the limits.
            VersionError: it is of another format version.
            ContainerError: anything else that is wrong.
        """
        limits = limits or Limits()
        if len(data) > limits.header_bytes:
            raise LimitError(f"header of {len(data)} bytes; this decoder accepts {limits.header_bytes}")
        if len(data) and data[0] <= LARGEST_VERSION:
            check_version(data[0])
        try:
            return cls._checked(packed_header.unpack_header(bytes(data), limits.packets), limits, len(data))
        except plain_values.BadValueError as error:
            raise ContainerError(f"damaged stream header: {error}") from error

    @classmethod
    def _checked(cls, plain: PlainHeader, limits: Limits, length: int) -> StreamHeader:
        if not isinstance(plain.options, dict) or not all(isinstance(key, str) for key in plain.options):
            raise plain_values.BadValueError("options must be a map with string keys")
        x, y, z = (plain_values.number(value, "origin") for value in plain.origin)
        extent = plain_values.number(plain.extent, "extent", 0.0)
        if not has_finite_points((x, y, z), extent):
            raise plain_values.BadValueError("the grid reaches beyond the largest number")
        packets = _checked_packets(plain, limits)
        levels = _checked_levels(plain, limits)
        _check_shares(levels, packets, length, limits)
        if levels[-1].vertices > 1 and not has_distinct_points((x, y, z), extent):
            raise plain_values.BadValueError(f"a grid of one point for {levels[-1].vertices} vertices")
        return cls(
            profile=plain_values.text(plain.profile, "profile", LONGEST_NAME),
            options=plain.options,
            bits=plain_values.integer(plain.bits, "bits per coordinate", SMALLEST_B, LARGEST_B),
            origin=(x, y, z),
            extent=extent,
            levels=levels,
            packets=packets,
        )


def check_version(version: int) -> None:
    """Raise VersionError unless this program reads streams of `version`."""
    if version < FORMAT_VERSION:
        raise VersionError(f"the stream was written by an older meshtide (format {version}): encode it again")
    if version > FORMAT_VERSION:
        raise VersionError(
            f"the stream was written by a newer meshtide (format {version}; this one reads format {FORMAT_VERSION}): "
            "update meshtide"
        )


def _checked_levels(plain: PlainHeader, limits: Limits) -> tuple[LevelEntry, ...]:
    if len(plain.states) > limits.levels:
        raise LimitError(
            f"the stream claims {len(plain.states)} levels; this decoder accepts {limits.levels} (Limits.levels)"
        )
    levels: list[LevelEntry] = []
    for (level, needed, vertices, faces), (rms, maximum) in zip(plain.states, plain.distances, strict=True):
        entry = LevelEntry(
            level=plain_values.integer(level, "level", 0, LARGEST_LEVEL),
            packet_count=needed,
            vertices=plain_values.integer(vertices, "vertex count", 1),
            faces=plain_values.integer(faces, "face count"),
            rms=rms,
            maximum=maximum,
        )
        limits.check_mesh(entry.vertices, entry.faces, level=entry.level)
        levels.append(entry)
    if not levels or levels[-1].level != 0:
        raise plain_values.BadValueError("the level table does not end with level 0")
    return tuple(levels)


def _check_shares(
    levels: Sequence[LevelEntry], packets: Sequence[PacketEntry], header_bytes: int, limits: Limits
) -> None:
    """Hold the sizes of levels against the bytes that tell of them: Diffs may be missing, so they do not count."""
    by_level = [header_bytes] + [0] * (LARGEST_LEVEL + 1)
    for packet in packets:
        if packet.kind in TELLS_SIZES:
            by_level[LARGEST_LEVEL - packet.level + 1] += packet.length
    known = list(accumulate(by_level))
    for row in levels:
        limits.check_share(row.vertices, row.faces, known[LARGEST_LEVEL - row.level + 1], level=row.level)


def _checked_packets(plain: PlainHeader, limits: Limits) -> tuple[PacketEntry, ...]:
    count = len(plain.packets)
    if count == 0:
        raise plain_values.BadValueError("the packet table is empty")
    if count > limits.packets:
        raise LimitError(f"the stream claims {count} packets; this decoder accepts {limits.packets} (Limits.packets)")
    entries = []
    for i, ((kind, level, part, size), checksum) in enumerate(zip(plain.packets, plain.checksums, strict=True)):
        entry = PacketEntry(
            kind=PacketKind(plain_values.integer(kind, "packet kind", 0, max(PacketKind))),
            level=plain_values.integer(level, "packet level", 0, LARGEST_LEVEL),
            slice=plain_values.integer(part, "packet slice", 0, LARGEST_SLICE),
            length=plain_values.integer(size, "packet length"),
            checksum=checksum,
        )
        if entry.length > limits.packet_bytes:
            raise LimitError(
                f"packet {i} claims {entry.length} bytes; this decoder accepts {limits.packet_bytes}",
                level=entry.level,
                packet=entry.kind.label,
            )
        entries.append(entry)
    return tuple(entries)


def packet_table(packets: Sequence[Packet]) -> tuple[tuple[PacketEntry, ...], list[bytes]]:
    """The packet table of `packets`, and their bytes."""
    return tuple(PacketEntry.of(packet) for packet in packets), [packet.payload for packet in packets]
