"""The encoder's octree: the levels of all depths of a quantized mesh, coarse to fine.

A vertex of depth b is a group of finest vertices whose coordinates agree in their uppermost b bits; a triangle of
depth b is a finest triangle whose corners lie in three different groups. It is the hierarchy of vertex clusters of
Balan & Taubin 2000, section 2, on the dyadic grid, with cells of one vertex kept as leaves.
O((n + m log m) depths until all cells are leaves).
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.level import Level, root_level
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.quantize import LARGEST_B, morton_codes

if TYPE_CHECKING:
    from numpy.typing import NDArray

SMALLEST_BITS = 1  # previews are coarser than what the quantizer takes for whole meshes


@dataclasses.dataclass(frozen=True, eq=False)
class Octree:
    """All levels of a mesh, and the finest positions that they stand for.

    Attributes:
        bits: depth of the finest level.
        positions: (n, 3) int32 finest positions in Morton order.
        levels: the levels of depths 0 to `bits`, with faces.
        first_vertices: per depth, (vertices,) int64: the first finest vertex in each cell, a leaf's only one.
    """

    bits: int
    positions: NDArray[np.int32]
    levels: list[Level]
    first_vertices: list[NDArray[np.int64]]

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(n, 3) area-weighted normals of the finest vertices; zero where there are no faces."""
        return _vertex_normals(self.positions.astype(np.float64), self.levels[-1].faces)


def build_octree(positions: NDArray[np.int32], faces: NDArray[np.int32], bits: int) -> Octree:
    """The levels of the depths 0 to `bits` of a quantized mesh, each with its faces in canonical form.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different, in Morton order.
        faces: (m, 3) int32 triangles; degenerate and repeated ones are dropped.
        bits: depth of the finest level, 1 to 20.

    Raises:
        MeshError: positions or faces are not of that form.
        OptionError: `bits` is out of range.

    >>> corners = np.array([[0, 0, 0], [0, 0, 1], [0, 3, 0], [3, 3, 3]], np.int32)
    >>> levels = build_octree(corners, np.array([[0, 2, 3], [1, 2, 3]], np.int32), 2).levels
    >>> [(level.depth, level.vertex_count, len(level.faces)) for level in levels]
    [(0, 1, 0), (1, 3, 1), (2, 4, 2)]
    >>> levels[1].leaves.tolist()
    [False, True, True]
    """
    codes = _checked_codes(positions, faces, bits)
    levels = [root_level(len(positions))]
    groups_of_levels = [_groups(codes, bits, depth) for depth in range(bits + 1)]
    for depth in range(1, bits + 1):
        coarse = levels[-1]
        if coarse.all_leaves:
            levels.append(coarse.deepened())
        else:
            levels.append(_refined_level(coarse, positions, groups_of_levels[depth - 1], groups_of_levels[depth], bits))
    _attach_faces(levels, faces)
    first_vertices = [groups[:-1] for groups in groups_of_levels]
    return Octree(bits, np.ascontiguousarray(positions, np.int32), levels, first_vertices)


def check_grid_mesh(positions: NDArray[np.int32], faces: NDArray[np.int32], bits: int) -> None:
    """Raise MeshError unless positions (n, 3) lie in [0, 2^bits) and faces (m, 3) refer to them."""
    if positions.ndim != 2 or positions.shape[1] != 3 or len(positions) == 0:
        raise MeshError(f"positions must be an array (n, 3) of at least one vertex, not of shape {positions.shape}")
    if int(positions.min()) < 0 or int(positions.max()) >= 1 << bits:
        raise MeshError(f"positions must be in 0..{(1 << bits) - 1}; quantize the mesh first")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise MeshError(f"faces must be an array (m, 3), not of shape {faces.shape}")
    if len(faces) and (int(faces.min()) < 0 or int(faces.max()) >= len(positions)):
        raise MeshError(f"faces must refer to vertices 0..{len(positions) - 1}")


def _checked_codes(positions: NDArray[np.int32], faces: NDArray[np.int32], bits: int) -> NDArray[np.int64]:
    """Morton codes of the positions, after checking everything that the octree relies on."""
    if not SMALLEST_BITS <= bits <= LARGEST_B:
        raise OptionError(f"the octree's depth must be {SMALLEST_BITS} to {LARGEST_B}, not {bits}")
    check_grid_mesh(positions, faces, bits)
    codes = morton_codes(positions).astype(np.int64)
    if (codes[1:] <= codes[:-1]).any():
        raise MeshError("positions must be pairwise different and in Morton order; weld and sort them first")
    return codes


def _groups(codes: NDArray[np.int64], bits: int, depth: int) -> NDArray[np.int64]:
    """(vertices of `depth` + 1,) the first finest vertex of each group, and the number of finest vertices."""
    prefixes = codes >> (3 * (bits - depth))
    return np.flatnonzero(np.r_[True, prefixes[1:] != prefixes[:-1], True])


def _refined_level(
    coarse: Level, positions: NDArray[np.int32], coarse_groups: NDArray[np.int64], groups: NDArray[np.int64], bits: int
) -> Level:
    depth = coarse.depth + 1
    firsts = groups[:-1]
    parents = np.searchsorted(coarse_groups, firsts, side="right").astype(np.int32) - 1
    inherited = coarse.leaves[parents]
    cell_depths = np.where(inherited, coarse.cell_depths[parents], depth).astype(np.uint8)
    cells = positions[firsts].astype(np.int32) >> (bits - cell_depths.astype(np.int32))[:, None]
    return Level(
        depth=depth,
        cells=np.ascontiguousarray(cells, np.int32),
        cell_depths=cell_depths,
        leaves=np.diff(groups) == 1,
        parents=parents,
    )


def _attach_faces(levels: list[Level], faces: NDArray[np.int32]) -> None:
    """Give every level its faces, finest first; levels above which nothing is split share theirs."""
    current = canonical_faces(faces.astype(np.int32))
    for depth in range(len(levels) - 1, 0, -1):
        if not levels[depth - 1].all_leaves:
            levels[depth] = levels[depth].with_faces(current)
            current = canonical_faces(levels[depth].parents[current])
    for depth in range(1, len(levels)):
        if levels[depth - 1].all_leaves:
            levels[depth] = levels[depth - 1].deepened()


def _vertex_normals(positions: NDArray[np.float64], faces: NDArray[np.int32] | None) -> NDArray[np.float64]:
    """Area-weighted normals of the vertices; zero where there are no faces."""
    normals = np.zeros_like(positions)
    if faces is None or len(faces) == 0:
        return normals
    corners = positions[faces]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for axis in range(3):
        weights = np.repeat(crossed[:, axis], 3)
        normals[:, axis] = np.bincount(faces.ravel(), weights=weights, minlength=len(positions))
    return normals
