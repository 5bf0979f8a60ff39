"""The header as bytes: everything is where it is expected, and only the options have keys.

A stream of a few kilobytes is looked at after its first hundred bytes, and the header stands before those. So each
packet is a row of its own (what it is, how long, its checksum) and the states that it completes follow it at once;
rows say how they differ from what is to be expected: packets follow each other level by level, and states come after
the last packet of their level. The layout stands in docs/format.md, section 2.
"""

from __future__ import annotations

import struct
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from meshtide_codec.errors import LimitError
from meshtide_codec.stream import plain_values
from meshtide_codec.stream.coordinates import folded, pack_coordinate, unfolded, unpack_coordinate
from meshtide_codec.stream.distances import DISTANCE_BYTES, pack_distances, unpack_distances
from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

VERSION = 3
"""The format's version: every header begins with it."""
PROFILES = ("classic", "compact")
"""Profiles that are told by their number; the name of another one is spelt out."""
CHECKSUM_BYTES = 4

KINDS = 8
SAME_LEVEL, NEXT_SLICE, NEXT_LEVEL, ELSEWHERE = range(4)
"""Steps: slice 0 of the level before; the next slice of it; slice 0 of the next finer level; level and slice follow."""
STEPS = 4
NO_STATE, OWN_STATE, MORE_STATES, SAME_SIZE = range(4)
"""What a packet completes: nothing; a state of its level; so many of so many levels, which follow; a state of its
level with as many vertices and faces as the one before.
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
    packets: list[tuple[int, int, int, int]]
    checksums: list[int]
    states: list[tuple[int, int, int, int]]
    distances: list[tuple[float, float]]


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
        if own and states[0][0][2:] == size:
            what = SAME_SIZE
        step = step_to(place, (level, part))
        data += write_number(kind + KINDS * (step + STEPS * what))
        if step == ELSEWHERE:
            data += write_number(level) + write_number(part)
        data += write_number(length) + struct.pack("<I", checksum)
        if what == MORE_STATES:
            data += write_number(len(states))
        for row, distances in states:
            data += b"" if own else write_number(row[0])
            data += b"" if what == SAME_SIZE else _pack_sizes(size, row[2:])
            data += pack_distances(*distances)
            size = row[2:]
        place = level, part
    return bytes(data) + plain_values.pack(dict(header.options))


def unpack_header(data: bytes, most_packets: int) -> PlainHeader:
    """What the bytes of `pack_header` say; no value is checked but for where the next one begins.

    Raises:
        LimitError: it has more packets than `most_packets`.
        BadValueError: the bytes end early, or a row begins as none does.
    """
    if data[:1] != bytes([VERSION]):
        raise BadValueError(f"its first byte is not {VERSION}; what an older meshtide wrote has to be encoded again")
    reader = _Reader(data, 1)
    number = reader.number()
    profile = PROFILES[number] if number < len(PROFILES) else reader.text(number - len(PROFILES))
    bits = reader.take(1)[0]
    origin = [reader.coordinate() for _ in range(3)]
    header = PlainHeader(profile, {}, bits, origin, reader.coordinate(), [], [], [], [])
    count = reader.number()
    if count > most_packets:
        raise LimitError(f"the stream claims {count} packets; this decoder accepts {most_packets} (Limits.packets)")
    for _ in range(count):
        _unpack_row(reader, header)
    return header._replace(options=plain_values.unpack(reader.rest(), len(data)))


def next_place(previous: tuple[int, int], step: int) -> tuple[int, int]:
    """Level and slice of a packet a step after the one at `previous`.

    >>> next_place((5, 2), SAME_LEVEL), next_place((5, 2), NEXT_SLICE), next_place((5, 2), NEXT_LEVEL)
    ((5, 0), (5, 3), (4, 0))
    """
    level, part = previous
    return {SAME_LEVEL: (level, 0), NEXT_SLICE: (level, part + 1), NEXT_LEVEL: (level - 1, 0)}[step]


def step_to(previous: tuple[int, int], place: tuple[int, int]) -> int:
    """The step that leads from one place to another."""
    return next((step for step in range(ELSEWHERE) if next_place(previous, step) == place), ELSEWHERE)


class _Reader:
    """Bytes that are read from front to end."""

    def __init__(self, data: bytes, position: int) -> None:
        self._data = data
        self._position = position

    def number(self) -> int:
        value, self._position = read_number(self._data, self._position)
        return value

    def signed(self) -> int:
        return unfolded(self.number())

    def coordinate(self) -> float:
        value, self._position = unpack_coordinate(self._data, self._position)
        return value

    def take(self, length: int) -> bytes:
        start, self._position = self._position, self._position + length
        if self._position > len(self._data):
            raise BadValueError(f"{length} bytes at byte {start} are cut off")
        return self._data[start : self._position]

    def text(self, length: int) -> str:
        try:
            return self.take(length).decode()
        except UnicodeDecodeError as error:
            raise BadValueError("the profile's name is not UTF-8") from error

    def rest(self) -> bytes:
        return self._data[self._position :]


def _unpack_row(reader: _Reader, header: PlainHeader) -> None:
    """Add one packet, and the states that are complete with it, to the lists of `header`."""
    what, head = divmod(reader.number(), STEPS * KINDS)
    step, kind = divmod(head, KINDS)
    if what > SAME_SIZE:
        raise BadValueError(f"the row of packet {len(header.packets)} begins as none does")
    before = header.packets[-1][1:3] if header.packets else (0, 0)
    place = (reader.number(), reader.number()) if step == ELSEWHERE else next_place(before, step)
    header.packets.append((kind, *place, reader.number()))
    header.checksums.append(int.from_bytes(reader.take(CHECKSUM_BYTES), "little"))
    count = reader.number() if what == MORE_STATES else int(what != NO_STATE)
    for _ in range(count):
        level = reader.number() if what == MORE_STATES else place[0]
        size = header.states[-1][2:] if header.states else (0, 0)
        if what != SAME_SIZE:
            size = _grown(size, reader.signed(), reader.signed())
        header.states.append((level, len(header.packets), *size))
        header.distances.append(unpack_distances(reader.take(DISTANCE_BYTES)))


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


def _pack_sizes(before: tuple[int, ...], after: tuple[int, ...]) -> bytes:
    """Vertices and faces of a state after those of the one before: most surfaces have two faces a vertex."""
    vertices, surplus = _vertices_and_surplus(after)
    known, known_surplus = _vertices_and_surplus(before)
    return write_number(folded(vertices - known)) + write_number(folded(surplus - known_surplus))


def _grown(before: tuple[int, int], growth: int, surplus_growth: int) -> tuple[int, int]:
    known, known_surplus = _vertices_and_surplus(before)
    vertices = known + growth
    return vertices, known_surplus + surplus_growth + 2 * vertices


def _vertices_and_surplus(size: tuple[int, ...]) -> tuple[int, int]:
    vertices, faces = size
    return vertices, faces - 2 * vertices
