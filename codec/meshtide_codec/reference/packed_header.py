"""The header: each packet a row, with the states that it completes (docs/format.md, section 2)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import msgpack

from meshtide_codec.errors import ContainerError
from meshtide_codec.reference.numbers import read_number, read_signed

VERSION = 3
Row = tuple[int, int, int, int]
PROFILES = ["classic", "compact"]


@dataclass
class HeaderFields:
    """What a header says.

    Attributes:
        profile: its name.
        options: of the profile.
        bits: per coordinate.
        origin: position of the grid's first point.
        extent: length of the grid's side.
        packets: kind, level, slice and length of each packet.
        checksums: CRC-32 of each packet.
        states: level, packet count, vertices and faces of each state.
        distances: the two bytes of each state.
    """

    profile: str
    options: dict[str, Any]
    bits: int
    origin: list[float]
    extent: float
    packets: list[Row]
    checksums: list[int]
    states: list[Row]
    distances: list[bytes]


def read_packed_header(data: bytes) -> HeaderFields:
    """Read a header from its first byte, which is the version, to its options.

    Raises:
        ContainerError, PacketError: it is damaged.
    """
    if data[:1] != bytes([VERSION]):
        raise ContainerError(f"not a header of format version {VERSION}", offset=0)
    number, position = read_number(data, 1)
    if number < len(PROFILES):
        profile = PROFILES[number]
    else:
        length = number - len(PROFILES)
        profile = data[position : position + length].decode()
        position += length
    bits = data[position]
    position += 1
    values = []
    for _ in range(4):
        value, position = read_coordinate(data, position)
        values.append(value)
    header = HeaderFields(profile, {}, bits, values[:3], values[3], [], [], [], [])
    count, position = read_number(data, position)
    for _ in range(count):
        position = _read_row(data, position, header)
    header.options = msgpack.unpackb(data[position:])
    return header


def read_coordinate(data: bytes, position: int) -> tuple[float, int]:
    """A decimal number, a float32 or a double, by its first byte; and where it ends.

    Raises:
        ContainerError: it is neither.

    >>> read_coordinate(bytes.fromhex("05af821e"), 0)
    (-2.45912, 4)
    """
    form = data[position]
    if form <= 22:
        digits, end = read_signed(data, position + 1)
        return digits / 10**form, end
    if form == 32:
        return struct.unpack_from("<f", data, position + 1)[0], position + 5
    if form == 64:
        return struct.unpack_from("<d", data, position + 1)[0], position + 9
    raise ContainerError(f"a number begins with {form}", offset=position)


def distances(stored: bytes) -> tuple[float, float]:
    """Root mean square and maximum of a state, from its two bytes."""
    word = stored[0] * 256 + stored[1]
    r, q = word // 32, word % 32
    rms = 0.0 if r == 0 else (64 + r % 64) * 2.0 ** (r // 64 - 37)
    return rms, 127 / 64 if q == 31 else min(rms * ((4 + q % 4) * 2.0 ** (q // 4 - 2)), 127 / 64)


def _read_row(data: bytes, position: int, header: HeaderFields) -> int:
    """One packet, and the states that are complete with it."""
    head, position = read_number(data, position)
    kind, step, completes = head % 8, head // 8 % 4, head // 32
    _, level, part, _ = header.packets[-1] if header.packets else (0, 0, 0, 0)
    if step == 0:
        part = 0
    elif step == 1:
        part += 1
    elif step == 2:
        level, part = level - 1, 0
    else:
        level, position = read_number(data, position)
        part, position = read_number(data, position)
    length, position = read_number(data, position)
    header.packets.append((kind, level, part, length))
    header.checksums.append(struct.unpack_from("<I", data, position)[0])
    position += 4
    if completes in {1, 3}:
        return _read_state(data, position, header, level, same_size=completes == 3)
    if completes == 2:
        states, position = read_number(data, position)
        for _ in range(states):
            level, position = read_number(data, position)
            position = _read_state(data, position, header, level)
    elif completes > 3:
        raise ContainerError(f"a packet's row begins with {head}", offset=position)
    return position


def _read_state(data: bytes, position: int, header: HeaderFields, level: int, *, same_size: bool = False) -> int:
    _, _, vertices, faces = header.states[-1] if header.states else (0, 0, 0, 0)
    surplus = faces - 2 * vertices
    growth = more = 0
    if not same_size:
        growth, position = read_signed(data, position)
        more, position = read_signed(data, position)
    vertices += growth
    header.states.append((level, len(header.packets), vertices, 2 * vertices + surplus + more))
    header.distances.append(data[position : position + 2])
    return position + 2
