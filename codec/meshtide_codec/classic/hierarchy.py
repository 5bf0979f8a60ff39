"""The hierarchy of levels by clustering (paper, section 3).

The unit cube's grid is coarsened by K bits per coordinate at a time; all vertices in a coarser cell collapse to one
that sits at the cell's centre. A level that hardly collapses anything is skipped. Cost: O(m log m) per level.

All geometry is in finest steps: the vertex of cell c at a level that dropped s bits sits at (c + 1/2) 2^s - 1/2, so
at level 0 it sits at the grid point itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh import canonical_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.quantize import QuantizedMesh


@dataclass(frozen=True, slots=True)
class HierarchyLevel:
    """One level of the hierarchy.

    Args:
        shift: bits per coordinate that it has dropped.
        cells: (n, 3) int32, each vertex's cell in units of its own grid, in Morton order.
        faces: (m, 3) int32, canonical.
        parents: (n,) int32, non-decreasing: the map to the vertices of the next coarser level; None at the coarsest.
    """

    shift: int
    cells: NDArray[np.int32]
    faces: NDArray[np.int32]
    parents: NDArray[np.int32] | None


def hierarchy_of(quantized: QuantizedMesh, options: ClassicOptions) -> list[HierarchyLevel]:
    """The levels of a mesh as `options` want them, see `build_hierarchy`."""
    return build_hierarchy(
        quantized.positions,
        quantized.faces,
        quantized.bits,
        drop_bits=options.drop_bits,
        minimum_ratio=options.minimum_ratio,
        coarsest_vertices=options.coarsest_vertices,
    )


def build_hierarchy(
    positions: NDArray[np.int32],
    faces: NDArray[np.int32],
    bits: int,
    *,
    drop_bits: int = 1,
    minimum_ratio: float = 1.5,
    coarsest_vertices: int = 300,
) -> list[HierarchyLevel]:
    """The levels of a quantized mesh, level 0 (the mesh itself) first.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), distinct, in Morton order.
        faces: (m, 3) int32, canonical.
        bits: B.
        drop_bits: K.
        minimum_ratio: the vertex ratio of neighbouring levels is at least this.
        coarsest_vertices: stop at the first level with at most so many vertices.

    >>> line = np.array([[0, 0, 0], [1, 0, 0], [6, 0, 0], [7, 0, 0]], np.int32)
    >>> levels = build_hierarchy(line, np.zeros((0, 3), np.int32), 4, coarsest_vertices=2)
    >>> [(level.shift, level.cells[:, 0].tolist(), level.parents) for level in levels]
    [(0, [0, 1, 6, 7], array([0, 0, 1, 1], dtype=int32)), (1, [0, 3], None)]
    """
    levels = []
    cells, shift = positions, 0
    while True:
        step = _next_step(cells, bits - shift, drop_bits, minimum_ratio) if len(cells) > coarsest_vertices else None
        if step is None:
            levels.append(HierarchyLevel(shift, cells, faces, None))
            return levels
        coarse_cells, first_child = _collapse(cells, step)
        parents = (np.cumsum(first_child) - 1).astype(np.int32)
        levels.append(HierarchyLevel(shift, cells, faces, parents))
        cells, shift = coarse_cells, shift + step
        faces = canonical_faces(parents[faces].astype(np.int32))


def cell_centres(cells: NDArray[np.integer] | NDArray[np.floating], shift: int) -> NDArray[np.float64]:
    """Positions, in finest steps, of the vertices of `cells` (n, 3) at a level that dropped `shift` bits."""
    return (cells.astype(np.float64) + 0.5) * float(1 << shift) - 0.5


def within_cube(geometry: NDArray[np.float64], bits: int) -> NDArray[np.float64]:
    """Positions in finest steps, those outside of the cube taken to its border.

    No true vertex lies outside, so this only improves a prediction; and it bounds what a hostile stream can do.
    """
    return np.clip(geometry, -0.5, float(1 << bits) - 0.5)


def containing_cells(geometry: NDArray[np.float64], shift: int, bits: int) -> NDArray[np.int64]:
    """The cells (n, 3) of a level which hold positions inside the cube, given in finest steps.

    This is how a prediction is rounded.
    """
    cells = np.floor((geometry + 0.5) / float(1 << shift))
    return np.minimum(cells, float((1 << (bits - shift)) - 1)).astype(np.int64)


def _next_step(cells: NDArray[np.int32], bits_left: int, drop_bits: int, minimum_ratio: float) -> int | None:
    """How many more bits the next kept level drops; None when no coarser level collapses enough."""
    for step in range(drop_bits, bits_left + 1, drop_bits):
        coarse_cells, _ = _collapse(cells, step)
        if len(cells) >= minimum_ratio * len(coarse_cells) and len(coarse_cells) < len(cells):
            return step
    return None


def _collapse(cells: NDArray[np.int32], step: int) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """The occupied cells after dropping `step` bits, and which vertices are the first ones in theirs.

    Morton order keeps the vertices of a coarser cell next to each other.
    """
    coarse = cells >> step
    first_child = np.ones(len(cells), bool)
    first_child[1:] = (coarse[1:] != coarse[:-1]).any(axis=1)
    return coarse[first_child], first_child
