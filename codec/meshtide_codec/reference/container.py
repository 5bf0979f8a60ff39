"""The file: preamble, header, packets, and parts inside of payloads (docs/format.md, sections 1 to 3)."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Any

from meshtide_codec.errors import ContainerError, PacketError
from meshtide_codec.reference.numbers import read_number
from meshtide_codec.reference.packed_header import VERSION, read_packed_header

MAGIC = b"\x89TIDE\r\n\x1a"
PREAMBLE = struct.Struct("<8sHII")
BASE, MAP_CONN, PARAM, DIFF, PREVIEW, ORDER = range(6)
Key = tuple[int, int, int]
"""Kind, level and slice of a packet."""


@dataclass(frozen=True)
class State:
    """A row of the level table."""

    level: int
    packet_count: int
    vertices: int
    faces: int


@dataclass(frozen=True)
class Stream:
    """A whole stream: what its header says, and its payloads by kind, level and slice in transmission order."""

    profile: str
    options: dict[str, Any]
    bits: int
    origin: list[float]
    extent: float
    states: list[State]
    payloads: dict[Key, bytes]

    def packets_for(self, level: int) -> dict[Key, bytes]:
        """The packets that a level needs: as many as its last state, or the first state of a finer level.

        Raises:
            KeyError: the stream has no such level.
        """
        own = [state for state in self.states if state.level == level]
        finer = [state for state in self.states if state.level < level]
        if not 0 <= level <= self.states[0].level:
            raise KeyError(f"the stream has levels 0..{self.states[0].level}, not {level}")
        state = own[-1] if own else finer[0]
        return dict(list(self.payloads.items())[: state.packet_count])

    def vertices_of(self, level: int) -> int:
        """Number of vertices of a level that has a state."""
        return next(state.vertices for state in self.states if state.level == level)

    def faces_of(self, level: int) -> int:
        """Number of faces of a level that has a state."""
        return next(state.faces for state in self.states if state.level == level)


def read_stream(data: bytes) -> Stream:
    """Take a file apart.

    Raises:
        ContainerError, PacketError: it is damaged.
    """
    if len(data) < PREAMBLE.size:
        raise ContainerError("the file ends inside its preamble", offset=0)
    magic, version, length, checksum = PREAMBLE.unpack_from(data)
    header_bytes = data[PREAMBLE.size : PREAMBLE.size + length]
    if magic != MAGIC or version != VERSION or zlib.crc32(header_bytes) != checksum:
        raise ContainerError(f"not a stream of format version {VERSION}, or damaged", offset=0)
    header = read_packed_header(header_bytes)
    position = PREAMBLE.size + length
    payloads: dict[Key, bytes] = {}
    for index, (kind, level, part, size) in enumerate(header.packets):
        payload = data[position : position + size]
        right = len(payload) == size and zlib.crc32(payload) == header.checksums[index]
        if not right or (kind, level, part) in payloads:
            raise PacketError(f"packet {index} is damaged", level=level, offset=position)
        payloads[kind, level, part] = payload
        position += size
    if position != len(data):
        raise ContainerError("bytes follow the last packet", offset=position)
    return Stream(
        profile=header.profile,
        options=header.options,
        bits=header.bits,
        origin=header.origin,
        extent=header.extent,
        states=[State(*row) for row in header.states],
        payloads=payloads,
    )


def split_parts(payload: bytes, count: int) -> list[bytes]:
    r"""The parts of a payload.

    Raises:
        PacketError: they are longer than the payload.

    >>> split_parts(b"\x02\x00abcde", 3)
    [b'ab', b'', b'cde']
    """
    lengths = []
    position = 0
    for _ in range(count - 1):
        length, position = read_number(payload, position)
        lengths.append(length)
    if position + sum(lengths) > len(payload):
        raise PacketError(f"its parts take {position + sum(lengths)} bytes of {len(payload)}")
    parts = []
    for length in lengths:
        parts.append(payload[position : position + length])
        position += length
    return [*parts, payload[position:]]
