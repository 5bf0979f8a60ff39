"""Which vertex of level 0 each input vertex became (docs/format.md, section 3)."""

from __future__ import annotations

from meshtide_codec.reference.container import PERMUTATION, read_stream
from meshtide_codec.reference.models import SIGNED_CONTEXTS, Contexts
from meshtide_codec.reference.numbers import read_number
from meshtide_codec.reference.range_decoder import RangeDecoder


def reference_permutation(data: bytes) -> list[int] | None:
    """For each input vertex its vertex, or None if the stream does not tell.

    Raises:
        StreamError: the file is damaged.

    >>> from meshtide_codec.encoder import encode
    >>> from meshtide_codec.mesh import Mesh
    >>> triangle = Mesh.checked([[0, 1, 0], [1, 0, 0], [0, 0, 0]], [[0, 1, 2]])
    >>> reference_permutation(encode(triangle, store_permutation=True).to_bytes())
    [1, 2, 0]
    """
    payload = read_stream(data).payloads.get((PERMUTATION, 0, 0))
    if payload is None:
        return None
    count, position = read_number(payload, 0)
    decoder = RangeDecoder(payload[position:])
    contexts = Contexts.fresh(SIGNED_CONTEXTS)
    vertices: list[int] = []
    for _ in range(count):
        expected = vertices[-1] + 1 if vertices else 0
        vertices.append(expected + contexts.signed(decoder, 0))
    decoder.finish()
    return vertices
