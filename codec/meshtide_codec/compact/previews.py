"""Previews: a few small meshes that open a stream, each as close to the original as its bytes allow.

The core makes them (codec/core, surface/previews.hpp): the mesh is simplified, its vertices are fitted to the original
surface, then rounded to a coarse grid over the same cube. A preview is coded like any mesh, on its own, by effort
default: 15 to 23 bits for each of its vertices on surfaces, 30 on meshes of many parts. What it shows is measured by
the encoder like any level.
"""

from __future__ import annotations

from ctypes import byref
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec import core
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.quantize import LARGEST_B, grid_steps

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Integers = NDArray[np.int32]


class Preview(NamedTuple):
    """A small mesh on a coarse grid over the same cube as the original.

    Attributes:
        positions: (k, 3) int32 in [0, 2^bits), pairwise different, in Morton order.
        faces: (j, 3) int32 in canonical form; every vertex is in use.
        bits: depth of the grid; `dequantize(positions, bits, origin, extent)` with the original's cube places it.
        payload: of its packet.
    """

    positions: Integers
    faces: Integers
    bits: int
    payload: bytes

    def vertices(self, bits: int) -> NDArray[np.float64]:
        """(k, 3) float64 positions in the steps of the original's grid of depth `bits`."""
        return self.positions.astype(np.float64) * (grid_steps(bits) / grid_steps(self.bits))


def choose_previews(positions: Integers, faces: Integers, bits: int) -> list[Preview]:
    """Previews of a quantized mesh, coarsest first: for each distance of a list the smallest one that is so close.

    There are fewer than distances, or none, where previews make no sense: the mesh is small, has no faces, cannot be
    simplified so far, or falls apart when it is. The same arguments give the same previews.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different, in Morton order.
        faces: (m, 3) int32.
        bits: B, depth of the grid, 1 to 20.

    Raises:
        OptionError: `bits` is out of range.
        MeshError: positions or faces are not of that form.

    >>> choose_previews(np.zeros((1, 3), np.int32), np.zeros((0, 3), np.int32), bits=12)
    []
    """
    previews = core.Handle("mt_previews_free")
    mesh = _lent_mesh(positions, faces, bits)
    core.call("mt_previews_choose", byref(mesh), core.states(0), byref(previews.pointer), argument_error=MeshError)
    return _copied(previews)


def make_previews(positions: Integers, faces: Integers, bits: int, ratios: Iterable[int]) -> list[Preview]:
    """Previews of a quantized mesh, coarsest first, each of about 1/ratio of its vertices.

    Args:
        positions: as for `choose_previews`, like `faces` and `bits`.
        faces: (m, 3) int32.
        bits: B.
        ratios: vertices of the mesh for one of each preview, in any order, 2 or more.

    Raises:
        OptionError: a ratio or `bits` is out of range.
        MeshError: positions or faces are not of that form.

    >>> make_previews(np.zeros((1, 3), np.int32), np.zeros((0, 3), np.int32), bits=12, ratios=(256, 40))
    []
    """
    wanted = sorted(set(ratios))
    if wanted and wanted[0] < 2:
        raise OptionError(f"a preview must have fewer vertices than the mesh: ratio {wanted[0]} is less than 2")
    previews = core.Handle("mt_previews_free")
    core.call(
        "mt_previews_make",
        byref(_lent_mesh(positions, faces, bits)),
        np.array(wanted, np.uint64),
        len(wanted),
        core.states(0),
        byref(previews.pointer),
        argument_error=MeshError,
    )
    return _copied(previews)


def _lent_mesh(positions: Integers, faces: Integers, bits: int) -> core.GridMesh:
    if not 1 <= bits <= LARGEST_B:
        raise OptionError(f"the grid's depth must be 1 to {LARGEST_B}, not {bits}")
    for name, array in (("positions", positions), ("faces", faces)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise MeshError(f"{name} must be an array (n, 3), not of shape {array.shape}")
    return core.GridMesh.lent(np.ascontiguousarray(positions, np.int32), np.ascontiguousarray(faces, np.int32), bits)


def _copied(previews: core.Handle) -> list[Preview]:
    count, made = core.library().mt_previews_count(previews), core.library().mt_previews_list(previews)
    return [
        Preview(one.mesh.copied_positions(), one.mesh.copied_faces(), one.mesh.bits, one.payload.copied())
        for one in made[:count]
    ]
