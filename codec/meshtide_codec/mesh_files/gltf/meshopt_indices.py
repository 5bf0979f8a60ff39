"""Triangles and indices as EXT_meshopt_compression and KHR_meshopt_compression store them.

Format: Khronos, "KHR_meshopt_compression", appendix A, modes 1 (triangles) and 2 (indices). Triangles lean on the last
16 edges and vertices, one after the other; indices are differences, taken all at once. Cost: linear in the indices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_TRIANGLES = 0xE1
_INDICES = 0xD1
_TABLE = 16
_PADDING = 4
_WORD = 0xFFFFFFFF
_LONGEST_NUMBER = 5


def decode_indices(data: NDArray[np.uint8], count: int) -> NDArray[np.uint32]:
    """Indices (count,) of any topology.

    Raises:
        MeshFileError: the stream is of another kind, damaged, or cut short.
    """
    if len(data) == 0 or data[0] != _INDICES:
        raise MeshFileError("its first byte does not say indices")
    if len(data) < 1 + count + _PADDING:
        raise MeshFileError(f"{count} indices take at least {1 + count + _PADDING} bytes, but there are {len(data)}")
    body = data[1 : len(data) - _PADDING]
    ends = np.flatnonzero(body < 0x80)
    if len(ends) != count or (count and ends[-1] != len(body) - 1) or (count == 0 and len(body)):
        raise MeshFileError(f"it holds {len(ends)} numbers for {count} indices, or bytes after them")
    if count == 0:
        return np.zeros(0, np.uint32)
    starts = np.concatenate([[0], ends[:-1] + 1])
    if (ends - starts).max() >= _LONGEST_NUMBER:
        raise MeshFileError("a number is longer than five bytes")
    shifts = 7 * (np.arange(len(body)) - np.repeat(starts, ends - starts + 1))
    stored = np.add.reduceat((body & 0x7F).astype(np.uint64) << shifts.astype(np.uint64), starts).astype(np.uint32)
    halved = stored >> np.uint32(2)
    deltas = np.where(stored & np.uint32(2), ~halved, halved)
    result = np.empty(count, np.uint32)
    for baseline in (0, 1):
        chosen = (stored & np.uint32(1)) == baseline
        result[chosen] = np.cumsum(deltas[chosen], dtype=np.uint32)
    return result


def decode_triangles(data: NDArray[np.uint8], count: int) -> NDArray[np.uint32]:
    """Indices (count,) of triangles.

    Raises:
        MeshFileError: the stream is of another kind, damaged, or cut short.
    """
    if len(data) == 0 or data[0] != _TRIANGLES:
        raise MeshFileError("its first byte does not say triangles")
    triangles = count // 3
    if len(data) < 1 + triangles + _TABLE:
        raise MeshFileError(
            f"{triangles} triangles take at least {1 + triangles + _TABLE} bytes, but there are {len(data)}"
        )
    table = data[len(data) - _TABLE :]
    if table[-2:].any() or ((table >> 4) == 15).any() or ((table & 15) == 15).any():
        raise MeshFileError("its table of codes is not one")
    stream = _Stream(data[1 + triangles : len(data) - _TABLE].tobytes())
    try:
        indices = _Recent(stream, table.tolist()).triangles(data[1 : 1 + triangles].tobytes())
    except IndexError:  # of bytes, which end before the triangles do
        raise MeshFileError("it is cut short") from None
    if stream.place != len(stream.data):
        raise MeshFileError(f"{len(stream.data) - stream.place} bytes follow the last triangle")
    return np.array(indices, np.uint32)


class _Stream:
    """What does not fit into the codes: single bytes, and indices as differences from the last one."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.place = 0
        self.last = 0

    def byte(self) -> int:
        value = self.data[self.place]
        self.place += 1
        return value

    def index(self) -> int:
        value = 0
        for shift in range(0, 7 * _LONGEST_NUMBER, 7):
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                value &= _WORD
                self.last = (self.last + (~(value >> 1) if value & 1 else value >> 1)) & _WORD
                return self.last
        raise MeshFileError("a number is longer than five bytes")


class _Recent:
    """The last 16 edges and vertices, each list with the place of the next one; -1 stands for none."""

    def __init__(self, stream: _Stream, table: list[int]) -> None:
        self.stream = stream
        self.table = table
        self.starts, self.ends, self.edge = [-1] * 16, [-1] * 16, 0
        self.vertices, self.vertex = [-1] * 16, 0
        self.following = 0

    def triangles(self, codes: bytes) -> list[int]:
        """The corners that the codes stand for, one after the other."""
        result: list[int] = []
        starts, ends = self.starts, self.ends
        for code in codes:
            if code < 0xF0:
                near = (self.edge - 1 - (code >> 4)) & 15
                a, b, c = starts[near], ends[near], self._third(code & 15)
            else:
                a, b, c = self._three(code)
                starts[self.edge], ends[self.edge] = b, a
                self.edge = (self.edge + 1) & 15
            if a < 0 or b < 0 or c < 0:
                raise MeshFileError("a triangle leans on an edge or vertex that did not come")
            edge = self.edge
            starts[edge], ends[edge] = c, b
            edge = (edge + 1) & 15
            starts[edge], ends[edge] = a, c
            self.edge = (edge + 1) & 15
            result += (a, b, c)
        return result

    def _third(self, place: int) -> int:
        """The third corner of a triangle on a known edge."""
        if 0 < place < 13:
            return self.vertices[(self.vertex - 1 - place) & 15]
        if place == 0:
            corner = self._next()
        elif place < 15:  # one less than the last index, or one more
            corner = self.stream.last = (self.stream.last + 2 * place - 27) & _WORD
        else:
            corner = self.stream.index()
        self._push(corner)
        return corner

    def _three(self, code: int) -> tuple[int, int, int]:
        """The corners of a triangle on no known edge."""
        pair = self.table[code & 15]
        if code >= 0xFE:
            pair = self.stream.byte()
            if pair == 0:
                self.following = 0
        a = self.stream.index() if code == 0xFF else self._next()
        b, c = self._corner(pair >> 4), self._corner(pair & 15)
        self._push(a)
        for place, corner in ((pair >> 4, b), (pair & 15, c)):
            if place in {0, 15}:
                self._push(corner)
        return a, b, c

    def _corner(self, place: int) -> int:
        if place == 0:
            return self._next()
        return self.vertices[(self.vertex - place) & 15] if place < 15 else self.stream.index()

    def _next(self) -> int:
        corner = self.following
        self.following = (corner + 1) & _WORD
        return corner

    def _push(self, corner: int) -> None:
        self.vertices[self.vertex] = corner
        self.vertex = (self.vertex + 1) & 15
