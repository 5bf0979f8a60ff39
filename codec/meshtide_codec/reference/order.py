"""How the input's vertices and faces stood (docs/format.md, section 3)."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

from meshtide_codec.reference.container import ORDER, read_stream
from meshtide_codec.reference.decoder import reference_decode
from meshtide_codec.reference.models import SIGNED_CONTEXTS, Contexts
from meshtide_codec.reference.numbers import read_number
from meshtide_codec.reference.range_decoder import RangeDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Face

STEPS, KEY, RANK, TWIN_BEHIND, TWIN_BEFORE, OTHER, VANISHED = (SIGNED_CONTEXTS * place for place in range(7))
PLACE = VANISHED + 1


def reference_order(data: bytes) -> tuple[list[int], list[Face]] | None:
    """For each input vertex its vertex of level 0, and the input's faces; None if the stream does not tell.

    Raises:
        StreamError: the file is damaged.

    >>> from meshtide_codec.encoder import encode
    >>> from meshtide_codec.mesh import Mesh
    >>> triangle = Mesh.checked([[0, 1, 0], [1, 0, 0], [0, 0, 0]], [[1, 2, 0], [2, 2, 1]])
    >>> reference_order(encode(triangle, store_order=True).to_bytes())
    ([1, 2, 0], [(1, 2, 0), (2, 2, 1)])
    """
    payload = read_stream(data).payloads.get((ORDER, 0, 0))
    if payload is None:
        return None
    stream = reference_decode(data)
    vertex_count, position = read_number(payload, 0)
    face_count, position = read_number(payload, position)
    by_row, position = read_number(payload, position)
    decoder = RangeDecoder(payload[position:])
    contexts = Contexts.fresh(PLACE + 6)
    vertices: list[int] = []
    for _ in range(vertex_count):
        vertices.append((vertices[-1] + 1 if vertices else 0) + contexts.signed(decoder, STEPS))
    twins: list[list[int]] = [[] for _ in stream.vertices]
    for number, vertex in enumerate(vertices):
        twins[vertex].append(number)
    rows = [_turned(face, twins, by_row=by_row == 1) for face in stream.faces.tolist()]
    faces = _faces(decoder, contexts, face_count, (rows, vertices, twins), by_row=by_row == 1)
    decoder.finish()
    return vertices, faces


def _faces(
    decoder: RangeDecoder,
    contexts: Contexts,
    count: int,
    known: tuple[list[Face], list[int], list[list[int]]],
    *,
    by_row: bool,
) -> list[Face]:
    """The input's faces, given the faces of level 0 from their keys on, and how vertices of both sides belong."""
    rows, vertices, twins = known
    keyed: list[list[Face]] = [[] for _ in twins]
    for turned in rows:
        keyed[turned[0]].append(turned)
    expected = [0] * len(keyed)
    faces: list[Face] = []
    before = place = next_row = 0
    for _ in range(count):
        corners = [0, 0, 0]
        if contexts.bit(decoder, VANISHED):
            for corner in range(3):
                before += contexts.signed(decoder, OTHER)
                corners[corner] = before
        else:
            base = PLACE + 2 * place
            if not contexts.bit(decoder, base):
                place = (place + (1 if contexts.bit(decoder, base + 1) else 2)) % 3
            if by_row:
                row = next_row + contexts.signed(decoder, RANK)
                next_row = row + 1
                turned = rows[row]
                before = _twin(decoder, contexts, KEY, twins[turned[0]], before)
            else:
                before += contexts.signed(decoder, KEY)
                vertex = vertices[before]
                rank = expected[vertex] + contexts.signed(decoder, RANK)
                expected[vertex] = rank + 1
                turned = keyed[vertex][rank]
            corners[place] = before
            for step in (1, 2):
                corner = (place + step) % 3
                base = TWIN_BEFORE if corner < place else TWIN_BEHIND
                corners[corner] = _twin(decoder, contexts, base, twins[turned[step]], before)
        faces.append((corners[0], corners[1], corners[2]))
    return faces


def _turned(face: list[int], twins: list[list[int]], *, by_row: bool) -> Face:
    """A face of level 0 that begins at its key."""
    named = [twins[vertex][0] for vertex in face]
    first = 0 if by_row else named.index(max(named))
    return face[first], face[(first + 1) % 3], face[(first + 2) % 3]


def _twin(decoder: RangeDecoder, contexts: Contexts, base: int, twins: list[int], key: int) -> int:
    """The input vertex that a corner is, among those that became its vertex."""
    if len(twins) == 1:
        return twins[0]
    return twins[bisect_left(twins, key + 1) + contexts.signed(decoder, base)]
