"""How the input's vertices and faces stood (docs/format.md, section 12).

An encoder names faces by their keys or by their rows, whichever is shorter.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NoReturn

from meshtide_codec.errors import PacketError
from meshtide_codec.reference.coding import SIGNED_CONTEXTS, Contexts, RangeDecoder
from meshtide_codec.reference.header import ByteReader

if TYPE_CHECKING:
    from meshtide_codec.reference.levels import Point

STEPS, KEY, RANK, TWIN_BEHIND, TWIN_BEFORE, OTHER, VANISHED = (SIGNED_CONTEXTS * place for place in range(7))
PLACE = VANISHED + 1
CONTEXTS = PLACE + 6


class OrderDecoder:
    """Decodes an Order packet.

    Args:
        faces: of level 0.
        vertices: how many level 0 has.
    """

    def __init__(self, payload: bytes, faces: list[Point], vertices: int) -> None:
        reader = ByteReader(payload)
        self._vertex_count, self._face_count, by_row = (reader.number() for _ in range(3))
        if by_row > 1:
            _fail()
        self._by_row = by_row == 1
        self._decoder = RangeDecoder(reader.rest())
        self._contexts = Contexts(CONTEXTS)
        self._rows = faces
        self._stream_vertices = vertices

    def decode(self) -> tuple[list[int], list[Point]]:
        """For each input vertex its vertex of level 0, and the input's faces."""
        self._vertices: list[int] = []
        for _ in range(self._vertex_count):
            expected = self._vertices[-1] + 1 if self._vertices else 0
            self._vertices.append(_checked(expected + self._signed(STEPS), self._stream_vertices))
        self._twins: list[list[int]] = [[] for _ in range(self._stream_vertices)]
        for number, vertex in enumerate(self._vertices):
            self._twins[vertex].append(number)
        self._rows = [self._turned(face) for face in self._rows]
        self._keyed: list[list[Point]] = [[] for _ in self._twins]
        for face in self._rows:
            self._keyed[face[0]].append(face)
        self._expected = [0] * len(self._keyed)
        self._before = self._place = self._next_row = 0
        faces = [self._face() for _ in range(self._face_count)]
        self._decoder.finish()
        return self._vertices, faces

    def _signed(self, base: int) -> int:
        return self._contexts.signed(self._decoder, base)

    def _turned(self, face: Point) -> Point:
        """A face of level 0 that begins at its key: the corner whose vertex has the greatest first input vertex."""
        if self._by_row:
            return face
        named = [self._twins[vertex][0] if self._twins[vertex] else -1 for vertex in face]
        first = named.index(max(named))
        return face[first], face[(first + 1) % 3], face[(first + 2) % 3]

    def _face(self) -> Point:
        corners = [0, 0, 0]
        if self._contexts.bit(self._decoder, VANISHED):
            for corner in range(3):
                self._before = _checked(self._before + self._signed(OTHER), self._vertex_count)
                corners[corner] = self._before
            return corners[0], corners[1], corners[2]
        place_context = PLACE + 2 * self._place
        if not self._contexts.bit(self._decoder, place_context):
            self._place += 1 if self._contexts.bit(self._decoder, place_context + 1) else 2
            self._place %= 3
        if self._by_row:
            row = _checked(self._next_row + self._signed(RANK), len(self._rows))
            self._next_row = row + 1
            face = self._rows[row]
            key = self._twin(KEY, face[0], self._before)
        else:
            key = _checked(self._before + self._signed(KEY), self._vertex_count)
            vertex = self._vertices[key]
            rank = _checked(self._expected[vertex] + self._signed(RANK), len(self._keyed[vertex]))
            self._expected[vertex] = rank + 1
            face = self._keyed[vertex][rank]
        self._before = corners[self._place] = key
        for step in (1, 2):
            corner = (self._place + step) % 3
            base = TWIN_BEFORE if corner < self._place else TWIN_BEHIND
            corners[corner] = self._twin(base, face[step], key)
        return corners[0], corners[1], corners[2]

    def _twin(self, base: int, vertex: int, key: int) -> int:
        """The input vertex that a corner is, among those that became its vertex."""
        twins = self._twins[vertex]
        if len(twins) == 1:
            return twins[0]
        return twins[_checked(bisect_left(twins, key + 1) + self._signed(base), len(twins))] if twins else _fail()


def _checked(value: int, count: int) -> int:
    return value if 0 <= value < count else _fail()


def _fail() -> NoReturn:
    raise PacketError("an order that names what is not there", packet="Order")
