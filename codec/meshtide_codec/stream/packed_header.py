"""The header as bytes, from format version 3 on: everything is where it is expected, and only the options have keys.

A stream of a few kilobytes is looked at after its first hundred bytes, and the header stands before those. So each
packet is a row of its own (what it is, how long, its checksum) and the states that it completes follow it at once;
rows say how they differ from what is to be expected, like the tables of version 2 (`tables`). The layout stands in
docs/format.md, section 2.
"""

from __future__ import annotations

import struct
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from meshtide_codec.stream import plain_values
from meshtide_codec.stream.coordinates import folded, pack_coordinate, unfolded, unpack_coordinate
from meshtide_codec.stream.distances import DISTANCE_BYTES, pack_distances, unpack_distances
from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError
from meshtide_codec.stream.tables import ELSEWHERE, KINDS, next_place, step_to

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

VERSION = 3
PROFILES = ("classic", "compact")
"""Profiles that are told by their number; the name of another one is spelt out."""
CHECKSUM_BYTES = 4

STEPS = 4
NO_STATE, OWN_STATE, MORE_STATES = range(3)
"""What a packet completes: nothing, a state of its level, or so many of so many levels, which follow.
A packet's row begins with kind + KINDS * (step + STEPS * states)."""


class PlainHeader(NamedTuple):
    """What a header says, as plain values that nobody has checked yet.

    Attributes:
        profile: name of the profile.
        options: of the profile.
        bits: per coordinate.
        origin: three numbers.
        extent: a number.
        packets: kind, level, slice and length of each packet.
        checksums: CRC-32 of each packet.
        states: level, packet count, vertices and faces of each state.
        distances: root mean square and maximum of each state.
    """

    profile: str
    options: Mapping[str, Any]
    bits: int
    origin: Sequence[float]
    extent: float
    packets: Sequence[tuple[int, int, int, int]]
    checksums: Sequence[int]
    states: Sequence[tuple[int, int, int, int]]
    distances: Sequence[tuple[float, float]]


def pack_header(header: PlainHeader) -> bytes:
    """The bytes of a header; its states are in transmission order."""
    data = bytearray([VERSION])
    data += _pack_profile(header.profile)
    data.append(header.bits)
    for value in (*header.origin, header.extent):
        data += pack_coordinate(value)
    completed = _states_by_packet(header)
    data += write_number(len(header.packets))
    place = (0, 0)
    size = (0, 0)
    for count, ((kind, level, part, length), checksum) in enumerate(
        zip(header.packets, header.checksums, strict=True), start=1
    ):
        states = completed.get(count, [])
        own = [level] == [row[0] for row, _ in states]
        what = OWN_STATE if own else MORE_STATES if states else NO_STATE
        step = step_to(place, (level, part))
        data += write_number(kind + KINDS * (step + STEPS * what))
        if step == ELSEWHERE:
            data += write_number(level) + write_number(part)
        data += write_number(length) + struct.pack("<I", checksum)
        if what == MORE_STATES:
            data += write_number(len(states))
        for row, distances in states:
            data += b"" if own else write_number(row[0])
            data += _pack_sizes(size, row[2:]) + pack_distances(*distances)
            size = row[2:]
        place = level, part
    return bytes(data) + plain_values.pack(dict(header.options))


def unpack_header(data: bytes) -> PlainHeader:
    """What the bytes of `pack_header` say; no value is checked but for where the next one begins.

    Raises:
        BadValueError: the bytes end early, or a row begins as none does.
    """
    if data[:1] != bytes([VERSION]):
        raise BadValueError("its first byte is not that of a meshtide stream header")
    profile, position = _unpack_profile(data, 1)
    if position >= len(data):
        raise BadValueError("it ends before the bits per coordinate")
    bits, position = data[position], position + 1
    numbers = []
    for _ in range(4):
        value, position = unpack_coordinate(data, position)
        numbers.append(value)
    count, position = read_number(data, position)
    packets: list[tuple[int, int, int, int]] = []
    checksums: list[int] = []
    states: list[tuple[int, int, int, int]] = []
    distances: list[tuple[float, float]] = []
    place = (0, 0)
    size = (0, 0)
    for index in range(count):
        head, position = read_number(data, position)
        what, head = divmod(head, STEPS * KINDS)
        step, kind = divmod(head, KINDS)
        if what > MORE_STATES:
            raise BadValueError(f"the row of packet {index} begins as none does")
        if step == ELSEWHERE:
            level, position = read_number(data, position)
            part, position = read_number(data, position)
            place = level, part
        else:
            place = next_place(place, step)
        length, position = read_number(data, position)
        checksum, position = _take(data, position, CHECKSUM_BYTES)
        packets.append((kind, *place, length))
        checksums.append(int.from_bytes(checksum, "little"))
        states_here = what
        if what == MORE_STATES:
            states_here, position = read_number(data, position)
        for _ in range(states_here):
            level = place[0]
            if what == MORE_STATES:
                level, position = read_number(data, position)
            size, position = _unpack_sizes(size, data, position)
            stored, position = _take(data, position, DISTANCE_BYTES)
            states.append((level, index + 1, *size))
            distances.append(unpack_distances(stored))
    options = plain_values.unpack(data[position:], len(data))
    return PlainHeader(profile, options, bits, numbers[:3], numbers[3], packets, checksums, states, distances)


def _states_by_packet(
    header: PlainHeader,
) -> dict[int, list[tuple[tuple[int, int, int, int], tuple[float, float]]]]:
    """The states and their distances by the number of packets that they need."""
    rows: Iterable[tuple[tuple[int, int, int, int], tuple[float, float]]] = zip(
        header.states, header.distances, strict=True
    )
    return {count: list(group) for count, group in groupby(rows, key=lambda row: row[0][1])}


def _pack_profile(name: str) -> bytes:
    if name in PROFILES:
        return write_number(PROFILES.index(name))
    spelt = name.encode()
    return write_number(len(PROFILES) + len(spelt)) + spelt


def _unpack_profile(data: bytes, position: int) -> tuple[str, int]:
    number, position = read_number(data, position)
    if number < len(PROFILES):
        return PROFILES[number], position
    spelt, position = _take(data, position, number - len(PROFILES))
    try:
        return spelt.decode(), position
    except UnicodeDecodeError as error:
        raise BadValueError("the profile's name is not UTF-8") from error


def _pack_sizes(before: tuple[int, ...], after: tuple[int, ...]) -> bytes:
    """Vertices and faces of a state after those of the one before: most surfaces have two faces a vertex."""
    vertices, surplus = _vertices_and_surplus(after)
    known, known_surplus = _vertices_and_surplus(before)
    return write_number(folded(vertices - known)) + write_number(folded(surplus - known_surplus))


def _unpack_sizes(before: tuple[int, int], data: bytes, position: int) -> tuple[tuple[int, int], int]:
    growth, position = read_number(data, position)
    surplus_growth, position = read_number(data, position)
    known, known_surplus = _vertices_and_surplus(before)
    vertices = known + unfolded(growth)
    return (vertices, known_surplus + unfolded(surplus_growth) + 2 * vertices), position


def _vertices_and_surplus(size: tuple[int, ...]) -> tuple[int, int]:
    vertices, faces = size
    return vertices, faces - 2 * vertices


def _take(data: bytes, position: int, length: int) -> tuple[bytes, int]:
    if position + length > len(data):
        raise BadValueError(f"{length} bytes at byte {position} are cut off")
    return data[position : position + length], position + length
