"""A second decoder, written from docs/format.md for reading: plain Python, a chapter for each section of the document.

It shares no decoding code with the core and is held against it bit for bit by the tests, so that the document, the
core and this decoder agree. It takes some seconds for every thousand vertices.

=============== ==========================================================================
`header`        1, the file: preamble, header, packets
`coding`        2, decisions from bytes: range coder, contexts, integers, mixed decisions
`states`        3, what coders know before a stream begins
`levels`        4, cells, triangles, rings
`map`           5, which octants of each cell have children
`candidates`    6, who may be the apex of a new face
`faces`         7, the walk that codes faces
`surroundings`  8, what a vertex' neighbours say of its next bits
`diff`          9, the bits
`compact`       10, profile compact: packets, previews, what is drawn
`classic`       11, profile classic: filters and Diffs
`order`         12, how the input stood
=============== ==========================================================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh import Mesh
from meshtide_codec.reference.classic import decode_classic
from meshtide_codec.reference.compact import decode_compact
from meshtide_codec.reference.header import COMPACT, ORDER, Header, Key, read_stream
from meshtide_codec.reference.order import OrderDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.compact import Drawn
    from meshtide_codec.reference.levels import Point

__all__ = ["reference_decode", "reference_levels", "reference_order"]


def reference_decode(data: bytes, level: int = 0) -> Mesh:
    """The mesh of one level of a whole `.tide` file, in the unit of the input; the same bits as `decode` gives.

    Raises:
        StreamError: the file is damaged.
        KeyError: the stream has no such level.

    >>> from meshtide_codec.encoder import encode
    >>> triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> reference_decode(encode(triangle).to_bytes())
    Mesh(3 vertices, 1 faces)
    """
    stream = read_stream(data)
    header = stream.header
    needed = list(stream.payloads.items())[: header.packets_for(level)]
    positions, faces = reference_levels(header, dict(needed))[level]
    step = header.extent / ((1 << header.bits) - 1)
    vertices = [[position[axis] * step + header.origin[axis] for axis in range(3)] for position in positions]
    return Mesh(np.array(vertices, np.float64).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3))


def reference_levels(header: Header, payloads: dict[Key, bytes]) -> dict[int, Drawn]:
    """Positions in finest steps, and faces, of all levels and previews that some of a stream's packets give.

    Raises:
        StreamError: the packets are damaged.
    """
    without_order = {key: payload for key, payload in payloads.items() if key[0] != ORDER}
    with np.errstate(all="ignore"):
        return (decode_compact if header.profile == COMPACT else decode_classic)(header, without_order)


def reference_order(data: bytes) -> tuple[list[int], list[Point]] | None:
    """For each input vertex its vertex of level 0, and the input's faces; None if the stream does not store them.

    Raises:
        StreamError: the file is damaged.

    >>> from meshtide_codec.encoder import encode
    >>> triangle = Mesh.checked([[0, 1, 0], [1, 0, 0], [0, 0, 0]], [[1, 2, 0], [2, 2, 1]])
    >>> reference_order(encode(triangle, store_order=True).to_bytes())
    ([1, 2, 0], [(1, 2, 0), (2, 2, 1)])
    """
    stream = read_stream(data)
    payload = stream.payloads.get((ORDER, 0, 0))
    if payload is None:
        return None
    positions, faces = reference_levels(stream.header, stream.payloads)[0]
    return OrderDecoder(payload, faces, len(positions)).decode()
