"""A whole stream to the mesh of one level (docs/format.md, sections 1 to 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import ContainerError
from meshtide_codec.mesh import Mesh
from meshtide_codec.reference.classic import decode_classic
from meshtide_codec.reference.compact import decode_compact
from meshtide_codec.reference.container import read_stream

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Face

    Drawn = tuple[list[list[float]], list[Face]]
    """Positions in finest steps, and faces."""


def reference_decode(data: bytes, level: int = 0) -> Mesh:
    """The mesh of one level of a whole `.tide` file, in the unit of the input; the same bits as `decode` gives.

    Raises:
        StreamError: the file is damaged; not all damage is noticed, since this decoder is for reading.
        KeyError: the stream has no such level.

    >>> from meshtide_codec.encoder import encode
    >>> triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> reference_decode(encode(triangle).to_bytes())
    Mesh(3 vertices, 1 faces)
    """
    stream = read_stream(data)
    if stream.profile == "compact":
        positions, faces = decode_compact(stream, level)
    elif stream.profile == "classic":
        positions, faces = decode_classic(stream, level)
    else:
        raise ContainerError(f"unknown profile {stream.profile!r}")
    step = stream.extent / ((1 << stream.bits) - 1)
    vertices = [[position[axis] * step + stream.origin[axis] for axis in range(3)] for position in positions]
    return Mesh(np.array(vertices, np.float64).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3))
