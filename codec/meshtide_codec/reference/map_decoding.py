"""The Map: which children of each cell are occupied, and which are leaves (docs/format.md, section 8.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.deep_mixing import DeepNeurons
from meshtide_codec.reference.map_deep_decisions import ChildClasses, OctantClasses, leaf_bit, octant_bit
from meshtide_codec.reference.map_surface import CellSurfaces
from meshtide_codec.reference.map_surroundings import Surroundings, bit_count
from meshtide_codec.reference.octree import Cell, Level

if TYPE_CHECKING:
    from meshtide_codec.reference.mirror import Images
    from meshtide_codec.reference.mixing import Neurons
    from meshtide_codec.reference.range_decoder import RangeDecoder

RATE = 16
LIMIT = 60
MIRROR_TRUST_LIMIT = 4

# Where each block of contexts begins; the blocks' sizes follow from the classes that make a place.
PARTIAL = 0
SIDES = PARTIAL + 256 * 7 * 4
DENSITY = SIDES + 64 * 27
MIRROR = DENSITY + 8 * 5 * 7 * 6
HEIGHT = MIRROR + 3 * 5 * 8 * 5
SHELL = HEIGHT + 17 * 27 * 7
LEAF_RATIO = SHELL + 64 * 17 * 4
LEAF_SPACING = LEAF_RATIO + 4 * 4 * 4 * 6 * 6
LEAF_VOTES = LEAF_SPACING + 16 * 16 * 4 * 4
LEAF_MIRROR = LEAF_VOTES + 4 * 4 * 6
LEAF_AGE = LEAF_MIRROR + 3 * 5 * 16
LEAF_CODED = LEAF_AGE + 7 * 16 * 4 * 4
LEAF_NEURONS = 8 * 4 * 3
"""The first neuron of the leaf flags."""


def decode_map(
    decoder: RangeDecoder, coarse: Level, bits: int, neurons: Neurons | DeepNeurons, images: Images | None
) -> Level:
    """The next depth's level, without faces.

    Args:
        decoder: where the Map begins.
        coarse: the level before, with faces.
        bits: depth of the finest level.
        neurons: the states after the Map before; they learn.
        images: where the mirror plane takes the halves of the cells, if there is one.
    """
    coder = _MapDecoder(decoder, coarse, neurons, images, last_depth=coarse.depth + 1 == bits)
    for vertex in range(len(coarse)):
        if not coarse.leaves[vertex]:
            coder.split(vertex)
    return _children(coarse, coder.occupied, coder.leaf)


class _MapDecoder:
    """Splits one cell after the other."""

    def __init__(
        self,
        decoder: RangeDecoder,
        coarse: Level,
        neurons: Neurons | DeepNeurons,
        images: Images | None,
        *,
        last_depth: bool,
    ) -> None:
        self._decoder = decoder
        self._coarse = coarse
        self._neurons = neurons
        self._images = images
        self._last_depth = last_depth
        self._trust = 0
        self._surfaces = CellSurfaces(coarse)
        self.occupied = [0] * len(coarse)
        self.leaf = [0] * len(coarse)

    def split(self, vertex: int) -> None:
        """Decode the children of a cell."""
        around = Surroundings(self._coarse, vertex, self.occupied, self.leaf)
        mirrored = None
        mirror_state = 0
        if self._images is not None:
            mirrored = self._images.children(vertex, self.occupied, self.leaf)
            mirror_state = 1 if mirrored is None else 2 + min(self._trust, 2)
        deep = isinstance(self._neurons, DeepNeurons)
        if deep:
            self._surfaces.fit(vertex)
        pattern = self._octants(vertex, around, mirrored, mirror_state)
        flags = pattern if self._last_depth else 0
        if bit_count(pattern) > 1 and not self._last_depth:
            flags = self._leaf_flags(pattern, around, mirrored, mirror_state)
        if deep:
            self._surfaces.note_children(vertex, pattern)
        self.occupied[vertex] = pattern
        self.leaf[vertex] = flags
        if mirrored is not None:
            right = mirrored == pattern | flags << 8
            self._trust = min(self._trust + 1, MIRROR_TRUST_LIMIT) if right else self._trust >> 1

    def _octants(self, vertex: int, around: Surroundings, mirrored: int | None, mirror_state: int) -> int:
        """Which octants are occupied."""
        minimum = 2 if self._last_depth else 1
        density = 6
        if around.coded_count:
            density = min((4 * around.coded_children - 3 * around.coded_count) // (2 * around.coded_count), 5)
        pattern = count = 0
        answers = 1
        for rank in range(8):
            octant = around.octant(rank)
            bit = 1
            if count + 8 - rank > minimum:
                vote = min(around.votes[octant], 3)
                outer = self._outer_states(octant, vertex, around)
                inner = _inner_states(rank, answers)
                height = around.heights[octant]
                answer = 0 if mirrored is None else 1 + (mirrored >> octant & 1)
                places = [
                    PARTIAL + (answers * 7 + around.normal_class) * 4 + vote,
                    SIDES + outer * 27 + inner,
                    DENSITY + ((rank * 5 + min(count, 4)) * 7 + density) * 6 + around.leaf_ratio,
                    MIRROR + ((answer * 5 + mirror_state) * 8 + rank) * 5 + min(count, 4),
                    HEIGHT + (height * 27 + inner) * 7 + around.normal_class,
                    SHELL + (outer * 17 + height) * 4 + min(count, 3),
                ]
                neuron = (rank * 4 + min(count, 3)) * 3 + _trust_class(mirrored, mirror_state)
                if isinstance(self._neurons, DeepNeurons):
                    own = OctantClasses(
                        octant, rank, count, answers, inner, vote, height, density, answer, mirror_state
                    )
                    bit = octant_bit(self._decoder, self._neurons, neuron, places, own, around, self._surfaces)
                else:
                    bit = self._neurons.bit(self._decoder, neuron, places, RATE, LIMIT)
            answers = 2 * answers + bit
            count += bit
            pattern |= bit << octant
        return pattern

    def _outer_states(self, octant: int, vertex: int, around: Surroundings) -> int:
        """For each axis the child across the octant's outer face: no cell, empty, occupied, not known yet."""
        states = 0
        for axis in range(3):
            side = octant >> (2 - axis) & 1
            state = 0
            neighbour = around.sides.get((axis, side))
            if neighbour is not None and neighbour < vertex:
                state = 1 + (self.occupied[neighbour] >> (octant ^ (4 >> axis)) & 1)
            elif neighbour is not None:
                state = 3
            states = 4 * states + state
        return states

    def _leaf_flags(self, pattern: int, around: Surroundings, mirrored: int | None, mirror_state: int) -> int:
        """Which of two or more children are leaves."""
        size = min(bit_count(pattern), 5) - 2
        ratio = around.leaf_ratio
        coded_ratio = min(5 * around.coded_leaves // around.coded_children, 4) if around.coded_children else 5
        degree = min(len(around.members), 15)
        age = min(3 * around.leaf_ages // (2 * around.leaf_count), 5) if around.leaf_count else 6
        spacing = around.spacing
        canonical = sum((pattern >> around.octant(rank) & 1) << rank for rank in range(8))
        flags = asked = found = 0
        for rank in range(8):
            octant = around.octant(rank)
            if not pattern >> octant & 1:
                continue
            split = min(asked - found, 3)
            leaves = min(found, 3)
            vote = min(around.votes[octant], 3)
            answer = 0 if mirrored is None else 1 + (mirrored >> (8 + octant) & 1)
            places = [
                LEAF_RATIO + (((size * 4 + split) * 4 + leaves) * 6 + ratio) * 6 + coded_ratio,
                LEAF_SPACING + ((degree * 16 + spacing) * 4 + size) * 4 + split,
                LEAF_VOTES + (vote * 4 + split) * 6 + ratio,
                LEAF_MIRROR + (answer * 5 + mirror_state) * 16 + size * 4 + split,
                LEAF_AGE + ((age * 16 + spacing) * 4 + size) * 4 + split,
                LEAF_CODED + ((coded_ratio * 16 + degree) * 4 + size) * 4 + leaves,
            ]
            neuron = (size * 4 + split) * 3 + _trust_class(mirrored, mirror_state)
            if isinstance(self._neurons, DeepNeurons):
                own = ChildClasses(octant, pattern, canonical, split, leaves, size, vote, coded_ratio, degree, age)
                bit = leaf_bit(self._decoder, self._neurons, neuron, places, own, around, self._surfaces)
            else:
                bit = self._neurons.bit(self._decoder, LEAF_NEURONS + neuron, places, RATE, LIMIT)
            asked += 1
            found += bit
            flags |= bit << octant
        return flags


def _inner_states(rank: int, answers: int) -> int:
    """For each axis of the canonical order the sibling across the octant's inner face: empty, occupied, not asked."""
    states = 0
    for bit in (4, 2, 1):
        other = rank ^ bit
        state = answers >> (rank - 1 - other) & 1 if other < rank else 2
        states = 3 * states + state
    return states


def _trust_class(mirrored: int | None, mirror_state: int) -> int:
    if mirrored is None:
        return 0
    return 1 if mirror_state < 4 else 2  # from 4 on the mirror image is mostly right


def _children(coarse: Level, occupied: list[int], leaf: list[int]) -> Level:
    """The level that the patterns describe; leaves pass on as they are."""
    fine = Level(coarse.depth + 1, [], [], [], [])
    for vertex, cell in enumerate(coarse.cells):
        if coarse.leaves[vertex]:
            _append(fine, cell, coarse.cell_depths[vertex], vertex, leaf=True)
            continue
        for octant in range(8):
            if occupied[vertex] >> octant & 1:
                child = (2 * cell[0] + (octant >> 2), 2 * cell[1] + (octant >> 1 & 1), 2 * cell[2] + (octant & 1))
                _append(fine, child, fine.depth, vertex, leaf=bool(leaf[vertex] >> octant & 1))
    return fine


def _append(level: Level, cell: Cell, cell_depth: int, parent: int, *, leaf: bool) -> None:
    level.cells.append(cell)
    level.cell_depths.append(cell_depth)
    level.leaves.append(leaf)
    level.parents.append(parent)
