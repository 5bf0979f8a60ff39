"""Maps: which octants of each cell have children, and which of these are leaves (docs/format.md, section 5).

An encoder has nothing to decide: the octree is that of the finest vertices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.coding import Shape
from meshtide_codec.reference.levels import Level, Single, vector
from meshtide_codec.reference.survey import BITS, HEIGHT_ONE, CellFacts, Made, Survey, Vicinity

if TYPE_CHECKING:
    from meshtide_codec.reference.coding import Mixer, RangeDecoder
    from meshtide_codec.reference.survey import Cell

FIRST_RECENT = 96

# Of each effort: how many places each context has, how many neurons there are of each kind; first those of octants.
DEFAULT_CONTEXTS = [[256, 1728, 1680, 600, 6912, 1275, 20480, 3564], [1088, 1024, 1024, 240, 256, 3600, 4374, 96]]
DEFAULT_NEURONS = [[96, 112, 16], [32, 24, 64]]
HIGH_CONTEXTS = [
    [7168, 1728, 10752, 600, 16384, 4352, 20480, 3564, 4096, 110592, 6912, 4096],
    [1088, 1024, 1024, 240, 4096, 3600, 4374, 384, 9216, 25600, 2304, 4096],
]
HIGH_NEURONS = [[96, 112, 16, 64, 27, 144], [32, 24, 64, 36, 112, 256]]
FINAL_NEURONS = 24
RATE, SETTLED = 4, 65536 // 18


def _total(blocks: list[list[int]]) -> int:
    return sum(blocks[0]) + sum(blocks[1])


DEFAULT_SHAPE = Shape(
    contexts=_total(DEFAULT_CONTEXTS),
    neurons=_total(DEFAULT_NEURONS),
    final_neurons=FINAL_NEURONS,
    groups=2,
    rate=RATE,
    settled=SETTLED,
    shift=11,
    final_shift=11,
)
HIGH_SHAPE = Shape(
    contexts=_total(HIGH_CONTEXTS),
    neurons=_total(HIGH_NEURONS),
    final_neurons=FINAL_NEURONS,
    groups=3,
    rate=RATE,
    settled=SETTLED,
    shift=10,
    final_shift=10,
)


class MapDecoder:
    """Decodes one Map.

    Args:
        coarse: the level that is split.
        bits: of the grid.
        vertices: of the finest mesh.
        mixer: what the Maps before have learned.
        mirror: axis and sum, or an axis of -1.
        high: effort high.
    """

    def __init__(
        self,
        decoder: RangeDecoder,
        coarse: Level,
        mixer: Mixer,
        *,
        bits: int,
        vertices: int,
        mirror: tuple[int, int],
        high: bool,
    ) -> None:
        self._decoder = decoder
        self._coarse = coarse
        self._mixer = mixer
        self._vertices = vertices
        self._mirrored = mirror[0] >= 0
        self._high = high
        self._last = coarse.depth + 1 == bits
        self._vicinity = Vicinity(coarse, bits, mirror, high=high)
        self._needed = sum(1 if leaf else 2 for leaf in coarse.leaves)  # finest vertices that there must be
        self._trust = 0
        self._recent, self._recent_leaves = FIRST_RECENT, 0

    def decode(self) -> Level:
        """The cells of the next depth, without faces; the coarse level learns its children."""
        cells = self._vicinity.cells
        for vertex, cell in enumerate(cells):
            if not cell.leaf:
                self._decode_cell(vertex, cell)
        if self._needed > self._vertices:
            raise MapConnError("more cells than vertices")
        coarse = self._coarse
        fine = Level(coarse.depth + 1, [], [], [], [])
        for vertex, cell in enumerate(cells):
            coarse.first_children.append(len(fine))
            if cell.made is None:
                fine.centres.append(coarse.centres[vertex])
                fine.cell_depths.append(coarse.cell_depths[vertex])
                fine.leaves.append(True)
                fine.parents.append(vertex)
            else:
                self._add_children(fine, vertex, cell.made)
        coarse.first_children.append(len(fine))
        if all(fine.leaves) and len(fine) != self._vertices:
            raise MapConnError("fewer cells than vertices")
        return fine

    def _add_children(self, fine: Level, vertex: int, made: Made) -> None:
        """Children follow in the order of octants."""
        quarter = int(self._vicinity.step) // 2
        for octant in range(8):
            if made.octants >> octant & 1:
                x, y, z = (
                    middle + (quarter if octant & bit else -quarter)
                    for middle, bit in zip(self._coarse.centres[vertex], BITS, strict=True)
                )
                fine.centres.append((x, y, z))
                fine.cell_depths.append(fine.depth)
                fine.leaves.append(bool(made.leaves >> octant & 1))
                fine.parents.append(vertex)

    def _decode_cell(self, vertex: int, cell: Cell) -> None:
        if self._needed > self._vertices:
            raise MapConnError("more cells than vertices")
        survey = self._vicinity.survey(vertex)
        facts = CellFacts(survey, min(self._recent >> 4, 15), self._recent_leaves >> 4)
        image = self._vicinity.image(vertex) if self._mirrored else None
        if self._mirrored:
            facts.mirror = 1 if image is None else 2 + min(self._trust, 2)
            facts.trusted = 0 if image is None else 1 if self._trust < 2 else 2
        made = Made()
        ranks = self._decode_octants(survey, facts, image, made)
        if self._last:
            made.leaves = made.octants
        elif made.octants.bit_count() > 1:
            self._decode_leaves(survey, facts, image, made, ranks)
        self._learn(cell, survey, facts, made, ranks)
        if image is not None:
            right = image.octants == made.octants and (self._last or image.leaves == made.leaves)
            self._trust = min(self._trust + 1, 4) if right else self._trust >> 1

    # ---- decisions

    def _decode_octants(self, survey: Survey, facts: CellFacts, image: Made | None, made: Made) -> int:
        """The occupied octants, put into `made`; and the same by rank."""
        fewest = 2 if self._last else 1
        ranks = count = 0
        path = 1
        for rank in range(8):
            octant = survey.octant(rank)
            occupied = 1
            if count + 8 - rank > fewest:
                answer = 0 if image is None else 1 + (image.octants >> octant & 1)
                question = self._octant_question(survey, facts, rank, path, answer)
                occupied = self._decide(question, 0)
            path = 2 * path + occupied
            count += occupied
            ranks |= occupied << rank
            made.octants |= occupied << octant
        return ranks

    def _decode_leaves(self, survey: Survey, facts: CellFacts, image: Made | None, made: Made, ranks: int) -> None:
        """Which children are leaves, put into `made`."""
        inner = leaves = 0
        for rank in range(8):
            octant = survey.octant(rank)
            if ranks >> rank & 1:
                answer = 0 if image is None else 1 + (image.leaves >> octant & 1)
                question = self._child_question(
                    survey, facts, rank, made.octants, ranks, inner=inner, leaves=leaves, answer=answer
                )
                leaf = self._decide(question, 1)
                made.leaves |= leaf << octant
                leaves += leaf
                inner += 1 - leaf

    def _decide(self, question: MapQuestion, part: int) -> int:
        """One decision: about an octant (0), or a child (1)."""
        contexts, neurons = (HIGH_CONTEXTS, HIGH_NEURONS) if self._high else (DEFAULT_CONTEXTS, DEFAULT_NEURONS)
        place_of = part * sum(contexts[0])
        neuron_of = part * sum(neurons[0])
        places, asked = [], []
        for value, size in zip(question.contexts, contexts[part], strict=True):
            places.append(place_of + value)
            place_of += size
        for value, size in zip(question.neurons, neurons[part], strict=True):
            asked.append(neuron_of + value)
            neuron_of += size
        opposed = [False] * len(places)
        return self._mixer.bit(self._decoder, places, opposed, question.numbers, asked, question.final_neuron)

    def _octant_question(self, s: Survey, c: CellFacts, rank: int, path: int, answer: int) -> MapQuestion:
        """Is the octant occupied?"""
        octant = s.octant(rank)
        count = path.bit_count() - 1
        count3, count4 = min(count, 3), min(count, 4)
        votes = min(s.votes[octant], 7)
        vote = min(votes, 3)
        beside = _beside(path, rank)
        faces, edges, corner = c.touches(octant)
        inhabited = min(s.touching_children[octant], 7)
        bare = min(s.touching_cells[octant], 7) - inhabited
        height = c.heights[rank]
        coarse_height = (height + 3 * HEIGHT_ONE) >> 6 if s.oriented else 12
        fine_height = min((height + 3 * HEIGHT_ONE) >> 5, 31) if s.oriented else 32
        common = {
            "faces": faces * 27 + beside,
            "mirror": ((answer * 5 + c.mirror) * 8 + rank) * 5 + count4,
            "corner": (corner * 64 + edges) * 27 + beside,
            "around": (faces * 64 + edges) * 5 + count4,
            "height": (fine_height * 27 + beside) * 4 + vote,
        }
        neurons = [(rank * 4 + count3) * 3 + c.trusted, (c.normal_class * 4 + vote) * 4 + count3, c.trusted * 4 + vote]
        if self._high:
            contexts = [
                (path * 7 + c.normal_class) * 4 + vote,
                common["faces"],
                (path * 7 + c.density) * 6 + c.ratio,
                common["mirror"],
                edges * 256 + path,
                (faces * 17 + coarse_height) * 4 + count3,
                common["around"],
                common["height"],
                (path * 4 + corner) * 4 + vote,
                (faces * 64 + edges) * 27 + beside,
                common["corner"],
                c.recent * 256 + path,
            ]
            neurons += [faces, beside, c.distance_class(height) // 2 * 12 + c.fit]
        else:
            contexts = [
                path,
                common["faces"],
                ((rank * 5 + count4) * 7 + c.density) * 6 + c.ratio,
                common["mirror"],
                common["corner"],
                ((answer * 17 + coarse_height) * 5 + count4) * 5 + c.mirror,
                common["around"],
                common["height"],
            ]
        level = height if s.oriented else 0
        numbers = [256, abs(level), level, inhabited * 256, bare * 256, votes * 256, c.spacing * 128, c.degree * 128]
        return MapQuestion(contexts, neurons, rank, numbers)

    def _child_question(
        self, s: Survey, c: CellFacts, rank: int, octants: int, ranks: int, *, inner: int, leaves: int, answer: int
    ) -> MapQuestion:
        """Is the child a leaf?"""
        octant = s.octant(rank)
        count = octants.bit_count()
        inner3, leaves3 = min(inner, 3), min(leaves, 3)
        place = (min(count, 5) - 2) * 4 + inner3
        votes, leaf_votes = min(s.votes[octant], 7), min(s.leaf_votes[octant], 7)
        vote = min(votes, 3)
        across_faces = sum(octants >> (octant ^ bit) & 1 for bit in (4, 2, 1))
        across_edges = sum(octants >> (octant ^ bit) & 1 for bit in (6, 5, 3))
        beside = 2 * across_faces + (across_edges > 1)
        faces, _, _ = c.touches(octant)
        near_leaves = min(s.touching_leaves[octant], 7)
        near_inner = min(s.touching_children[octant] - s.touching_leaves[octant], 7)
        touching4 = min(near_leaves, 3) * 4 + min(near_inner, 3)
        touching5 = min(near_leaves, 4) * 5 + min(near_inner, 4)
        ratios = c.ratio * 6 + c.coded_ratio
        contexts = [
            (touching4 * 17 + c.recent_leaves) * 4 + inner3,
            faces * 16 + place,
            (votes * 8 + leaf_votes) * 16 + place,
            (answer * 5 + c.mirror) * 16 + place,
            (ranks * 4 + leaves3) * 4 + inner3 if self._high else c.degree * 16 + place,
            (touching5 * 36 + ratios) * 4 + leaves3,
            ((count * 9 + inner) * 9 + leaves) * 6 + c.coded_ratio,
            c.distance_class(c.heights[rank]) * 16 + place if self._high else (vote * 4 + inner3) * 6 + c.ratio,
        ]
        neurons = [beside * 4 + vote, c.ratio * 4 + c.trusted]
        if self._high:
            contexts += [
                ((votes * 8 + leaf_votes) * 4 + leaves3) * 36 + ratios,
                ((touching5 * 16 + beside) * 4 + vote) * 16 + place,
                ratios * 64 + place * 4 + leaves3,
                (c.degree * 16 + c.spacing) * 16 + place,
            ]
            neurons += [c.degree * 4 + leaves3, ratios, c.age * 16 + c.spacing, c.degree * 16 + c.spacing]
        else:
            neurons.append(votes * 8 + leaf_votes)
        numbers = [
            256,
            c.ratio * 100,
            200 if c.coded_ratio == 5 else c.coded_ratio * 100,
            c.spacing * 128,
            c.degree * 128,
            near_leaves * 256,
            near_inner * 256,
            leaf_votes * 256,
        ]
        return MapQuestion(contexts, neurons, 8 + place, numbers)

    def _learn(self, cell: Cell, survey: Survey, facts: CellFacts, made: Made, ranks: int) -> None:
        """The cell as those after it will see it."""
        count, leaves = made.octants.bit_count(), made.leaves.bit_count()
        self._needed += 2 * count - leaves - 2
        self._recent += 8 * count - self._recent // 8
        self._recent_leaves += 32 * leaves // count - self._recent_leaves // 8
        upper = [made.halved(axis, upper=True).octants.bit_count() for axis in range(3)]
        mean = vector(*(2 * half - count for half in upper)) * (Single(0.5) / Single(count))
        missed = sum(abs(height) for rank, height in enumerate(facts.heights) if ranks >> rank & 1)
        cell.place = cell.centre + mean * self._vicinity.step
        cell.place[3] = Single(missed) / Single(count * HEIGHT_ONE)
        cell.bulge = (mean - survey.mean) * self._vicinity.step
        cell.bulge[3] = 0
        cell.made = made


@dataclass
class MapQuestion:
    """Of a decision: places within each block of contexts, neurons within each block, final neuron, numbers."""

    contexts: list[int]
    neurons: list[int]
    final_neuron: int
    numbers: list[int]


def _beside(path: int, rank: int) -> int:
    """Of the octants before: those that differ in bit 4, 2, 1 of the rank: 0 empty, 1 occupied, 2 not known yet."""
    code = 0
    for bit in BITS:
        other = rank ^ bit
        code = 3 * code + (path >> (rank - 1 - other) & 1 if other < rank else 2)
    return code
