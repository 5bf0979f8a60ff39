"""What is seen of a cell before its children are coded (docs/format.md, section 4).

An encoder sees the same, and has nothing to decide.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from meshtide_codec.reference.levels import (
    NONE,
    RING_LIMIT,
    CellTable,
    Level,
    Point,
    Single,
    Vector,
    cross,
    dot,
    exponent,
    greatest,
    least,
    ring_of,
    vector,
)

AXIS_ORDERS = [(0, 1, 2), (1, 0, 2), (0, 2, 1), (2, 0, 1), (1, 2, 0), (2, 1, 0)]
BITS = (4, 2, 1)
"""Of an octant, for the upper half in x, y, z."""
HEIGHT_ONE = 256
NO_CELL, NO_CHILD, CHILD, LATER_CELL = range(4)
FLAT = Single(0.19)
ZERO = Single(0)


@dataclass
class Made:
    """The children of a cell: masks of all octants that have one, and of those whose child is a leaf."""

    octants: int = 0
    leaves: int = 0

    def halved(self, axis: int, *, upper: bool) -> Made:
        """Those in one half."""
        side = sum(1 << octant for octant in range(8) if bool(octant & BITS[axis]) == upper)
        return Made(self.octants & side, self.leaves & side)

    def turned(self, axis: int) -> Made:
        """Reflected along an axis."""
        return Made(_turned(self.octants, axis), _turned(self.leaves, axis))


def _turned(mask: int, axis: int) -> int:
    return sum(1 << (octant ^ BITS[axis]) for octant in range(8) if mask >> octant & 1)


@dataclass
class Cell:
    """What is known of a vertex of the coarse level, as the walk goes over them.

    Attributes:
        centre: in half finest steps; the fourth number is 0.
        leaf: whether it is one.
        age: of a leaf, by how many depths it is older than the level.
        made: its children, once they are coded.
        place: their mean, or the centre before; the fourth number: how far they were from the expected plane.
        bulge: how far that is from the mean of its ring's places, once it is coded.
    """

    centre: Vector
    leaf: bool
    age: int
    place: Vector
    bulge: Vector
    made: Made | None = None


@dataclass
class Survey:
    """What is known of a cell's surroundings before its children are coded; lengths in half cells."""

    members: list[Cell]
    votes: list[int] = field(default_factory=lambda: [0] * 8)
    leaf_votes: list[int] = field(default_factory=lambda: [0] * 8)
    contacts: list[list[int]] = field(default_factory=lambda: [[NO_CELL] * 7 for _ in range(8)])
    touching_cells: list[int] = field(default_factory=lambda: [0] * 8)
    touching_children: list[int] = field(default_factory=lambda: [0] * 8)
    touching_leaves: list[int] = field(default_factory=lambda: [0] * 8)
    length: Single = ZERO
    mean: Vector = field(default_factory=lambda: vector(0, 0, 0))
    oriented: bool = False
    normal: list[Single] = field(default_factory=lambda: [ZERO] * 3)
    height: Single = ZERO
    axes: tuple[int, int, int] = AXIS_ORDERS[0]
    flip: int = 0

    def octant(self, rank: int) -> int:
        """The octant of a rank: bit 4 of a rank stands for the first of the axes."""
        turned = sum(BITS[axis] for bit, axis in zip(BITS, self.axes, strict=True) if rank & bit)
        return turned ^ self.flip


class Vicinity:
    """The cells of the coarse level, as the walk goes over them.

    Args:
        coarse: the level.
        bits: of the grid.
        mirror: axis and sum, or an axis of -1.
        high: effort high.

    Attributes:
        cells: of all vertices.
        step: half a coarse cell, in half finest steps.
    """

    def __init__(self, coarse: Level, bits: int, mirror: tuple[int, int], *, high: bool) -> None:
        self._coarse = coarse
        self._bits = bits
        self._mirror = mirror
        self._high = high
        self.step = Single(1 << (bits - coarse.depth))
        self._side = 2 << (bits - coarse.depth)  # of a coarse cell
        self.cells = [self._new_cell(vertex) for vertex in range(len(coarse))]
        inner = [vertex for vertex, leaf in enumerate(coarse.leaves) if not leaf]
        self._table = CellTable(len(inner))
        for vertex in inner:
            self._table.put(self._grid_cell(vertex), vertex)

    def _new_cell(self, vertex: int) -> Cell:
        centre = vector(*self._coarse.centres[vertex])
        age = self._coarse.depth - self._coarse.cell_depths[vertex]
        return Cell(centre, self._coarse.leaves[vertex], age, centre, vector(0, 0, 0))

    def _grid_cell(self, vertex: int) -> Point:
        x, y, z = self._coarse.centres[vertex]
        return x // self._side, y // self._side, z // self._side

    def _find(self, cell: Point) -> int:
        limit = 1 << self._coarse.depth
        return self._table.find(cell) if all(0 <= coordinate < limit for coordinate in cell) else NONE

    def survey(self, vertex: int) -> Survey:
        """What is seen of a cell."""
        cell = self.cells[vertex]
        ring = ring_of(self._coarse, vertex)
        survey = Survey([self.cells[member] for member in ring.members[:RING_LIMIT]])
        scale = Single(1) / self.step
        zero = vector(0, 0, 0)
        mean, known, bulge, turn = zero, zero, zero, zero
        places: list[Vector] = []
        for member in survey.members:
            offset = (member.centre - cell.centre) * scale
            x, y, z = (float(value) for value in offset[:3])
            length = Single(abs(x) + abs(y) + abs(z))
            survey.length += length
            votes = _votes(offset, length)
            for octant in votes:
                survey.votes[octant] += 1
                survey.leaf_votes[octant] += member.leaf
            if not member.leaf and not self._high:
                _touch_from_ring(survey, offset, member)
            place = (member.place - cell.centre) * vector(scale, scale, scale, 1)
            mean = mean + place
            if member.made is not None:
                known = known + place
                bulge = bulge + member.bulge
            if places:
                turn = turn + cross(places[-1], place)
            places.append(place)
        if len(places) < 3:
            turn = zero
        elif ring.closed:
            turn = turn + cross(places[-1], places[0])
        plane = zero
        if places:
            count, coded = Single(len(places)), Single(sum(member.made is not None for member in survey.members))
            plane = (Single(0.5) * mean + Single(0.2) * known) * (Single(1) / (count + Single(0.2) * coded))
            plane = plane + bulge * (Single(0.7) * scale / (coded + Single(1)))
            survey.mean = mean * (Single(1) / count)
            survey.mean[3] = mean[3]
        _find_frame(survey, turn, plane)
        if self._high:
            self._touch_all(survey, vertex)
        return survey

    def _touch_all(self, survey: Survey, vertex: int) -> None:
        """All 26 neighbours that touch the cell."""
        home = self._grid_cell(vertex)
        for x in (-1, 0, 1):
            for y in (-1, 0, 1):
                for z in (-1, 0, 1):
                    neighbour = self._find((home[0] + x, home[1] + y, home[2] + z))
                    if (x, y, z) != (0, 0, 0) and neighbour != NONE:
                        _touch(survey, (x, y, z), self.cells[neighbour])

    def image(self, vertex: int) -> Made | None:
        """The children of the cell's mirror image, reflected, as far as its halves have one that is coded."""
        axis, coordinate_sum = self._mirror
        cell = list(self._grid_cell(vertex))
        shift = self._bits - self._coarse.depth
        home = cell[axis]
        image = Made()
        known = False
        for half in (0, 1):
            middle = (4 * home + 2 * half + 1) << (shift - 1)
            landing = (2 * (coordinate_sum + 1) - middle) >> shift  # a half cell
            cell[axis] = landing >> 1
            other = self._find((cell[0], cell[1], cell[2]))
            if landing < 0 or other == NONE:
                continue
            made = self.cells[other].made
            if other >= vertex or made is None:
                return None
            if landing & 1 != half:
                made = made.turned(axis)
            made = made.halved(axis, upper=half == 1)
            image = Made(image.octants | made.octants, image.leaves | made.leaves)
            known = True
        return image if known else None


def _votes(offset: Vector, length: Single) -> list[int]:
    """The octants that an offset votes for: the one where it lies, and those beside it along axes where it is flat."""
    home = sum(bit for bit, value in zip(BITS, offset[:3], strict=True) if value > 0)
    flat = sum(bit for bit, value in zip(BITS, offset[:3], strict=True) if abs(value) < FLAT * length)
    return [home ^ change for change in range(8) if change & ~flat == 0]


def _touch_from_ring(survey: Survey, offset: Vector, member: Cell) -> None:
    """A member that lies one cell away along each of some axes touches the cell."""
    steps = [int(np.sign(value)) if abs(value) == 2 else 0 for value in offset[:3]]
    if any(steps) and all(value in {-2, 0, 2} for value in offset[:3]):
        _touch(survey, (steps[0], steps[1], steps[2]), member)


def _touch(survey: Survey, steps: Point, neighbour: Cell) -> None:
    """Note a neighbour for the octants that touch it: of these, what of its children lies beside them."""
    axes = [axis for axis in range(3) if steps[axis]]
    across = sum(BITS[axis] for axis in axes)
    direction = axes[0] if len(axes) == 1 else 3 + (3 - axes[0] - axes[1]) if len(axes) == 2 else 6
    for octant in range(8):
        if any(bool(octant & BITS[axis]) != (steps[axis] > 0) for axis in axes):
            continue
        if neighbour.made is None:
            survey.contacts[octant][direction] |= LATER_CELL
            continue
        child = neighbour.made.octants >> (octant ^ across) & 1
        survey.contacts[octant][direction] |= CHILD if child else NO_CHILD
        survey.touching_cells[octant] += 1
        survey.touching_children[octant] += child
        survey.touching_leaves[octant] += neighbour.made.leaves >> (octant ^ across) & 1


def _find_frame(s: Survey, turn: Vector, plane: Vector) -> None:
    """The order of the octants, so that the surface is expected low in the order of ranks."""
    size = abs(turn)
    total = Single(size[0] + size[1] + size[2])
    if not total > Single(1e-5):
        return
    s.oriented = True
    inverse = Single(1) / total
    plane = greatest(least(plane, 1), -1)
    s.height = dot(turn, plane) * inverse
    downwards = turn < 0
    if s.height < 0:
        s.height = -s.height
        downwards = turn > 0
    s.flip = sum(bit for bit, below in zip(BITS, downwards[:3], strict=True) if below)
    size = size * inverse
    x, y, z = size[:3]
    order = (0 if y >= z else 2 if x >= z else 3) if x >= y else (1 if x >= z else 4 if y >= z else 5)
    s.axes = AXIS_ORDERS[order]
    s.normal = [size[axis] for axis in s.axes]


class CellFacts:
    """What contexts are made of: classes of what is seen of a cell."""

    def __init__(self, s: Survey, recent: int, recent_leaves: int) -> None:
        members = s.members
        n = len(members)
        leaves = sum(member.leaf for member in members)
        coded = [member.made for member in members if member.made is not None]
        children = sum(made.octants.bit_count() for made in coded)
        child_leaves = sum(made.leaves.bit_count() for made in coded)
        ages = sum(member.age for member in members if member.leaf)
        self._survey = s
        self.recent, self.recent_leaves = recent, recent_leaves
        self.mirror = self.trusted = 0
        self.density = min((4 * children - 3 * len(coded)) // (2 * len(coded)), 5) if coded else 6
        self.ratio = 4 * leaves // n if n else 5
        self.coded_ratio = min(5 * child_leaves // children, 4) if children else 5
        self.degree = min(n, 15)
        self.age = min(3 * ages // (2 * leaves), 5) if leaves else 6
        distance = s.length / Single(n) if n else Single(0)
        distance = distance * distance
        self.spacing = min(max(exponent(distance * distance), 0), 15)
        self.normal_class, self.fit = 6, 11
        if s.oriented:
            third = Single(3) / s.normal[0]
            second = min(int(s.normal[1] * third), 2)
            self.normal_class = second * (second + 1) // 2 + min(int(s.normal[2] * third), second)
            self.fit = 10
            if coded:
                self.fit = int(min(s.mean[3] * Single(8) / Single(len(coded)), Single(9)))
        self.heights = [self._height(s, rank) for rank in range(8)]

    @staticmethod
    def _height(s: Survey, rank: int) -> int:
        """Of an octant's middle over the expected plane, 256 in a half cell."""
        one = Single(HEIGHT_ONE)
        first, second, third = s.normal
        low = (second if rank & 2 else -second) + (third if rank & 1 else -third)
        low = (low - Single(2) * s.height) * one
        return int(low + first * one) if rank & 4 else int(low - first * one)

    def touches(self, octant: int) -> tuple[int, int, int]:
        """What touches an octant across faces, across edges (three in base 4, by the frame's axes), and the corner."""
        found = self._survey.contacts[octant]
        a, b, c = self._survey.axes
        return found[a] * 16 + found[b] * 4 + found[c], found[3 + a] * 16 + found[3 + b] * 4 + found[3 + c], found[6]

    def distance_class(self, height: int) -> int:
        """How far an octant is from the plane."""
        return 23 if self.normal_class == 6 else min(abs(height) >> 4, 22)
