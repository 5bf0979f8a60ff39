"""Kernels that code the input's order: its vertices by the steps between them, then its faces.

A face is told in one of two ways, whichever is shorter for the whole mesh.

- By its *key*, the corner whose vertex was first named last: files often name vertices in the order in which their
  faces need them, so that the keys of faces that follow each other are close. The key is a step from that of the face
  before; then it is told which of the stream's faces of that key it is, as a step from the one told there before.
- By its row among the stream's faces, as a step from one more than the row before; the key is the first corner.

Then comes the place of the key in the input's face, and where several input vertices became one, which of them the
corners are. Cost: O(1) a vertex; O(1) a face, and O(log k) where k vertices became one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy.model_kernels import SIGNED_CONTEXTS, code_adaptive_bit, code_signed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Indices = NDArray[np.int64]

OK = 0
BAD_VALUE = -1

# Contexts: where those of each integer start
STEPS = 0
KEY = STEPS + SIGNED_CONTEXTS
RANK = KEY + SIGNED_CONTEXTS
TWIN = RANK + SIGNED_CONTEXTS  # of a corner behind the key, then of one before it
OTHER = TWIN + 2 * SIGNED_CONTEXTS
VANISHED = OTHER + SIGNED_CONTEXTS
PLACE = VANISHED + 1  # two for each place of the key before
CONTEXTS = PLACE + 6


class StreamFaces(NamedTuple):
    """What both sides know when faces are coded.

    Attributes:
        by_row: which way faces are told.
        faces: (m, 3) int32 of the stream, turned so that their keys stand first.
        starts: (n + 1,) int64; the faces with key v are numbers[starts[v]:starts[v + 1]].
        numbers: (m,) int64, rows of `faces`.
        vertices: (input vertices,) int64, the stream vertex that each became.
        twin_starts: (n + 1,) int64; the input vertices that became v are twins[twin_starts[v]:twin_starts[v + 1]].
        twins: (input vertices,) int64, ascending for each v.
        expected: (n,) int64, scratch: one more than the rank that was told last for each key, 0 at first.
    """

    by_row: bool
    faces: NDArray[np.int32]
    starts: Indices
    numbers: Indices
    vertices: Indices
    twin_starts: Indices
    twins: Indices
    expected: Indices


@kernel
def code_steps(coder: Coder, buffer: Buffer, contexts: Contexts, values: Indices, end: Integer) -> Integer:
    """Code integers in [0, end), each by its difference from one more than the one before."""
    expected = 0
    for i in range(len(values)):
        value = expected + code_signed(coder, buffer, contexts, STEPS, values[i] - expected)
        if value < 0 or value >= end:
            return BAD_VALUE
        values[i] = value
        expected = value + 1
    return OK


@kernel
def code_faces(
    coder: Coder, buffer: Buffer, contexts: Contexts, stream: StreamFaces, faces: Indices, ranks: Indices, keys: Indices
) -> Integer:
    """Code the input's faces (k, 3), indices of input vertices.

    `ranks` (k,) tells the row of each, or which of the faces with the same key it is, -1 if the stream has no such
    face; `keys` (k,) the place of its key. A decoder fills all three arrays.
    """
    end = len(stream.vertices)
    before = place = next_row = 0
    for face in range(len(faces)):
        vanished = code_adaptive_bit(coder, buffer, contexts, VANISHED, 1 if ranks[face] < 0 else 0)
        if vanished:
            ranks[face] = -1
            for corner in range(3):
                before += code_signed(coder, buffer, contexts, OTHER, faces[face, corner] - before)
                if before < 0 or before >= end:
                    return BAD_VALUE
                faces[face, corner] = before
            continue
        place = _code_place(coder, buffer, contexts, place, keys[face])
        keys[face] = place
        if stream.by_row:
            row = next_row + code_signed(coder, buffer, contexts, RANK, ranks[face] - next_row)
            if row < 0 or row >= len(stream.faces):
                return BAD_VALUE
            ranks[face] = row
            next_row = row + 1
            key = _code_twin(coder, buffer, contexts, KEY, stream, stream.faces[row, 0], before, faces[face, place])
            if key < 0:
                return BAD_VALUE
        else:
            key = before + code_signed(coder, buffer, contexts, KEY, faces[face, place] - before)
            if key < 0 or key >= end:
                return BAD_VALUE
            vertex = stream.vertices[key]
            expected = stream.expected[vertex]
            rank = expected + code_signed(coder, buffer, contexts, RANK, ranks[face] - expected)
            if rank < 0 or rank >= stream.starts[vertex + 1] - stream.starts[vertex]:
                return BAD_VALUE
            ranks[face] = rank
            stream.expected[vertex] = rank + 1
            row = stream.numbers[stream.starts[vertex] + rank]
        faces[face, place] = before = key
        for step in range(1, 3):
            corner = (place + step) % 3
            twins = TWIN + (SIGNED_CONTEXTS if corner < place else 0)
            other = stream.faces[row, step]
            twin = _code_twin(coder, buffer, contexts, twins, stream, other, key, faces[face, corner])
            if twin < 0:
                return BAD_VALUE
            faces[face, corner] = twin
    return OK


@kernel
def _code_place(coder: Coder, buffer: Buffer, contexts: Contexts, before: Integer, place: Integer) -> Integer:
    """Code the place of a key, given that of the face before."""
    base = PLACE + 2 * before
    if code_adaptive_bit(coder, buffer, contexts, base, 1 if place == before else 0):
        return before
    following = (before + 1) % 3
    if code_adaptive_bit(coder, buffer, contexts, base + 1, 1 if place == following else 0):
        return following
    return (before + 2) % 3


@kernel
def _code_twin(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    base: Integer,
    stream: StreamFaces,
    vertex: Integer,
    key: Integer,
    value: Integer,
) -> Integer:
    """Code which input vertex stands at a stream vertex: the first one after the key is expected."""
    low, high = stream.twin_starts[vertex], stream.twin_starts[vertex + 1]
    if high - low == 0:
        return BAD_VALUE
    if high - low == 1:
        return stream.twins[low]
    expected = _first_from(stream.twins, low, high, key + 1)
    step = _first_from(stream.twins, low, high, value) - expected
    place = expected + code_signed(coder, buffer, contexts, base, step)
    if place < low or place >= high:
        return BAD_VALUE
    return stream.twins[place]


@kernel
def _first_from(values: Indices, low: Integer, high: Integer, least: Integer) -> Integer:
    """The first place in [low, high) of the ascending `values` whose value is `least` or more; `high` if none is."""
    while low < high:
        middle = (low + high) // 2
        if values[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low
