"""What is drawn of a level whose vertices are known up to a cell (docs/format.md, section 8.7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_codec.reference.diff_decoding import SliceDecoder
    from meshtide_codec.reference.octree import Cell, Level

STRENGTH_UNIT = 128
Strength = tuple[int, int]
"""Of the step towards the mean, and of the one away from it."""
STRENGTHS: list[Strength] = [
    (0, 0), (13, 13), (26, 26), (38, 26), (51, 0), (64, 26), (64, 38), (64, 51),
    (64, 64), (77, 51), (77, 64), (96, 0), (96, 51), (96, 64), (115, 0), (115, 64),
]  # fmt: skip
"""What the four bits of a depth stand for."""


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


def drawn(level: Level, known: list[KnownCell], strength: Strength) -> list[list[float]]:
    """Positions in finest steps: each middle is drawn towards its ring's mean, then away from it."""
    smoothing, sharpening = strength
    positions = [[float(coordinate) for coordinate in cell.middle] for cell in known]
    positions = _moved(level, known, positions, smoothing / STRENGTH_UNIT)
    positions = _moved(level, known, positions, -sharpening / STRENGTH_UNIT)
    return [[0.5 * (coordinate - 1.0) for coordinate in position] for position in positions]


def _moved(level: Level, known: list[KnownCell], before: list[list[float]], factor: float) -> list[list[float]]:
    """Positions moved along their offset from the ring's mean, kept inside the cells."""
    positions = []
    for vertex, (ring, cell) in enumerate(zip(level.rings, known, strict=True)):
        position = list(before[vertex])
        if ring.members and cell.half_side > 1:
            for axis in range(3):
                mean = sum(before[member][axis] for member in ring.members) / len(ring.members)
                moved = position[axis] - factor * (position[axis] - mean)
                lowest, highest = cell.middle[axis] - cell.half_side, cell.middle[axis] + cell.half_side
                position[axis] = min(max(moved, float(lowest)), float(highest))
        positions.append(position)
    return positions
