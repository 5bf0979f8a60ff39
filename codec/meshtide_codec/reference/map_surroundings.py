"""What the Map coder knows of a cell before its children: neighbours and local frame (docs/format.md, section 8.4)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from meshtide_codec.reference.octree import RING_LIMIT

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Cell, Level

NO_NORMAL = 6
FLAT_PERCENT = 19
LARGEST_HEIGHT = 16


def octant_of(x: bool, y: bool, z: bool) -> int:
    """The octant on the positive side along the axes given."""
    return 4 * x + 2 * y + z


def bit_count(pattern: int) -> int:
    """How many of the eight octants are set."""
    return (pattern & 255).bit_count()


class Surroundings:
    """Counts over a cell's ring, and the frame that makes the order of its octants canonical.

    Args:
        level: the coarser level, with its rings.
        vertex: the cell that is about to be split.
        occupied: children of the cells before it, as bits by octant.
        leaf: which of them are leaves.
    """

    def __init__(self, level: Level, vertex: int, occupied: list[int], leaf: list[int]) -> None:
        ring = level.rings[vertex]
        self.members = ring.members[:RING_LIMIT]
        centre = level.centre(vertex)
        self.offsets = [_difference(level.centre(member), centre) for member in self.members]
        leaves = [member for member in self.members if level.leaves[member]]
        coded = [member for member in self.members if member < vertex and not level.leaves[member]]
        self.leaf_count = len(leaves)
        self.leaf_ages = sum(level.depth - level.cell_depths[member] for member in leaves)
        self.coded_count = len(coded)
        self.coded_children = sum(bit_count(occupied[member]) for member in coded)
        self.coded_leaves = sum(bit_count(leaf[member]) for member in coded)
        self.length = sum(_manhattan(offset) for offset in self.offsets)
        self.votes = _votes(self.offsets)
        self.sides = self._sides(level)
        self._orient(closed=ring.closed)

    @property
    def leaf_ratio(self) -> int:
        """Quarters of the neighbours that are leaves, 5 without neighbours."""
        return 4 * self.leaf_count // len(self.members) if self.members else 5

    @property
    def spacing(self) -> int:
        """floor(4 log2(mean Manhattan distance)), 0 to 15."""
        if not self.members:
            return 0
        value = self.length / len(self.members)
        value *= value
        value *= value
        logarithm = 0
        while value >= 2.0 and logarithm < 15:  # halved until nothing is left to halve
            value *= 0.5
            logarithm += 1
        return logarithm

    def octant(self, rank: int) -> int:
        """The octant at place `rank` of the canonical order."""
        octant = self._flip
        for bit, axis in zip((4, 2, 1), self._axes, strict=True):
            if rank & bit:
                octant ^= 4 >> axis
        return octant

    def _sides(self, level: Level) -> dict[tuple[int, int], int]:
        """Ring members across the cell's faces that are not leaves, by axis and side; a later one wins."""
        sides = {}
        for member, offset in zip(self.members, self.offsets, strict=True):
            if _manhattan(offset) == 2 and not level.leaves[member]:  # the side of a cell
                for axis in range(3):
                    if abs(offset[axis]) == 2:  # all along one axis
                        sides[axis, int(offset[axis] > 0)] = member
        return sides

    def _orient(self, *, closed: bool) -> None:
        """Normal class, order of axes, and the heights of the octants."""
        normal = list(_normal(self.offsets, closed=closed))
        sizes = [abs(component) for component in normal]
        total = sum(sizes)
        offset = 0.0
        if total:
            half = 0.5 / len(self.offsets)
            means = [min(max(sum(column) * half, -1.0), 1.0) for column in zip(*self.offsets, strict=True)]
            offset = (normal[0] * means[0] + normal[1] * means[1] + normal[2] * means[2]) / total
        if offset < 0.0:
            offset = -offset
            normal = [-component for component in normal]
        self._flip = octant_of(normal[0] >= 0, normal[1] >= 0, normal[2] >= 0) ^ 7
        self._axes = sorted(range(3), key=lambda axis: -sizes[axis])
        self.heights = []
        for octant in range(8):
            height = 0.0
            if total:
                aside = sum(normal[axis] if octant & (4 >> axis) else -normal[axis] for axis in range(3))
                height = aside / total - 2.0 * offset
            self.heights.append(min(int((height + 3.0) * 4.0), LARGEST_HEIGHT))
        self.normal_class = NO_NORMAL
        if total:
            first, second, third = (sizes[axis] for axis in self._axes)
            middle = 3 * second // (first + 1)
            self.normal_class = middle * (middle + 1) // 2 + min(3 * third // (first + 1), middle)


def _difference(one: Cell, other: Cell) -> Cell:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def _manhattan(offset: Cell) -> int:
    return abs(offset[0]) + abs(offset[1]) + abs(offset[2])


def _votes(offsets: list[Cell]) -> list[int]:
    """For each octant how many neighbours lie towards it; one that is flat along an axis votes for both sides."""
    votes = [0] * 8
    for offset in offsets:
        flat = [100 * abs(component) < FLAT_PERCENT * _manhattan(offset) for component in offset]
        octant = octant_of(offset[0] > 0, offset[1] > 0, offset[2] > 0)
        for turned in range(7):  # no offset is flat along all axes
            if all(flat[axis] for axis in range(3) if turned & (4 >> axis)):
                votes[octant ^ turned] += 1
    return votes


def _normal(offsets: list[Cell], *, closed: bool) -> tuple[int, int, int]:
    """Sum of the cross products of consecutive offsets."""
    x = y = z = 0
    if len(offsets) > 2:  # two offsets span nothing around a vertex
        pairs = list(pairwise(offsets))
        if closed:
            pairs.append((offsets[-1], offsets[0]))
        for one, other in pairs:
            x += one[1] * other[2] - one[2] * other[1]
            y += one[2] * other[0] - one[0] * other[2]
            z += one[0] * other[1] - one[1] * other[0]
    return x, y, z
