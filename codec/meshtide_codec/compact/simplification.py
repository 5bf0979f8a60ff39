"""Simplified versions of a mesh, by the core (codec/core, surface/simplification.hpp): clusters, then edges collapsed.

Edges are collapsed in the order of quadric error (Garland, Heckbert, "Surface simplification using quadric error
metrics", SIGGRAPH 1997). Previews are made of such meshes inside the core; the comparison with a ladder of levels of
detail asks for them here. O((n + m) log m).
"""

from __future__ import annotations

from ctypes import byref
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Integers = NDArray[np.int32]


class Simplifier:
    """A mesh that gets coarser from call to call.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different, in Morton order.
        faces: (m, 3) int32.
        bits: depth of the grid, 1 to 20.
        finest: the greatest number of vertices that will be asked for.

    Raises:
        MeshError: positions or faces are not of that form.
    """

    def __init__(self, positions: Integers, faces: Integers, bits: int, finest: int) -> None:
        self._handle = core.Handle("mt_simplifier_free")
        mesh = core.GridMesh.lent(
            np.ascontiguousarray(positions, np.int32), np.ascontiguousarray(faces, np.int32), bits
        )
        pointer = byref(self._handle.pointer)
        core.call("mt_simplifier_new", byref(mesh), finest, pointer, argument_error=MeshError)

    def reduced_to(self, target: int) -> tuple[NDArray[np.float64], Integers]:
        """Vertices (k, 3) in grid steps and canonical faces (j, 3) of `target` vertices, or as near as it goes.

        Every vertex is in use.
        """
        reduced = core.Surface()
        core.call("mt_simplifier_reduce", self._handle, target, byref(reduced))
        vertices = core.copied(reduced.vertices, (reduced.vertex_count, 3), np.float64)
        return vertices, core.copied(reduced.faces, (reduced.face_count, 3), np.int32)
