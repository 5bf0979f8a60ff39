"""Where the mirror plane takes cells and vertices (docs/format.md, section 8.6)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_codec.reference.octree import Cell, Level

PROBE_LIMIT = 16
REACH = 3.6  # half cells along the axis


class Mirror:
    """The plane across `axis` that takes finest coordinate x to `coordinate_sum` - x."""

    def __init__(self, axis: int, coordinate_sum: int, bits: int) -> None:
        self.axis = axis
        self._sum = coordinate_sum
        self._bits = bits

    def plane(self, depth: int) -> float:
        """What a position and its image sum up to, in half cells of `depth`."""
        return 2.0 * (self._sum + 1) / (1 << (self._bits - depth))

    def images(self, level: Level) -> Images:
        """Where the halves of the level's cells land."""
        split = [vertex for vertex in range(len(level)) if not level.leaves[vertex]]
        table = CellTable((level.cells[vertex], vertex) for vertex in split)
        targets: dict[tuple[int, int], tuple[int, int]] = {}
        shift = self._bits - level.depth - 1
        for vertex in split:
            for side in range(2):
                doubled_centre = (2 * (2 * level.cells[vertex][self.axis] + side) + 1) << shift
                half = (2 * (self._sum + 1) - doubled_centre) >> (shift + 1)
                along = half >> 1
                if 0 <= along < 1 << level.depth:
                    found = table.find(_moved(level.cells[vertex], self.axis, along))
                    if found is not None:
                        targets[vertex, side] = (found, half & 1)
        return Images(self.axis, targets)


class Images:
    """For a cell and one of its halves: the cell and the half that it lands in."""

    def __init__(self, axis: int, targets: dict[tuple[int, int], tuple[int, int]]) -> None:
        self._axis_bit = 4 >> axis
        self._targets = targets

    def children(self, vertex: int, occupied: list[int], leaf: list[int]) -> int | None:
        """What the image's children suggest: occupied octants in bits 0..7, leaves in 8..15; None if not known."""
        pattern = 0
        found = [side for side in range(2) if (vertex, side) in self._targets]
        if not found or any(self._targets[vertex, side][0] >= vertex for side in found):
            return None
        for side in found:
            cell, half = self._targets[vertex, side]
            for octant in range(8):
                if octant & self._axis_bit == 0:
                    source = octant | self._axis_bit * half
                    target = octant | self._axis_bit * side
                    pattern |= (occupied[cell] >> source & 1) << target
                    pattern |= (leaf[cell] >> source & 1) << (8 + target)
        return pattern


class CellTable:
    """A hash table of cells, of which some are left out where too many share a place.

    Args:
        entries: cells and what stands for them; of equal cells the first one stays.
    """

    def __init__(self, entries: Iterable[tuple[Cell, int]]) -> None:
        listed = list(entries)
        self._size = 4
        while self._size < 2 * len(listed) + 2:
            self._size *= 2
        self._table: dict[int, tuple[Cell, int]] = {}
        for cell, value in listed:
            for place in self._places(cell):
                held = self._table.setdefault(place, (cell, value))
                if held[0] == cell:
                    break

    def find(self, cell: Cell) -> int | None:
        """What stands for a cell, or None."""
        for place in self._places(cell):
            if place not in self._table:
                return None
            if self._table[place][0] == cell:
                return self._table[place][1]
        return None

    def _places(self, cell: Cell) -> Iterable[int]:
        home = (cell[0] * 73856093) ^ (cell[1] * 19349663) ^ (cell[2] * 83492791)
        return ((home + step) % self._size for step in range(PROBE_LIMIT))


def nearest_image(cell: Cell, position: list[float], axis: int, plane: float, depth: int) -> tuple[float, list[Cell]]:
    """Where the image of a leaf lies along the axis, and the cells of depth - 1 to look for its partner in."""
    image = plane - position[axis]
    middle = math.floor(image * 0.25)
    around = [along for along in range(middle - 1, middle + 2) if 0 <= along < 1 << (depth - 1)]
    return image, [_moved(cell, axis, along) for along in around]


def _moved(cell: Cell, axis: int, along: int) -> Cell:
    """The cell with another coordinate along the axis."""
    x, y, z = cell
    return ((along, y, z), (x, along, z), (x, y, along))[axis]
