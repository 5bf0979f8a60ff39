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
        indices = _triangles(data[1 : 1 + triangles].tobytes(), stream, table.tolist())
    except IndexError:  # of bytes, which end before the triangles do
        raise MeshFileError("it is cut short") from None
    if stream.place != len(stream.data):
        raise MeshFileError(f"{len(stream.data) - stream.place} bytes stand after the last triangle")
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


def _triangles(codes: bytes, stream: _Stream, table: list[int]) -> list[int]:
    result: list[int] = []
    edges_a, edges_b, vertices = [-1] * 16, [-1] * 16, [-1] * 16
    edge = vertex = 0  # where the next one goes; 1 before it stands the newest
    following = 0
    for code in codes:
        if code < 0xF0:
            near = (edge - 1 - (code >> 4)) & 15
            a, b = edges_a[near], edges_b[near]
            low = code & 15
            if low == 0:
                c, following = following, (following + 1) & _WORD
            elif low < 13:
                c = vertices[(vertex - 1 - low) & 15]
            elif low < 15:
                c = stream.last = (stream.last + 2 * low - 27) & _WORD  # one less, or one more
            else:
                c = stream.index()
            if a < 0 or c < 0:
                raise MeshFileError("a triangle leans on an edge or vertex that did not come")
            if low == 0 or low >= 13:
                vertices[vertex] = c
                vertex = (vertex + 1) & 15
        else:
            if code >= 0xFE:
                pair = stream.byte()
                if pair == 0:
                    following = 0
            else:
                pair = table[code & 15]
            if code == 0xFF:
                a = stream.index()
            else:
                a, following = following, (following + 1) & _WORD
            corners = []
            for place in (pair >> 4, pair & 15):
                if place == 0:
                    corners.append(following)
                    following = (following + 1) & _WORD
                elif place < 15:
                    corners.append(vertices[(vertex - place) & 15])
                else:
                    corners.append(stream.index())
            b, c = corners
            if b < 0 or c < 0:
                raise MeshFileError("a triangle leans on a vertex that did not come")
            edges_a[edge], edges_b[edge] = b, a
            edge = (edge + 1) & 15
            vertices[vertex] = a
            vertex = (vertex + 1) & 15
            for place, corner in ((pair >> 4, b), (pair & 15, c)):
                if place in {0, 15}:
                    vertices[vertex] = corner
                    vertex = (vertex + 1) & 15
        edges_a[edge], edges_b[edge] = c, b
        edge = (edge + 1) & 15
        edges_a[edge], edges_b[edge] = a, c
        edge = (edge + 1) & 15
        result += (a, b, c)
    return result
