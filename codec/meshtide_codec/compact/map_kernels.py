"""The Map coder: which children of each cell are occupied, and which of those are leaves.

Cells come in Morton order, leaves are passed over. A cell's eight octants are asked in an order made canonical by
the local normal (`map_survey_kernels`), so that the same local shapes share statistics whatever way they are turned;
then each child, where there are several, is asked whether it is a leaf. O(degree) per cell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import map_survey_kernels as surveys
from meshtide_codec.compact.map_deep_layout import HEARD_CONTEXTS
from meshtide_codec.compact.map_layout import MIRROR_TRUST_LIMIT
from meshtide_codec.compact.map_leaf_kernels import code_leaf_flags
from meshtide_codec.compact.map_octant_kernels import code_children, mirrored_children
from meshtide_codec.compact.map_surface_kernels import fit_cell, note_children
from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import borrowing_kernel, kernel
from meshtide_codec.entropy.mixing_kernels import INPUTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.map_deep_kernels import DeepMap
    from meshtide_codec.compact.map_survey_kernels import Scratch
    from meshtide_codec.compact.ring_kernels import Rings
    from meshtide_codec.entropy.mixing_kernels import Opinions, Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

TOO_MANY_VERTICES = -1  # the Map claims more vertices than the mesh has


@kernel
def code_map(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    deep: DeepMap | None,
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
    decoding. `mirror_axis` is -1 without symmetry, and `mirrored_cells` is not looked at then. At the last depth
    all children are leaves, which is not coded. `deep` is None at effort default; contexts and weights are not used
    otherwise. A decoder stops with TOO_MANY_VERTICES as soon as the children of the cells so far need more than
    `vertex_limit` finest vertices.
    """
    vertices = len(leaves)
    survey = np.zeros(surveys.SURVEY_SIZE, np.int64)
    votes = np.zeros(surveys.VOTES, np.int64)
    heights = np.zeros(surveys.VOTES, np.int64)
    sides = np.zeros(surveys.FACE_NEIGHBOURS, np.int64)
    offsets = np.zeros(3 * RING_LIMIT, np.int64)
    heard = INPUTS if deep is None else HEARD_CONTEXTS
    places = np.zeros(heard, np.int64)
    signs = np.ones(heard, np.int64)
    child_counts = np.zeros(vertices, np.uint8)
    leaf_counts = np.zeros(vertices, np.uint8)
    return _code_cells(
        coder,
        buffer,
        contexts,
        weights,
        deep,
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
    deep: DeepMap | None,
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
        if deep is not None:
            fit_cell(vertex, survey[surveys.NEIGHBOURS], survey[surveys.CLOSED] != 0, rings, deep[4])
        pattern = code_children(
            coder,
            buffer,
            contexts,
            weights,
            deep,
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
                deep,
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
        if deep is not None:
            note_children(vertex, pattern, deep[4])
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
