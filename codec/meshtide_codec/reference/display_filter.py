"""What is drawn of a level whose vertices are known up to a cell (docs/format.md, section 8.7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_codec.reference.diff_decoding import SliceDecoder
    from meshtide_codec.reference.octree import Cell, Level

STRENGTH_UNIT = 128


@dataclass(frozen=True)
class KnownCell:
    """The smallest cell known to hold a vertex: its middle and half its side, in half finest steps."""

    middle: Cell
    half_side: int


def known_cells(level: Level, slices: list[SliceDecoder], bits: int) -> list[KnownCell]:
    """For each vertex of a level the cell that Maps and Diffs have told."""
    known = [_cell(cell, depth, bits) for cell, depth in zip(level.cells, level.cell_depths, strict=True)]
    for state in slices:
        told = [
            vertex
            for vertex in state.vertices(level)
            if level.leaves[vertex] and level.cell_depths[vertex] <= state.depth
        ]
        cells = [
            cell for cell, leaf_depth in zip(state.cells, state.leaf_depths, strict=True) if leaf_depth <= level.depth
        ]
        for vertex, cell in zip(told, cells, strict=True):
            known[vertex] = _cell(cell, state.depth, bits)
    return known


def _cell(cell: Cell, depth: int, bits: int) -> KnownCell:
    half_side = 1 << (bits - depth)
    x, y, z = cell
    return KnownCell(((2 * x + 1) * half_side, (2 * y + 1) * half_side, (2 * z + 1) * half_side), half_side)


def drawn(level: Level, known: list[KnownCell], strength_byte: int) -> list[list[float]]:
    """Positions in finest steps: each middle drawn towards its ring's mean, kept inside the cell."""
    strength = strength_byte / STRENGTH_UNIT
    positions = []
    for ring, cell in zip(level.rings, known, strict=True):
        position = [float(coordinate) for coordinate in cell.middle]
        if ring.members and cell.half_side > 1:
            for axis in range(3):
                mean = sum(known[member].middle[axis] for member in ring.members) / len(ring.members)
                moved = position[axis] - strength * (position[axis] - mean)
                lowest, highest = cell.middle[axis] - cell.half_side, cell.middle[axis] + cell.half_side
                position[axis] = min(max(moved, float(lowest)), float(highest))
        positions.append([0.5 * (coordinate - 1.0) for coordinate in position])
    return positions
