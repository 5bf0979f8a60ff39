"""Diffs: one more bit per coordinate for the leaves of a slice, depth by depth (docs/format.md, section 8.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.deep_mixing import DeepNeurons
from meshtide_codec.reference.diff_contexts import contexts_for, neuron_for
from meshtide_codec.reference.diff_deep_contexts import INPUTS
from meshtide_codec.reference.diff_deep_decoding import DeepBitPlane
from meshtide_codec.reference.diff_prediction import Prediction
from meshtide_codec.reference.diff_rows import NEW_ERROR, Neighbourhood, Row, rows_of, set_laplacians
from meshtide_codec.reference.mirror import REACH, CellTable, nearest_image
from meshtide_codec.reference.octree import NOBODY, RING_LIMIT
from meshtide_codec.reference.trained_states import deep_neurons, geometry_neurons

if TYPE_CHECKING:
    from meshtide_codec.reference.mirror import Mirror
    from meshtide_codec.reference.mixing import Neurons
    from meshtide_codec.reference.octree import Cell, Level
    from meshtide_codec.reference.range_decoder import RangeDecoder

RATE = 17
LIMIT = 100
UNDECIDED, DIFFERS, AGREES = 0, 1, 2
PARTNER_SLACK = 1.01


class SliceDecoder:
    """The Diffs of one slice.

    Args:
        root: the level of depth 0.
        slices: the first Morton code of each slice.
        index: which of them.
        bits: depth of the finest level.
        mirror: the plane of symmetry, if there is one.
        deep: whether they are coded deeply.

    Attributes:
        depth: up to which the leaves are known.
        cells: in Morton order, the cell of depth `depth` that each leaf's vertex lies in.
        leaf_depths: the depth at which each became a leaf.
    """

    def __init__(
        self, root: Level, slices: list[int], index: int, bits: int, mirror: Mirror | None, *, deep: bool = False
    ) -> None:
        self._slices = slices
        self._index = index
        self._bits = bits
        self._mirror = mirror
        self._neurons = deep_neurons("diff", INPUTS, RATE) if deep else geometry_neurons("diff")
        leaves = [vertex for vertex in self.vertices(root) if root.leaves[vertex]]
        self.depth = 0
        self.cells: list[Cell] = [(0, 0, 0)] * len(leaves)
        self.leaf_depths = [0] * len(leaves)
        self._errors = [NEW_ERROR] * len(leaves)
        self._partners = [NOBODY] * len(leaves)
        self._outcomes = [UNDECIDED] * len(leaves)

    def vertices(self, level: Level) -> range:
        """The vertices of a level that belong to the slice."""
        shift = 3 * (self._bits - level.depth)
        codes = [level.code(vertex) << shift for vertex in range(len(level))]
        begin = sum(code < self._slices[self._index] for code in codes)
        if self._index + 1 == len(self._slices):
            return range(begin, len(level))
        return range(begin, sum(code < self._slices[self._index + 1] for code in codes))

    def decode(self, decoder: RangeDecoder, level: Level) -> None:
        """Take the bit plane of `level`, whose depth must be the next one."""
        vertices = self.vertices(level)
        leaves = [vertex for vertex in vertices if level.leaves[vertex]]
        owners = [vertex for vertex in leaves if level.cell_depths[vertex] < level.depth]
        rows = rows_of(level, owners, self.cells, self._errors)
        known_cells = dict(zip(owners, self.cells, strict=True))
        images = Images(self._mirror, level, rows)
        images.carry_over(owners, self._partners, self._outcomes)
        images.find_partners(leaves, known_cells)
        plane: BitPlane | DeepBitPlane
        if isinstance(self._neurons, DeepNeurons):
            plane = DeepBitPlane(decoder, level, rows, images, self._neurons)
        else:
            plane = BitPlane(decoder, level, rows, images, self._neurons)
        set_laplacians(level, rows, vertices)
        for vertex in owners:
            moves = plane.decode(vertex)
            x, y, z = (2 * known + (move > 0.0) for known, move in zip(known_cells[vertex], moves, strict=True))
            known_cells[vertex] = (x, y, z)
        places = {leaf: place for place, leaf in enumerate(leaves)}
        self.depth = level.depth
        self.cells = [known_cells.get(leaf, level.cells[leaf]) for leaf in leaves]
        self.leaf_depths = [level.cell_depths[leaf] for leaf in leaves]
        self._errors = [rows[leaf].error for leaf in leaves]
        self._partners = [places.get(images.partners[leaf], NOBODY) for leaf in leaves]
        self._outcomes = [images.outcomes[leaf] for leaf in leaves]


class Images:
    """Which leaf each leaf is the mirror image of, and how the two compared."""

    def __init__(self, mirror: Mirror | None, level: Level, rows: list[Row]) -> None:
        self._mirror = mirror
        self._level = level
        self._rows = rows
        self._plane = mirror.plane(level.depth) if mirror else 0.0
        self.axis = mirror.axis if mirror else -1
        self.partners = [NOBODY] * len(level)
        self.outcomes = [UNDECIDED] * len(level)

    def carry_over(self, owners: list[int], partners: list[int], outcomes: list[int]) -> None:
        """What the depth before has found; partners that turned out to differ are given up."""
        for owner, partner, outcome in zip(owners, partners, outcomes, strict=True):
            self.outcomes[owner] = outcome
            if partner != NOBODY and outcome != DIFFERS:
                self.partners[owner] = owners[partner]

    def find_partners(self, leaves: list[int], known_cells: dict[int, Cell]) -> None:
        """Look for partners of the leaves that move and have none: the leaf nearest to the image."""
        if self._mirror is None:
            return
        table = CellTable((known_cells.get(leaf) or self._half_cell(leaf), leaf) for leaf in leaves)
        for owner, cell in known_cells.items():
            if self.partners[owner] != NOBODY:
                continue
            image, cells = nearest_image(cell, self._rows[owner].position, self.axis, self._plane, self._level.depth)
            nearest = REACH
            for place in cells:
                found = table.find(place)
                if found is None or found == owner:
                    continue
                distance = abs(self._rows[found].position[self.axis] - image)
                if distance < nearest:
                    nearest = distance
                    self.partners[owner] = found

    def look(self, vertex: int, predicted: Prediction) -> None:
        """Set where the mirror image of a vertex' partner lies, and what is known of it."""
        partner = self.partners[vertex]
        if partner == NOBODY:
            return
        members = self._level.rings[vertex].members[:RING_LIMIT]
        agreeing = sum(self.outcomes[member] == AGREES for member in members)
        differing = sum(self.outcomes[member] == DIFFERS for member in members)
        verdict = 3
        if agreeing + differing:
            verdict = 0 if differing > agreeing else (1 if differing else 2)
        for axis in range(3):
            image = self._rows[partner].position[axis]
            if axis == self.axis:
                image = self._plane - image
            predicted.mirrored[axis] = image - self._rows[vertex].position[axis]
        predicted.mirror_state = 1 + verdict + (4 if self._rows[partner].known else 0)

    def compare(self, vertex: int, predicted: Prediction, moves: list[float]) -> None:
        """Note whether the vertex has moved to where its partner's image, if known, has put it."""
        if predicted.mirror_state > 4:  # the partner is known
            apart = max(abs(image - move) for image, move in zip(predicted.mirrored, moves, strict=True))
            outcome = DIFFERS if apart > PARTNER_SLACK else AGREES
            self.outcomes[vertex] = outcome
            if self.outcomes[self.partners[vertex]] == UNDECIDED:
                self.outcomes[self.partners[vertex]] = outcome

    def _half_cell(self, leaf: int) -> Cell:
        x, y, z = self._level.cells[leaf]
        return x >> 1, y >> 1, z >> 1


class BitPlane:
    """Three decisions for a vertex."""

    def __init__(self, decoder: RangeDecoder, level: Level, rows: list[Row], images: Images, neurons: Neurons) -> None:
        self._decoder = decoder
        self._level = level
        self._rows = rows
        self._images = images
        self._neurons = neurons

    def decode(self, vertex: int) -> list[float]:
        """By how many half cells the vertex moves along each axis: -1 or +1."""
        row = self._rows[vertex]
        predicted = Prediction(Neighbourhood(self._level, vertex, self._rows), self._rows)
        self._images.look(vertex, predicted)
        neuron = neuron_for(predicted)
        moves = [0.0, 0.0, 0.0]
        carried = error = 0.0
        for axis in predicted.axes:
            normal = predicted.normal[axis]
            plane = predicted.plane[axis] - carried * normal / (normal * normal + 0.15)
            inputs = contexts_for(predicted, axis, plane, self._images.axis)
            places, signs = [place for place, _ in inputs], [sign for _, sign in inputs]
            bit = self._neurons.bit(self._decoder, neuron, places, RATE, LIMIT, signs)
            moves[axis] = 2.0 * bit - 1.0
            error += abs(moves[axis] - predicted.smoothed[axis])
            carried += (moves[axis] - predicted.plane[axis]) * normal
        for axis in range(3):
            row.position[axis] += moves[axis]
        row.known = 1.0
        row.error = error / 3.0
        self._images.compare(vertex, predicted, moves)
        return moves
