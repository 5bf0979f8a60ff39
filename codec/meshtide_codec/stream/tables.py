"""The header's two tables as bytes, in format version 2: rows say how they differ from what is to be expected.

A stream of a few kilobytes has a dozen packets and about as many states; written as plain numbers their tables take
more than its first preview. Packets follow each other level by level and states come after the last packet of their
level, so most of a row is one byte that says "as expected", and a length or two small differences of counts. The
layout stands in docs/format.md, section 2.

Both tables become, and are made of, the flat lists of numbers that version 1 stores, which the header then checks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.stream.coordinates import folded, unfolded
from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

KINDS = 8
"""A packet row begins with kind + KINDS * step."""
SAME_LEVEL, NEXT_SLICE, NEXT_LEVEL, ELSEWHERE = range(4)
"""Steps: slice 0 of the level before; the next slice of it; slice 0 of the next finer level; level and slice follow."""


def pack_packets(rows: Sequence[tuple[int, int, int, int]]) -> bytes:
    """The packet table, given kind, level, slice and length of each packet.

    >>> pack_packets([(0, 2, 0, 300), (1, 1, 0, 9), (3, 1, 0, 7), (3, 1, 1, 8)]).hex()
    '180200ac02110903070b08'
    """
    data = bytearray()
    previous = (0, 0)
    for kind, level, part, length in rows:
        step = step_to(previous, (level, part))
        data += write_number(kind + KINDS * step)
        if step == ELSEWHERE:
            data += write_number(level) + write_number(part)
        data += write_number(length)
        previous = level, part
    return bytes(data)


def unpack_packets(data: bytes) -> list[int]:
    """Kind, level, slice and length of each packet in turn.

    Raises:
        BadValueError: a row is cut off, or of a step or a level that cannot be.
    """
    numbers: list[int] = []
    previous = (0, 0)
    position = 0
    while position < len(data):
        head, position = read_number(data, position)
        step, kind = divmod(head, KINDS)
        if step == ELSEWHERE:
            level, position = read_number(data, position)
            part, position = read_number(data, position)
            previous = level, part
        elif step < ELSEWHERE:
            previous = next_place(previous, step)
        else:
            raise BadValueError(f"a packet's row begins with {head}, which is no step")
        length, position = read_number(data, position)
        numbers += [kind, *previous, length]
    return numbers


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


def pack_states(
    rows: Sequence[tuple[int, int, int, int]], distances: Sequence[bytes], packet_levels: Sequence[int]
) -> bytes:
    """The table of states.

    Args:
        rows: level, packet count, vertices and faces of each state.
        distances: four bytes for each of them.
        packet_levels: the level of each packet.
    """
    data = bytearray()
    for before, row, distance in zip([(0, 0, 0, 0), *rows], rows, distances, strict=False):
        level, count, vertices, faces = row
        elsewhere = packet_levels[count - 1] != level
        data += write_number(2 * (count - before[1]) + elsewhere)
        if elsewhere:
            data += write_number(level)
        data += write_number(folded(vertices - before[2]))
        data += write_number(folded(faces - 2 * vertices - (before[3] - 2 * before[2])))
        data += distance
    return bytes(data)


def unpack_states(data: bytes, packet_levels: Sequence[int], distance_bytes: int) -> tuple[list[int], bytes]:
    """Level, packet count, vertices and faces of each state in turn; and the bytes of all their distances.

    Raises:
        BadValueError: a row is cut off, or needs packets that there are not.
    """
    numbers: list[int] = []
    distances = bytearray()
    count = vertices = surplus = position = 0
    while position < len(data):
        head, position = read_number(data, position)
        count += head >> 1
        if not 1 <= count <= len(packet_levels):
            raise BadValueError(f"a state needs {count} packets of {len(packet_levels)}")
        level = packet_levels[count - 1]
        if head & 1:
            level, position = read_number(data, position)
        (added, more), position = _read_two(data, position)
        vertices += unfolded(added)
        surplus += unfolded(more)
        numbers += [level, count, vertices, surplus + 2 * vertices]
        if position + distance_bytes > len(data):
            raise BadValueError("the distances of a state are cut off")
        distances += data[position : position + distance_bytes]
        position += distance_bytes
    return numbers, bytes(distances)


def _read_two(data: bytes, position: int) -> tuple[tuple[int, int], int]:
    first, position = read_number(data, position)
    second, position = read_number(data, position)
    return (first, second), position
