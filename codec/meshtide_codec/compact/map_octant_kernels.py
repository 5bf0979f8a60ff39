"""Which octants of a cell are occupied: eight binary decisions in the canonical order of the cell's frame.

Each decision is mixed from six contexts: the octants answered so far, with the normal's class; the states of the
children across the octant's faces; count and density; the mirror image; the octant's height above the local plane
with its siblings, and with its outer neighbours. At least `minimum` octants are occupied: what follows from that is
not coded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compact import map_layout as layout
from meshtide_codec.compact import map_survey_kernels as surveys
from meshtide_codec.compact.map_deep_kernels import code_octant_deeply
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel
from meshtide_codec.entropy.mixing_kernels import code_mixed_bit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compact.map_deep_kernels import DeepMap
    from meshtide_codec.compact.map_survey_kernels import Scratch
    from meshtide_codec.entropy.mixing_kernels import Opinions, Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


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


@borrowing_kernel
def code_children(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    deep: DeepMap | None,
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
    """Code which octants of `vertex` are occupied, at least `minimum` of them; returns them as bits.

    `deep` is None at effort default.
    """
    given = int(occupied[vertex])
    coded_neighbours, coded_children = survey[surveys.CODED_NEIGHBOURS], survey[surveys.CODED_CHILDREN]
    density = 6
    if coded_neighbours > 0:
        density = min((4 * coded_children - 3 * coded_neighbours) // (2 * coded_neighbours), 5)
    leaf_ratio = surveys.leaf_ratio_class(survey)
    normal_class = survey[surveys.NORMAL_CLASS]
    trust = 0 if mirrored < 0 else (1 if mirror_state < 4 else 2)
    pattern = 0
    count = 0
    answers = 1
    for rank in range(8):
        octant = surveys.canonical_octant(rank, survey)
        if count + 8 - rank <= minimum:
            bit = 1
        else:
            vote = min(votes[octant], 3)
            outer = side_states(octant, vertex, sides, occupied)
            inner = sibling_states(rank, answers)
            places[0] = layout.PARTIAL + (answers * surveys.NORMAL_CLASSES + normal_class) * 4 + vote
            places[1] = layout.SIDES + outer * 27 + inner
            places[2] = layout.DENSITY + ((rank * 5 + min(count, 4)) * 7 + density) * 6 + leaf_ratio
            answer = 0 if mirrored < 0 else 1 + ((mirrored >> octant) & 1)
            places[3] = layout.MIRROR + ((answer * layout.MIRROR_STATES + mirror_state) * 8 + rank) * 5 + min(count, 4)
            height = heights[octant]
            places[4] = layout.HEIGHT + (height * 27 + inner) * surveys.NORMAL_CLASSES + normal_class
            places[5] = layout.SHELL + (outer * 17 + height) * 4 + min(count, 3)
            neuron = (rank * 4 + min(count, 3)) * 3 + trust
            asked = (given >> octant) & 1
            if deep is not None:
                bit = code_octant_deeply(
                    coder,
                    buffer,
                    deep,
                    neuron,
                    octant,
                    rank,
                    count,
                    answers,
                    inner,
                    vote,
                    height,
                    density,
                    leaf_ratio,
                    normal_class,
                    answer,
                    mirror_state,
                    places,
                    signs,
                    asked,
                )
            else:
                bit = code_mixed_bit(
                    coder, buffer, contexts, weights, neuron, places, signs, layout.RATE, layout.LIMIT, asked
                )
        answers = answers * 2 + bit
        count += bit
        pattern |= bit << octant
    return pattern
