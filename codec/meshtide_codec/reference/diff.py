"""Diffs: one more bit of each coordinate of every leaf of a slice (docs/format.md, section 9).

An encoder decides the slices, at which depths their Diffs end, and whether there is a mirror, and where.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.coding import Question, Shape
from meshtide_codec.reference.levels import NONE, Single, Vector, before, dot, ring_of, vector
from meshtide_codec.reference.surroundings import (
    ERROR_CLASSES,
    Mirror,
    Neighbour,
    Reflection,
    Row,
    Surroundings,
    Vertex,
    WideView,
    clamped,
    compare,
    look_around,
    look_wide,
    place,
    sides,
    signed_class,
    size_class,
    step_class,
    turned,
)

if TYPE_CHECKING:
    from meshtide_codec.reference.coding import Mixer, RangeDecoder
    from meshtide_codec.reference.levels import Level

NEW_ERROR, FOREIGN_ERROR = 1.0, 4.0  # of vertices that have just arisen, and of other slices'
TRUSTED = 7  # the mirror state from which on the partner is known and few partners around differ
MIRROR_STATES = 9
SLANT = Single(0.15)
STEEP = Single(3.999)
JOINT_PLACES = 4 * 4 * 7 * 8 * 5

CONTEXT_SIZES = [
    12 * 10 * 2 * 6, JOINT_PLACES + 8 * MIRROR_STATES * 2, 3 * 3 * 16 * 8, 16 * 7 * 7,
    5 * 4 * 3 * 4 * 2, 10 * 8 * 3 * 3 * 5, 16 * 8 * 4 * 4, 12 * 9 * 8 * 8,
    24 * 4 * ERROR_CLASSES, 12 * 9 * 9 * 4, 5 * 5 * 3 * 3 * 4, 16 * 9 * 9,
    16 * 8 * 4 * 4, 12 * 9 * 8 * 8, 16 * 8 * 4 * 4, 12 * 9 * 4 * 4,
]  # fmt: skip
NEURON_SIZES = [
    ERROR_CLASSES * 4, MIRROR_STATES * 3 * 3, 8 * 8, 16 * 3,
    3 * 8 * 3, ERROR_CLASSES * 4, 8 * 8, 5 * 5 * 3,
]  # fmt: skip
DEFAULT_CONTEXTS, DEFAULT_NEURONS = 4, 2  # of these
FINAL_NEURONS = 3 * 8

DEFAULT_SHAPE = Shape(
    contexts=sum(CONTEXT_SIZES[:DEFAULT_CONTEXTS]),
    neurons=sum(NEURON_SIZES[:DEFAULT_NEURONS]),
    final_neurons=FINAL_NEURONS,
    groups=1,
    rate=4,
    settled=65536 // 16,
    shift=10,
    final_shift=8,
)
HIGH_SHAPE = Shape(
    contexts=sum(CONTEXT_SIZES),
    neurons=sum(NEURON_SIZES),
    final_neurons=FINAL_NEURONS,
    groups=4,
    rate=4,
    settled=65536 // 16,
    shift=10,
    final_shift=8,
)


class Slice:
    """A run of vertices in Morton order, and what Diffs have made known of them.

    Args:
        bits: of the grid.
        first, end: Morton codes of the lowest finest steps; no end for the last slice.
        mixer: trained.
        mirror: axis and sum, or an axis of -1.
    """

    def __init__(
        self, bits: int, first: int, end: int | None, mixer: Mixer, mirror: tuple[int, int], *, high: bool
    ) -> None:
        self._bits = bits
        self._first, self._end = first, end
        self._mixer = mixer
        self._mirror = Mirror(*mirror) if mirror[0] >= 0 else None
        self._high = high
        self._parents: range = range(0)
        self._vertices: list[Vertex] = []
        self.known_depth = 0

    def run_of(self, level: Level) -> range:
        """The vertices of a level that are the slice's."""
        inside = []
        for vertex, (centre, depth) in enumerate(zip(level.centres, level.cell_depths, strict=True)):
            side = self._bits - depth
            code = _morton_code([coordinate >> (side + 1) << side for coordinate in centre], self._bits)
            if self._first <= code and (self._end is None or code < self._end):
                inside.append(vertex)
        return range(inside[0], inside[-1] + 1) if inside else range(0)

    def enter(self, level: Level) -> None:
        """Go on to the next level: leaves stay what they are, all others are new."""
        old = dict(zip(self._parents, self._vertices, strict=True))
        self._parents = self.run_of(level)
        self._vertices = []
        for vertex in self._parents:
            leaf_depth = level.cell_depths[vertex] if level.leaves[vertex] else None
            parent = old.get(level.parents[vertex])
            if parent is not None and parent.leaf_depth is not None:
                self._vertices.append(parent)
            else:
                row = Row(vector(*level.centres[vertex], level.depth), vector(0, 0, 0, NEW_ERROR))
                self._vertices.append(Vertex(row, leaf_depth))
        self._gather_rings(level)

    def _gather_rings(self, level: Level) -> None:
        """Rings as rows, those of other slices' vertices behind the slice's own; and the Laplacians."""
        self._rows = [vertex.row for vertex in self._vertices]
        self._rings: list[list[Neighbour]] = []
        self._closed: list[bool] = []
        self._shares: list[Single] = []
        for row, vertex in zip(list(self._rows), self._parents, strict=True):
            ring = ring_of(level, vertex)
            neighbours = []
            total = vector(0, 0, 0)
            for member, way in zip(ring.members, ring.ways, strict=True):
                back = NONE if way == NONE else level.twins[way]
                across = NONE if back == NONE else level.corners[before(back)]
                neighbour = Neighbour(self._row_of(level, member), self._row_of(level, across))
                neighbours.append(neighbour)
                total = total + self._rows[neighbour.member].position
            share = Single(1) / Single(len(neighbours)) if neighbours else Single(0)
            error = row.laplacian[3]
            row.laplacian = total * share - row.position if neighbours else vector(0, 0, 0)
            row.laplacian[3] = error
            self._rings.append(neighbours)
            self._closed.append(ring.closed)
            self._shares.append(share)

    def _row_of(self, level: Level, vertex: int) -> int:
        """A vertex as a row; NONE for NONE."""
        if vertex == NONE:
            return NONE
        if vertex in self._parents:
            return vertex - self._parents.start
        self._rows.append(Row(vector(*level.centres[vertex]), vector(0, 0, 0, FOREIGN_ERROR)))
        return len(self._rows) - 1

    def decode_plane(self, decoder: RangeDecoder, depth: int) -> None:
        """The bit plane of a depth, the one after the last that is known."""
        self._half = Single(1 << (self._bits - depth))  # half a cell, in half finest steps
        for row in self._rows[len(self._vertices) :]:
            row.position[3] = depth - 1
        if self._mirror:
            self._mirror.find_partners(self._vertices, depth, self._half)
        self._surface_errors: dict[int, Single] = {}
        for number, vertex in enumerate(self._vertices):
            if vertex.leaf_depth is not None and vertex.leaf_depth < depth:
                self._decode_vertex(decoder, number, vertex, depth)
        self.known_depth = depth

    def _decode_vertex(self, decoder: RangeDecoder, number: int, vertex: Vertex, depth: int) -> None:
        own, ring = vertex.row, self._rings[number]
        seen = look_around(self._rows, own, ring, self._half, closed=self._closed[number])
        wide = None
        if self._high:
            errors = [self._surface_errors[n.member] for n in ring if n.member in self._surface_errors]
            wide = look_wide(seen, own, errors)
        reflection, mirror_axis = Reflection(vector(0, 0, 0)), -1
        if self._mirror:
            around = [self._vertices[n.member] for n in ring if n.member < len(self._vertices)]
            reflection, mirror_axis = self._mirror.look(vertex, around, self._half), self._mirror.axis
        assert vertex.leaf_depth is not None  # noqa: S101 - owners are leaves
        asking = Asking(seen, wide, reflection, mirror_axis, min(depth - vertex.leaf_depth, 8) - 1)
        steps = vector(0, 0, 0)
        if wide is None:
            questions = [asking.question(axis, seen.plane[axis], Single(0)) for axis in range(3)]
            steps[:3] = [1 if bit else -1 for bit in self._mixer.bits(decoder, questions)]
        else:
            # The axis nearest to the normal last: by then the others have settled where on the surface the vertex is.
            lean = seen.normal / (seen.normal * seen.normal + SLANT)
            surface_lean = wide.normal / (wide.normal * wide.normal + SLANT)
            carried = surface_carried = Single(0)
            for axis in sorted(range(3), key=seen.rank.__getitem__):
                plane = seen.plane[axis] - lean[axis] * carried
                quadric = wide.quadric[axis] - surface_lean[axis] * surface_carried
                step = Single(1 if self._mixer.bits(decoder, [asking.question(axis, plane, quadric)])[0] else -1)
                carried += (step - seen.plane[axis]) * seen.normal[axis]
                surface_carried += (step - wide.quadric[axis]) * wide.normal[axis]
                steps[axis] = step
            self._surface_errors[number] = abs(dot(steps, wide.normal) - wide.height)
        compare(vertex, reflection, steps)
        self._move(vertex, ring, steps, seen.smoothed, depth)

    def _move(self, vertex: Vertex, ring: list[Neighbour], steps: Vector, expected: Vector, depth: int) -> None:
        """The vertex is where it is now, and its neighbours see it there."""
        row = vertex.row
        error, way = abs(steps - expected), steps * self._half
        row.position = row.position + way
        row.position[3] = depth
        row.laplacian = row.laplacian - way
        row.laplacian[3] = (error[0] + error[1] + error[2]) * (Single(1) / Single(3))
        for neighbour in ring:
            if neighbour.member < len(self._vertices):
                seen = self._rows[neighbour.member]
                seen.laplacian = seen.laplacian + way * self._shares[neighbour.member]

    def known_cells(self, level: Level) -> dict[int, Vector]:
        """For the leaves of a level that Diffs have refined: the middle and the depth of the known cell."""
        known = min(level.depth, self.known_depth)
        leaves = [v.row.position for v in self._vertices if v.leaf_depth is not None and v.leaf_depth <= known]
        run = [v for v in self.run_of(level) if level.leaves[v] and level.cell_depths[v] <= self.known_depth]
        return dict(zip(run, leaves, strict=False))


class Asking:
    """The questions about one owner: contexts with the directions that they speak of, numbers, neurons.

    Args:
        wide: at effort high.
        age: bit planes since the owner became a leaf, less one, up to 7.
    """

    def __init__(
        self, seen: Surroundings, wide: WideView | None, reflection: Reflection, mirror_axis: int, age: int
    ) -> None:
        self._seen = seen
        self._wide = wide
        self._reflection = reflection
        self._mirror_axis = mirror_axis
        self._age = age

    def question(self, axis: int, plane: Single, quadric: Single) -> Question:
        """What a bit of an axis is mixed from."""
        contexts = self._contexts(axis, plane)
        if self._wide is not None:
            contexts += self._more_contexts(axis, plane)
            contexts += self._wide_contexts(self._wide, axis, plane, quadric)
        neurons = self._neurons(axis)
        places = [sum(CONTEXT_SIZES[:block]) + place for block, (_, place) in enumerate(contexts)]
        asked = [sum(NEURON_SIZES[:block]) + neuron for block, neuron in enumerate(neurons)]
        opposed = [bool(sign) for sign, _ in contexts]
        final_neuron = self._seen.rank[axis] * 8 + self._age
        return Question(places, opposed, self._numbers(axis, plane, quadric), asked, final_neuron)

    def _contexts(self, axis: int, plane: Single) -> list[tuple[bool, int]]:
        """Contexts 0 to 3: whether they are seen from the other side, and their places."""
        s = self._seen
        far, ring = s.far_mean[axis], s.in_ring.offset[axis]
        midpoint, across = s.midpoint.offset[axis], s.across.offset[axis]
        agreeing, opposing = sides(s.below[axis], s.above[axis], ring < 0, 2)
        return [
            (
                plane < 0,
                place(
                    (size_class(plane, 12), 12),
                    (size_class(far, 10, 1.5), 10),
                    (plane * far > 0, 2),
                    (s.error_class >> 2, 6),
                ),
            ),
            self._joint(axis, plane) if self._reflection.state == 0 else self._mirrored(axis),
            (ring < 0, place((agreeing, 3), (opposing, 3), (size_class(ring, 16), 16), (s.in_ring.trust, 8))),
            (
                across < 0,
                place(
                    (size_class(across, 16), 16),
                    (step_class(turned(ring, across < 0), 3), 7),
                    (step_class(turned(midpoint, across < 0), 3), 7),
                ),
            ),
        ]

    def _joint(self, axis: int, plane: Single) -> tuple[bool, int]:
        """Context 1 without a mirror image."""
        s = self._seen
        expert = s.midpoint if s.midpoint.trust else s.in_ring
        guess = expert.offset[axis] if expert.trust else plane
        agreeing, opposing = sides(s.below[axis], s.above[axis], guess < 0, 3)
        beside = step_class(turned(plane, guess < 0), 3)
        return bool(guess < 0), place(
            (agreeing, 4), (opposing, 4), (beside, 7), (size_class(guess, 8), 8), (min(s.midpoint.trust, 4), 5)
        )

    def _mirrored(self, axis: int) -> tuple[bool, int]:
        """Context 1 with one."""
        offset, state = self._reflection.offset[axis], self._reflection.state
        distance = clamped(abs(offset) * Single(2) + Single(0.5), 0, 7)
        return offset < 0, JOINT_PLACES + place((distance, 8), (state, MIRROR_STATES), (axis == self._mirror_axis, 2))

    def _more_contexts(self, axis: int, plane: Single) -> list[tuple[bool, int]]:
        """Contexts 4 to 7."""
        s = self._seen
        below, level, above = s.below[axis], s.level[axis], s.above[axis]
        smoothed, across_mean = s.smoothed[axis], s.across_mean[axis]
        midpoint, across = s.midpoint.offset[axis], s.across.offset[axis]
        steep, trust = int(abs(s.normal[axis]) * STEEP), s.midpoint.trust
        aligned = above < below or (above == below and smoothed < 0)
        alike = turned(smoothed, aligned) > 0
        ahead = clamped(turned(plane, across < 0) * Single(2) + Single(2.5), 0, 4)
        agreeing, opposing = sides(below, above, across < 0, 2)
        return [
            (
                aligned,
                place(
                    (min(max(above, below), 4), 5),
                    (min(above, below, 3), 4),
                    (min(level, 2), 3),
                    (size_class(smoothed, 4), 4),
                    (alike, 2),
                ),
            ),
            (
                across < 0,
                place((size_class(across, 10), 10), (s.across.trust, 8), (agreeing, 3), (opposing, 3), (ahead, 5)),
            ),
            (midpoint < 0, place((size_class(midpoint, 16), 16), (trust, 8), (steep, 4), (s.known_class, 4))),
            (
                midpoint < 0,
                place(
                    (size_class(midpoint, 12), 12),
                    (step_class(turned(across_mean, midpoint < 0), 4), 9),
                    (self._age, 8),
                    (trust, 8),
                ),
            ),
        ]

    def _wide_contexts(self, wide: WideView, axis: int, plane: Single, quadric: Single) -> list[tuple[bool, int]]:
        """Contexts 8 to 15."""
        s = self._seen
        far, across_mean, pairs = s.far_mean[axis], s.across_mean[axis], wide.pairs.offset[axis]
        ring, midpoint, across = s.in_ring.offset[axis], s.midpoint.offset[axis], s.across.offset[axis]
        steep, slope = int(abs(s.normal[axis]) * STEEP), int(abs(wide.normal[axis]) * STEEP)
        below, above = wide.below[axis], wide.above[axis]
        aligned = above < below or (above == below and quadric < 0)
        nearing = size_class(quadric, 4) if turned(quadric, aligned) > 0 else 0
        agreeing, opposing = sides(s.below[axis], s.above[axis], aligned, 2)
        known, trust = s.known_class, s.midpoint.trust
        plane_side, midpoint_side = (step_class(turned(x, quadric < 0), 4) for x in (plane, midpoint))
        return [
            (quadric < 0, place((size_class(quadric, 24), 24), (slope, 4), (wide.surface_class, ERROR_CLASSES))),
            (quadric < 0, place((size_class(quadric, 12), 12), (plane_side, 9), (midpoint_side, 9), (slope, 4))),
            (
                aligned,
                place(
                    (min(max(above, below), 4), 5),
                    (min(above, below, 4), 5),
                    (agreeing, 3),
                    (opposing, 3),
                    (nearing, 4),
                ),
            ),
            (
                across < 0,
                place(
                    (size_class(across, 16), 16),
                    (signed_class(turned(quadric, across < 0)), 9),
                    (signed_class(turned(pairs, across < 0)), 9),
                ),
            ),
            (pairs < 0, place((size_class(pairs, 16), 16), (wide.pairs.trust, 8), (slope, 4), (known, 4))),
            (
                pairs < 0,
                place(
                    (size_class(pairs, 12), 12), (signed_class(turned(ring, pairs < 0)), 9), (self._age, 8), (trust, 8)
                ),
            ),
            (ring < 0, place((size_class(ring, 16), 16), (s.in_ring.trust, 8), (steep, 4), (known, 4))),
            (
                far < 0,
                place(
                    (size_class(far, 12), 12), (step_class(turned(across_mean, far < 0), 4), 9), (steep, 4), (known, 4)
                ),
            ),
        ]

    def _numbers(self, axis: int, plane: Single, quadric: Single) -> list[int]:
        s, wide = self._seen, self._wide
        other = wide.pairs.offset if wide is not None and self._reflection.state == 0 else self._reflection.offset
        last = s.smoothed[axis] if wide is None else quadric
        guesses = [s.far_mean, s.across_mean, s.across_spread, s.midpoint.offset, s.across.offset, other]
        values = [plane, *(guess[axis] for guess in guesses), last]
        return [clamped(value * Single(256), -2047, 2047) for value in values]

    def _neurons(self, axis: int) -> list[int]:
        s, wide, state = self._seen, self._wide, self._reflection.state
        rank = s.rank[axis]
        neurons = [
            s.error_class * 4 + s.known_class,
            (state * 3 + min(s.above[axis], 2)) * 3 + min(s.below[axis], 2),
        ]
        if wide is not None:
            trust = 0 if state == 0 else 2 if state >= TRUSTED else 1
            neurons += [
                s.in_ring.trust * 8 + s.midpoint.trust,
                min(len(s.ring), 15) * 3 + rank,
                (rank * 8 + self._age) * 3 + trust,
                wide.surface_class * 4 + int(abs(wide.normal[axis]) * STEEP),
                wide.pairs.trust * 8 + s.across.trust,
                (min(wide.below[axis], 4) * 5 + min(wide.above[axis], 4)) * 3 + rank,
            ]
        return neurons


def _morton_code(steps: list[int], bits: int) -> int:
    """The bits of x, y, z interleaved, x highest."""
    code = 0
    for place_of_bit in range(bits - 1, -1, -1):
        for step in steps:
            code = 2 * code + (step >> place_of_bit & 1)
    return code
