"""Packets: what a stream is made of (paper, tables 1 and 2).

The coarsest mesh comes first as one Base packet; every finer level then brings Map&Conn (how its vertices split,
and its faces), Param (filter coefficients) and Diff (true minus predicted geometry). A packet on the wire and in a
file is the msgpack array [kind, level, slice, payload].
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from meshtide_codec.errors import PacketError
from meshtide_codec.stream import plain_values

LARGEST_LEVEL = 63
LARGEST_SLICE = (1 << 16) - 1
FRAMING_BYTES = 16
"""Upper bound of what the msgpack array adds to a payload."""


class PacketKind(IntEnum):
    """What a packet holds; the number is its first field."""

    BASE = 0
    MAP_CONN = 1
    PARAM = 2
    DIFF = 3
    PREVIEW = 4
    PERMUTATION = 5

    @property
    def label(self) -> str:
        """The name used in messages and tables."""
        return _LABELS[self]


_LABELS = {
    PacketKind.BASE: "Base",
    PacketKind.MAP_CONN: "Map&Conn",
    PacketKind.PARAM: "Param",
    PacketKind.DIFF: "Diff",
    PacketKind.PREVIEW: "Preview",
    PacketKind.PERMUTATION: "Permutation",
}


@dataclass(frozen=True, slots=True)
class Packet:
    """One unit of a stream.

    Args:
        kind: what it holds.
        level: the level that it helps to build.
        slice: which part of that level, 0 where a level is not cut.
        payload: its contents.

    >>> packet = Packet(PacketKind.DIFF, level=3, slice=0, payload=bytes(512))
    >>> packet
    Packet(Diff, level 3, 512 bytes)
    >>> Packet.from_bytes(packet.to_bytes()) == packet
    True
    """

    kind: PacketKind
    level: int
    slice: int
    payload: bytes

    def to_bytes(self) -> bytes:
        """The packet as it is sent and stored."""
        return plain_values.pack([int(self.kind), self.level, self.slice, self.payload])

    @classmethod
    def from_bytes(cls, data: bytes | memoryview) -> Packet:
        """The packet that `to_bytes` wrote.

        Raises:
            PacketError: anything else.
        """
        try:
            value = plain_values.unpack(data, len(data))
            kind, level, part, payload = plain_values.array(value, "a packet", 4)
            return cls(
                PacketKind(plain_values.integer(kind, "packet kind", 0, max(PacketKind))),
                plain_values.integer(level, "packet level", 0, LARGEST_LEVEL),
                plain_values.integer(part, "packet slice", 0, LARGEST_SLICE),
                plain_values.binary(payload, "packet payload", len(data)),
            )
        except plain_values.BadValueError as error:
            raise PacketError(f"not a packet: {error}") from error

    def __repr__(self) -> str:
        part = f", slice {self.slice}" if self.slice else ""
        return f"Packet({self.kind.label}, level {self.level}{part}, {len(self.payload)} bytes)"
