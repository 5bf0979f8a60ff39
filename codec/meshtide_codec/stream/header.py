"""The stream header: everything that a receiver knows before the first packet.

A msgpack map from small integers (`Field`) to values. It holds the quantization, the profile and its options, a
table of all packets (kind, level, slice, length, CRC-32) and a table of the states that a client can show: after
how many packets, how many vertices and faces, and how far that mesh is from the finest one.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import ContainerError, LimitError, VersionError
from meshtide_codec.limits import Limits
from meshtide_codec.quantize import LARGEST_B, SMALLEST_B
from meshtide_codec.stream import plain_values, tables
from meshtide_codec.stream.packets import LARGEST_LEVEL, LARGEST_SLICE, Packet, PacketKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

FORMAT_VERSION = 2
"""What this program writes; it reads version 1 too."""
LONGEST_NAME = 32
CHECKSUM_BYTES = 4
DISTANCE_BYTES = 4


class Field(IntEnum):
    """Keys of the header map."""

    PROFILE = 0
    OPTIONS = 1
    BITS = 2
    ORIGIN = 3
    EXTENT = 4
    LEVELS = 5
    PACKETS = 6
    CHECKSUMS = 7
    DISTANCES = 8
    """Version 1 only."""


_FIELDS = {
    1: frozenset(int(field) for field in Field),
    2: frozenset(int(field) for field in Field if field != Field.DISTANCES),
}


@dataclass(frozen=True, slots=True)
class LevelEntry:
    """One state that a client can show.

    Args:
        level: number of the level, 0 the finest.
        packet_count: how many packets, in transmission order, have to be there.
        vertices: its vertex count.
        faces: its face count.
        rms: root mean square distance from the finest mesh, as a fraction of its bounding box's diagonal;
            a value of `stored_distance`.
        maximum: largest distance, in the same unit.
    """

    level: int
    packet_count: int
    vertices: int
    faces: int
    rms: float
    maximum: float


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
        version: of the format that it is written in.
    """

    profile: str
    options: Mapping[str, Any]
    bits: int
    origin: tuple[float, float, float]
    extent: float
    levels: tuple[LevelEntry, ...]
    packets: tuple[PacketEntry, ...]
    version: int = FORMAT_VERSION

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
        states = [(row.level, row.packet_count, row.vertices, row.faces) for row in self.levels]
        packets = [(int(row.kind), row.level, row.slice, row.length) for row in self.packets]
        distances = [_pack_distance(row.rms) + _pack_distance(row.maximum) for row in self.levels]
        fields: dict[int, Any] = {
            int(Field.PROFILE): self.profile,
            int(Field.OPTIONS): dict(self.options),
            int(Field.BITS): self.bits,
            int(Field.ORIGIN): list(self.origin),
            int(Field.EXTENT): self.extent,
        }
        checksums = b"".join(struct.pack("<I", row.checksum) for row in self.packets)
        if self.version == 1:
            fields[int(Field.LEVELS)] = [number for state in states for number in state]
            fields[int(Field.PACKETS)] = [number for packet in packets for number in packet]
            fields[int(Field.CHECKSUMS)] = checksums
            fields[int(Field.DISTANCES)] = b"".join(distances)
        else:
            fields[int(Field.LEVELS)] = tables.pack_states(states, distances, [row.level for row in self.packets])
            fields[int(Field.PACKETS)] = tables.pack_packets(packets)
            fields[int(Field.CHECKSUMS)] = checksums
        return plain_values.pack(fields)

    @classmethod
    def from_bytes(cls, data: bytes | memoryview, limits: Limits | None = None) -> StreamHeader:
        """The header that `to_bytes` wrote, with every claim held against `limits`.

        Raises:
            LimitError: a claim over the limits.
            ContainerError: anything else that is wrong.
        """
        limits = limits or Limits()
        if len(data) > limits.header_bytes:
            raise LimitError(f"header of {len(data)} bytes; this decoder accepts {limits.header_bytes}")
        try:
            return cls._from_value(plain_values.unpack(data, len(data)), limits)
        except plain_values.BadValueError as error:
            raise ContainerError(f"damaged stream header: {error}") from error

    @classmethod
    def _from_value(cls, value: object, limits: Limits) -> StreamHeader:
        if not isinstance(value, dict) or set(value) not in _FIELDS.values():
            raise plain_values.BadValueError("its fields are not those of a meshtide stream header")
        version = next(version for version, fields in _FIELDS.items() if fields == set(value))
        options = value[Field.OPTIONS]
        if not isinstance(options, dict) or not all(isinstance(key, str) for key in options):
            raise plain_values.BadValueError("options must be a map with string keys")
        origin = plain_values.array(value[Field.ORIGIN], "origin", 3)
        packet_numbers, state_numbers, distances = value[Field.PACKETS], value[Field.LEVELS], value.get(Field.DISTANCES)
        if version > 1:
            packed = plain_values.binary(packet_numbers, "packet table", limits.header_bytes)
            packet_numbers = tables.unpack_packets(packed)
        packets = _read_packets(packet_numbers, value[Field.CHECKSUMS], limits)
        if version > 1:
            packed = plain_values.binary(state_numbers, "level table", limits.header_bytes)
            places = [row.level for row in packets]
            state_numbers, distances = tables.unpack_states(packed, places, DISTANCE_BYTES)
        return cls(
            profile=plain_values.text(value[Field.PROFILE], "profile", LONGEST_NAME),
            options=options,
            bits=plain_values.integer(value[Field.BITS], "bits per coordinate", SMALLEST_B, LARGEST_B),
            origin=tuple(plain_values.number(coordinate, "origin") for coordinate in origin),  # type: ignore[arg-type]
            extent=plain_values.number(value[Field.EXTENT], "extent", 0.0),
            levels=_read_levels(state_numbers, distances, len(packets), limits),
            packets=packets,
            version=version,
        )


def check_version(version: int) -> None:
    """Raise VersionError unless this program reads streams of `version`."""
    if version not in _FIELDS:
        raise VersionError(
            f"the stream is of format version {version}; this program reads versions 1 to {FORMAT_VERSION}; "
            "a newer meshtide may read it"
        )


def version_of(header_bytes: bytes) -> int:
    """The format version of a header, by how many fields it has; the newest one for bytes that are none."""
    fields = header_bytes[0] & 0x0F if header_bytes else 0
    return next((version for version, keys in _FIELDS.items() if len(keys) == fields), FORMAT_VERSION)


def _read_levels(value: object, distances: object, packet_count: int, limits: Limits) -> tuple[LevelEntry, ...]:
    numbers = plain_values.array(value, "level table")
    count, rest = divmod(len(numbers), 4)
    if rest or not count:
        raise plain_values.BadValueError(f"the level table has {len(numbers)} numbers, not four a level")
    if count > limits.levels:
        raise LimitError(f"the stream claims {count} levels; this decoder accepts {limits.levels} (Limits.levels)")
    length = DISTANCE_BYTES * count
    data = plain_values.binary(distances, "level distances", length, length)
    measured = [_unpack_distance(data[start : start + 2]) for start in range(0, length, 2)]
    levels: list[LevelEntry] = []
    for i in range(count):
        level, needed, vertices, faces = numbers[4 * i : 4 * i + 4]
        entry = LevelEntry(
            level=plain_values.integer(level, "level", 0, LARGEST_LEVEL),
            packet_count=plain_values.integer(needed, "packet count", 1, packet_count),
            vertices=plain_values.integer(vertices, "vertex count", 1),
            faces=plain_values.integer(faces, "face count"),
            rms=plain_values.number(measured[2 * i], "rms distance", 0.0),
            maximum=plain_values.number(measured[2 * i + 1], "maximum distance", 0.0),
        )
        limits.check_mesh(entry.vertices, entry.faces, level=entry.level)
        if levels and entry.packet_count < levels[-1].packet_count:
            raise plain_values.BadValueError("the level table is not in transmission order")
        levels.append(entry)
    if levels[-1].level != 0:
        raise plain_values.BadValueError("the level table does not end with level 0")
    return tuple(levels)


def _read_packets(value: object, checksums: object, limits: Limits) -> tuple[PacketEntry, ...]:
    numbers = plain_values.array(value, "packet table")
    count, rest = divmod(len(numbers), 4)
    if rest or not count:
        raise plain_values.BadValueError(f"the packet table has {len(numbers)} numbers, not four a packet")
    if count > limits.packets:
        raise LimitError(f"the stream claims {count} packets; this decoder accepts {limits.packets} (Limits.packets)")
    length = CHECKSUM_BYTES * count
    unpacked = struct.unpack(f"<{count}I", plain_values.binary(checksums, "packet checksums", length, length))
    entries = []
    for i in range(count):
        kind, level, part, size = numbers[4 * i : 4 * i + 4]
        entry = PacketEntry(
            kind=PacketKind(plain_values.integer(kind, "packet kind", 0, max(PacketKind))),
            level=plain_values.integer(level, "packet level", 0, LARGEST_LEVEL),
            slice=plain_values.integer(part, "packet slice", 0, LARGEST_SLICE),
            length=plain_values.integer(size, "packet length"),
            checksum=unpacked[i],
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


def stored_distance(distance: float) -> float:
    """The least distance not below `distance` that a header can hold: a float32 whose lower 16 bits are zero.

    >>> stored_distance(0.1), stored_distance(0.0)
    (0.10009765625, 0.0)
    """
    single = struct.unpack("<I", struct.pack("<f", distance))[0]
    rounded = single >> 16 << 16
    value: float = struct.unpack("<f", struct.pack("<I", rounded))[0]
    if value < distance:
        value = struct.unpack("<f", struct.pack("<I", rounded + (1 << 16)))[0]
    return value


def _pack_distance(distance: float) -> bytes:
    return struct.pack("<f", distance)[2:]


def _unpack_distance(data: bytes) -> float:
    value: float = struct.unpack("<f", b"\0\0" + data)[0]
    return value
