"""The Map coder: which children of each cell are occupied, and which of those are leaves.

Cells come in Morton order, leaves are passed over. A cell's eight octants are asked in an order made canonical by
the local normal (`map_survey_kernels`), so that the same local shapes share statistics whatever way they are turned.
Each answer is one binary decision, mixed from three contexts, and a fourth one when the mesh is mirror symmetric:
partial occupancy and normal; the states of face neighbours and siblings; count and density. O(degree) per cell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import map_survey_kernels as surveys
from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import inlined_kernel, kernel
from meshtide_codec.connectivity.borrowing import borrowing_kernel
from meshtide_codec.entropy.mixing_kernels import INPUTS, code_mixed_bit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.map_survey_kernels import Scratch
    from meshtide_codec.compact.ring_kernels import Rings
    from meshtide_codec.entropy.mixing_kernels import Opinions, Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

RATE = 16
LIMIT = 60

MIRROR_STATES = 5  # no symmetry, no mirrored cell known, mirror seldom, sometimes, mostly right
MIRROR_ANSWERS = 3  # nothing known, mirrored octant empty, occupied
MIRROR_TRUST_LIMIT = 4

# Contexts of the occupancy decisions, then those of the leaf flags, one after the other in one array.
PARTIAL = 0
PARTIAL_SIZE = 256 * surveys.NORMAL_CLASSES * 4
SIDES = PARTIAL + PARTIAL_SIZE
SIDES_SIZE = 64 * 27
DENSITY = SIDES + SIDES_SIZE
DENSITY_SIZE = 8 * 5 * 7 * 6
MIRROR = DENSITY + DENSITY_SIZE
MIRROR_SIZE = MIRROR_ANSWERS * MIRROR_STATES * 8 * 5
HEIGHT = MIRROR + MIRROR_SIZE
HEIGHT_SIZE = 17 * 27 * surveys.NORMAL_CLASSES
SHELL = HEIGHT + HEIGHT_SIZE
SHELL_SIZE = 64 * 17 * 4
LEAF_RATIO = SHELL + SHELL_SIZE
LEAF_RATIO_SIZE = 4 * 4 * 4 * 6 * 6
LEAF_SPACING = LEAF_RATIO + LEAF_RATIO_SIZE
LEAF_SPACING_SIZE = 16 * 16 * 4 * 4
LEAF_VOTES = LEAF_SPACING + LEAF_SPACING_SIZE
LEAF_VOTES_SIZE = 4 * 4 * 6
LEAF_MIRROR = LEAF_VOTES + LEAF_VOTES_SIZE
LEAF_MIRROR_SIZE = MIRROR_ANSWERS * MIRROR_STATES * 16
LEAF_AGE = LEAF_MIRROR + LEAF_MIRROR_SIZE
LEAF_AGE_SIZE = 7 * 16 * 4 * 4
LEAF_CODED = LEAF_AGE + LEAF_AGE_SIZE
LEAF_CODED_SIZE = 6 * 16 * 4 * 4
CONTEXTS = LEAF_CODED + LEAF_CODED_SIZE

OCCUPANCY_NEURONS = 8 * 4 * 3
LEAF_NEURONS = 4 * 4 * 3
NEURONS = OCCUPANCY_NEURONS + LEAF_NEURONS

TOO_MANY_VERTICES = -1  # the Map claims more vertices than the mesh has


@borrowing_kernel
def mirrored_children(
    vertex: int, mirrored_cells: NDArray[np.int32], axis: int, occupied: NDArray[np.uint8], leaf: NDArray[np.uint8]
) -> int:
    """Children of the mirrored cells in this cell's octants: occupancy in bits 0..7, leaves in 8..15; -1: unknown.

    mirrored_cells[vertex, side] is 2 * cell + half for the lower and the upper half of the cell along `axis`, or -1.
    """
    axis_bit = 4 >> axis
    pattern = 0
    found = False
    for side in range(2):
        source = int(mirrored_cells[vertex, side])
        if source < 0:
            continue
        cell = source >> 1
        if cell >= vertex:
            return -1
        found = True
        from_half = axis_bit if source & 1 else 0
        to_half = axis_bit if side else 0
        for octant in range(8):
            if octant & axis_bit:
                continue
            pattern |= ((int(occupied[cell]) >> (octant | from_half)) & 1) << (octant | to_half)
            pattern |= ((int(leaf[cell]) >> (octant | from_half)) & 1) << (8 + (octant | to_half))
    return pattern if found else -1


@inlined_kernel
def canonical_octant(rank: int, survey: Scratch) -> int:
    """The octant at place `rank` of the canonical order."""
    octant = 0
    if rank & 4:
        octant |= 4 >> survey[surveys.AXES]
    if rank & 2:
        octant |= 4 >> survey[surveys.AXES + 1]
    if rank & 1:
        octant |= 4 >> survey[surveys.AXES + 2]
    return octant ^ int(survey[surveys.FLIP])


@inlined_kernel
def side_states(octant: int, vertex: int, sides: Scratch, occupied: NDArray[np.uint8]) -> int:
    """Base 4, per axis, the child across the octant's outer face: no cell, empty, occupied, not known yet."""
    states = 0
    for axis in range(3):
        neighbour = sides[2 * axis + ((octant >> (2 - axis)) & 1)]
        state = 0
        if neighbour >= 0:
            state = 3
            if neighbour < vertex:
                state = 2 if (occupied[neighbour] >> (octant ^ (4 >> axis))) & 1 else 1
        states = states * 4 + state
    return states


@inlined_kernel
def sibling_states(rank: int, answers: int) -> int:
    """Base 3, per axis, the sibling across the octant's inner face: empty, occupied, not asked yet."""
    states = 0
    for place in range(3):
        other = rank ^ (4 >> place)
        state = 2
        if other < rank:
            state = (answers >> (rank - 1 - other)) & 1
        states = states * 3 + state
    return states


@inlined_kernel
def quarter_logarithm(total: int, count: int) -> int:
    """floor(4 log2(total / count)), 0 to 15."""
    if count == 0:
        return 0
    value = total / count
    value *= value
    value *= value
    logarithm = 0
    while value >= 2.0 and logarithm < 15:
        value *= 0.5
        logarithm += 1
    return logarithm


@borrowing_kernel
def code_children(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    vertex: int,
    minimum: int,
    survey: Scratch,
    votes: Scratch,
    heights: Scratch,
    sides: Scratch,
    occupied: NDArray[np.uint8],
    mirrored: int,
    mirror_state: int,
    places: Opinions,
    signs: Opinions,
) -> int:
    """Code which octants of `vertex` are occupied, at least `minimum` of them; returns them as bits."""
    given = int(occupied[vertex])
    coded_neighbours, coded_children = survey[surveys.CODED_NEIGHBOURS], survey[surveys.CODED_CHILDREN]
    density = 6
    if coded_neighbours > 0:
        density = min((4 * coded_children - 3 * coded_neighbours) // (2 * coded_neighbours), 5)
    leaf_ratio = leaf_ratio_class(survey)
    normal_class = survey[surveys.NORMAL_CLASS]
    trust = 0 if mirrored < 0 else (1 if mirror_state < 4 else 2)
    pattern = 0
    count = 0
    answers = 1
    for rank in range(8):
        octant = canonical_octant(rank, survey)
        if count + 8 - rank <= minimum:
            bit = 1
        else:
            vote = min(votes[octant], 3)
            outer = side_states(octant, vertex, sides, occupied)
            inner = sibling_states(rank, answers)
            places[0] = PARTIAL + (answers * surveys.NORMAL_CLASSES + normal_class) * 4 + vote
            places[1] = SIDES + outer * 27 + inner
            places[2] = DENSITY + ((rank * 5 + min(count, 4)) * 7 + density) * 6 + leaf_ratio
            answer = 0 if mirrored < 0 else 1 + ((mirrored >> octant) & 1)
            places[3] = MIRROR + ((answer * MIRROR_STATES + mirror_state) * 8 + rank) * 5 + min(count, 4)
            height = heights[octant]
            places[4] = HEIGHT + (height * 27 + inner) * surveys.NORMAL_CLASSES + normal_class
            places[5] = SHELL + (outer * 17 + height) * 4 + min(count, 3)
            neuron = (rank * 4 + min(count, 3)) * 3 + trust
            bit = code_mixed_bit(
                coder,
                buffer,
                contexts,
                weights,
                neuron,
                places,
                signs,
                RATE,
                LIMIT,
                (given >> octant) & 1,
            )
        answers = answers * 2 + bit
        count += bit
        pattern |= bit << octant
    return pattern


@inlined_kernel
def leaf_ratio_class(survey: Scratch) -> int:
    """Quarters of the neighbours that are leaves, 5 when there are no neighbours."""
    if survey[surveys.NEIGHBOURS] == 0:
        return 5
    return 4 * int(survey[surveys.LEAF_NEIGHBOURS]) // int(survey[surveys.NEIGHBOURS])


@borrowing_kernel
def code_leaf_flags(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    pattern: int,
    given: int,
    survey: Scratch,
    votes: Scratch,
    mirrored: int,
    mirror_state: int,
    places: Opinions,
    signs: Opinions,
) -> int:
    """Code which of the children in `pattern` (two at least) are leaves; returns them as bits."""
    count = 0
    for octant in range(8):
        count += (pattern >> octant) & 1
    size_class = min(count, 5) - 2
    leaf_ratio = leaf_ratio_class(survey)
    coded_ratio = 5
    if survey[surveys.CODED_CHILDREN] > 0:
        coded_ratio = min(5 * survey[surveys.CODED_LEAVES] // survey[surveys.CODED_CHILDREN], 4)
    degree = min(survey[surveys.NEIGHBOURS], 15)
    age = 6
    if survey[surveys.LEAF_NEIGHBOURS] > 0:
        age = min(3 * survey[surveys.LEAF_AGE] // (2 * survey[surveys.LEAF_NEIGHBOURS]), 5)
    spacing = quarter_logarithm(survey[surveys.LENGTH], survey[surveys.NEIGHBOURS])
    trust = 0 if mirrored < 0 else (1 if mirror_state < 4 else 2)
    flags = 0
    asked = 0
    found = 0
    for rank in range(8):
        octant = canonical_octant(rank, survey)
        if (pattern >> octant) & 1 == 0:
            continue
        split_class = min(asked - found, 3)
        found_class = min(found, 3)
        vote = min(votes[octant], 3)
        places[0] = LEAF_RATIO + (((size_class * 4 + split_class) * 4 + found_class) * 6 + leaf_ratio) * 6 + coded_ratio
        places[1] = LEAF_SPACING + ((degree * 16 + spacing) * 4 + size_class) * 4 + split_class
        places[2] = LEAF_VOTES + (vote * 4 + split_class) * 6 + leaf_ratio
        answer = 0 if mirrored < 0 else 1 + ((mirrored >> (8 + octant)) & 1)
        place_class = size_class * 4 + split_class
        places[3] = LEAF_MIRROR + (answer * MIRROR_STATES + mirror_state) * 16 + place_class
        places[4] = LEAF_AGE + ((age * 16 + spacing) * 4 + size_class) * 4 + split_class
        places[5] = LEAF_CODED + ((coded_ratio * 16 + degree) * 4 + size_class) * 4 + found_class
        neuron = OCCUPANCY_NEURONS + place_class * 3 + trust
        bit = code_mixed_bit(
            coder,
            buffer,
            contexts,
            weights,
            neuron,
            places,
            signs,
            RATE,
            LIMIT,
            (given >> octant) & 1,
        )
        asked += 1
        found += bit
        flags |= bit << octant
    return flags


@kernel
def code_map(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    centres: NDArray[np.int32],
    leaves: NDArray[np.bool_],
    ages: NDArray[np.uint8],
    rings: Rings,
    mirrored_cells: NDArray[np.int32],
    mirror_axis: int,
    occupied: NDArray[np.uint8],
    leaf: NDArray[np.uint8],
    last_depth: bool,
    vertex_limit: int,
) -> int:
    """Code the children of all cells of one depth; returns their number (leaves pass on as one child each).

    `occupied` and `leaf` hold for each cell its children's octants as bits: read when encoding, filled when
    decoding. `mirror_axis` is -1 without symmetry, and `mirrored_cells` is not looked at then. At the last depth all
    children are leaves, which is not coded. A decoder stops with TOO_MANY_VERTICES as soon as the children of the
    cells so far need more than `vertex_limit` finest vertices.
    """
    vertices = len(leaves)
    survey = np.zeros(surveys.SURVEY_SIZE, np.int64)
    votes = np.zeros(surveys.VOTES, np.int64)
    heights = np.zeros(surveys.VOTES, np.int64)
    sides = np.zeros(surveys.FACE_NEIGHBOURS, np.int64)
    offsets = np.zeros(3 * RING_LIMIT, np.int64)
    places = np.zeros(INPUTS, np.int64)
    signs = np.ones(INPUTS, np.int64)
    child_counts = np.zeros(vertices, np.uint8)
    leaf_counts = np.zeros(vertices, np.uint8)
    return _code_cells(
        coder,
        buffer,
        contexts,
        weights,
        centres,
        leaves,
        ages,
        rings,
        mirrored_cells,
        mirror_axis,
        occupied,
        leaf,
        last_depth,
        vertex_limit,
        survey,
        votes,
        heights,
        sides,
        offsets,
        places,
        signs,
        child_counts,
        leaf_counts,
    )


@borrowing_kernel
def _code_cells(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    centres: NDArray[np.int32],
    leaves: NDArray[np.bool_],
    ages: NDArray[np.uint8],
    rings: Rings,
    mirrored_cells: NDArray[np.int32],
    mirror_axis: int,
    occupied: NDArray[np.uint8],
    leaf: NDArray[np.uint8],
    last_depth: bool,
    vertex_limit: int,
    survey: Scratch,
    votes: Scratch,
    heights: Scratch,
    sides: Scratch,
    offsets: Scratch,
    places: Opinions,
    signs: Opinions,
    child_counts: NDArray[np.uint8],
    leaf_counts: NDArray[np.uint8],
) -> int:
    """`code_map`, with its scratch given."""
    vertices = len(leaves)
    minimum = 2 if last_depth else 1
    trust = 0
    children = 0
    needed = 0
    for vertex in range(vertices):
        if needed >= vertex_limit:
            return TOO_MANY_VERTICES
        if leaves[vertex]:
            children += 1
            needed += 1
            continue
        surveys.survey_neighbours(
            vertex, centres, leaves, ages, rings, child_counts, leaf_counts, survey, votes, sides, offsets
        )
        surveys.orient_frame(survey, offsets, heights)
        mirrored = -1
        mirror_state = 0
        if mirror_axis >= 0:
            mirrored = mirrored_children(vertex, mirrored_cells, mirror_axis, occupied, leaf)
            mirror_state = 1 if mirrored < 0 else 2 + min(trust, 2)
        pattern = code_children(
            coder,
            buffer,
            contexts,
            weights,
            vertex,
            minimum,
            survey,
            votes,
            heights,
            sides,
            occupied,
            mirrored,
            mirror_state,
            places,
            signs,
        )
        count = 0
        for octant in range(8):
            count += (pattern >> octant) & 1
        flags = pattern if last_depth else 0
        if count > 1 and not last_depth:
            flags = code_leaf_flags(
                coder,
                buffer,
                contexts,
                weights,
                pattern,
                int(leaf[vertex]),
                survey,
                votes,
                mirrored,
                mirror_state,
                places,
                signs,
            )
        leaf_count = 0
        for octant in range(8):
            leaf_count += (flags >> octant) & 1
        occupied[vertex] = pattern
        leaf[vertex] = flags
        child_counts[vertex] = count
        leaf_counts[vertex] = leaf_count
        children += count
        needed += 2 * count - leaf_count
        if mirrored >= 0:
            trust = min(trust + 1, MIRROR_TRUST_LIMIT) if mirrored == pattern | (flags << 8) else trust >> 1
    return children if needed <= vertex_limit else TOO_MANY_VERTICES


@kernel
def expand_cells(
    cells: NDArray[np.int32],
    cell_depths: NDArray[np.uint8],
    leaves: NDArray[np.bool_],
    occupied: NDArray[np.uint8],
    leaf: NDArray[np.uint8],
    depth: int,
    child_cells: NDArray[np.int32],
    child_depths: NDArray[np.uint8],
    child_leaves: NDArray[np.bool_],
    parents: NDArray[np.int32],
) -> None:
    """Fill the arrays of depth `depth`, of exactly as many rows as `code_map` returned, from its patterns."""
    child = 0
    for vertex in range(len(cells)):
        if leaves[vertex]:
            for axis in range(3):
                child_cells[child, axis] = cells[vertex, axis]
            child_depths[child] = cell_depths[vertex]
            child_leaves[child] = True
            parents[child] = vertex
            child += 1
            continue
        for octant in range(8):
            if (occupied[vertex] >> octant) & 1:
                for axis in range(3):
                    child_cells[child, axis] = 2 * cells[vertex, axis] + ((octant >> (2 - axis)) & 1)
                child_depths[child] = depth
                child_leaves[child] = (leaf[vertex] >> octant) & 1 == 1
                parents[child] = vertex
                child += 1
