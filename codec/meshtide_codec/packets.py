"""Packets: what a stream is made of (paper, tables 1 and 2).

The coarsest mesh comes first as one Base packet; every finer level then brings Map&Conn (how its vertices split,
and its faces), Param (filter coefficients) and Diff (true minus predicted geometry). On the wire and in a file a
packet is its bare payload: its kind, level, slice, length and checksum are in the stream header's packet table.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

MAGIC = b"\x89TIDE\r\n\x1a"  # like PNG's: not text, and damaged by every transfer that converts line ends
"""The first bytes of a file of packets."""

LARGEST_LEVEL = 63


class PacketKind(IntEnum):
    """What a packet holds; the number is its first field."""

    BASE = 0
    MAP_CONN = 1
    PARAM = 2
    DIFF = 3
    PREVIEW = 4
    ORDER = 5

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
    PacketKind.ORDER: "Order",
}


@dataclass(frozen=True, slots=True)
class Packet:
    """One unit of a stream.

    Args:
        kind: what it holds.
        level: the level that it helps to build.
        slice: which part of that level, 0 where a level is not cut.
        payload: its contents.

    >>> Packet(PacketKind.DIFF, level=3, slice=0, payload=bytes(512))
    Packet(Diff, level 3, 512 bytes)
    """

    kind: PacketKind
    level: int
    slice: int
    payload: bytes

    def __repr__(self) -> str:
        part = f", slice {self.slice}" if self.slice else ""
        return f"Packet({self.kind.label}, level {self.level}{part}, {len(self.payload)} bytes)"
