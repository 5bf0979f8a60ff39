"""Which vertices may complete a triangle at a gate: the candidates for its apex.

A face (first, second, apex) collapses to a coarse face, to a coarse edge or to a point. So the apex is a child of a
coarse apex at the coarse edge below the gate, or a sibling of one of the gate's ends; where both ends share a parent,
it is a sibling or a child of one of the parent's neighbours. Lists are cut at CAPACITY, and families of siblings are
seen through a window, so the cost of a gate is bounded whatever the mesh; faces that this misses are coded explicitly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import inlined_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.coarse_kernels import APEX_SCAN_LIMIT
from meshtide_codec.connectivity.edge_index_kernels import first_entry

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.coarse_kernels import CoarseMesh
    from meshtide_codec.connectivity.half_edge_kernels import FineMesh

CAPACITY = 256  # candidates of one decision
WINDOW = 48  # siblings before and after an end of the gate that are considered
NEIGHBOUR_LIMIT = 128  # coarse half-edges around a parent that are followed

# Kinds of candidates
NEW_FACE_APEX = 0  # child of a coarse apex whose face is not accounted for yet
OLD_FACE_APEX = 1  # child of a coarse apex whose face is accounted for
SIBLING = 2  # shares its parent with one end of the gate
COMMON_SIBLING = 3  # shares its parent with both ends
NEIGHBOUR = 4  # child of a neighbour of the common parent
KNOWN_APEX = 5  # apex of the face behind the gate: would be that face turned over
KINDS = 6

# Corners: what happens at the apex, edges closed * 3 + state of the vertex
CLOSINGS = 4  # no edge closed, one, two, or blocked
STATES = 3  # a vertex without faces, with open edges, complete
CORNERS = CLOSINGS * STATES

# Which candidates are wanted
UNBLOCKED = 0  # those that leave every edge with at most two faces
BLOCKED_ONLY = 1  # the others
EVERYTHING = 2


class Candidates(NamedTuple):
    """A list of vertices to choose from, one row a candidate.

    Attributes:
        vertex: (CAPACITY,) int32.
        kind: (CAPACITY,) int32, see above.
        flags: (CAPACITY,) int32, which edges the face would close, or that it is blocked.
        corner: (CAPACITY,) int32, in [0, CORNERS).
        coarse_face: (CAPACITY,) int32, coarse face below, or -1.
        weight: (CAPACITY,) int64, score, then exp(score - best score), then negative once refused.
        right: (CAPACITY,) int32, encoder: entry of the face in the index of true faces, or -1.
        seen: (coarse vertices,) int32, the last listing that the children of a coarse vertex were in.
    """

    vertex: NDArray[np.int32]
    kind: NDArray[np.int32]
    flags: NDArray[np.int32]
    corner: NDArray[np.int32]
    coarse_face: NDArray[np.int32]
    weight: NDArray[np.int64]
    right: NDArray[np.int32]
    seen: NDArray[np.int32]


def new_candidates(coarse_count: int) -> Candidates:
    """Room for one list."""
    return Candidates(
        np.empty(CAPACITY, np.int32),
        np.empty(CAPACITY, np.int32),
        np.empty(CAPACITY, np.int32),
        np.empty(CAPACITY, np.int32),
        np.empty(CAPACITY, np.int32),
        np.empty(CAPACITY, np.int64),
        np.empty(CAPACITY, np.int32),
        np.zeros(coarse_count, np.int32),
    )


@inlined_kernel
def _add_family(
    candidates: Candidates,
    vertices: NDArray[np.int32],
    count: int,
    lowest: int,
    highest: int,
    ends_and_apex: tuple[int, int, int],
    kind: int,
    coarse_face: int,
    number: int,
    wanted: int,
) -> int:
    """Append the vertices of [lowest, highest) that can be the apex; returns the new length."""
    for vertex in range(lowest, min(highest, lowest + CAPACITY - count)):
        if vertex == ends_and_apex[0] or vertex == ends_and_apex[1]:
            continue
        flags = int(vertices[vertex, half_edges.FLAGS]) if vertices[vertex, half_edges.MARK] == number else 0
        state = 0
        if vertices[vertex, half_edges.FACES] > 0:
            state = 1 if vertices[vertex, half_edges.OPEN_EDGES] > 0 else 2
        known = vertex == ends_and_apex[2]
        if (flags & half_edges.BLOCKED) or state == 2 or known:
            if wanted == UNBLOCKED:
                continue
            flags = half_edges.BLOCKED
            corner = 3 * STATES + state
        elif wanted == BLOCKED_ONLY:
            continue
        else:
            corner = ((flags & 1) + (flags >> 1)) * STATES + state
        candidates.vertex[count] = vertex
        candidates.kind[count] = KNOWN_APEX if known else kind
        candidates.flags[count] = flags
        candidates.corner[count] = corner
        candidates.coarse_face[count] = coarse_face
        count += 1
    return count


@merged_kernel
def gather_apexes(
    candidates: Candidates,
    coarse: CoarseMesh,
    fine: FineMesh,
    first: int,
    second: int,
    known_apex: int,
    number: int,
    wanted: int,
) -> tuple[int, int, int]:
    """List the candidates for the apex of a face at the gate first -> second.

    The surroundings must have been marked with `number`. Complete vertices and the known apex count as blocked.
    Returns the number of candidates, of coarse faces at the edge below, and of those not accounted for.
    """
    parents = fine.parents
    children = coarse.children
    edges = coarse.edges
    vertices = fine.vertices
    ends_and_apex = (first, second, known_apex)
    first_parent = int(parents[first])
    second_parent = int(parents[second])
    count = 0
    below = 0
    uncovered = 0
    if first_parent != second_parent:
        place = first_entry(edges, first_parent, second_parent, 0)
        stop = min(int(edges.start[first_parent + 1]), place + APEX_SCAN_LIMIT)
        while place < stop and edges.target[place] == second_parent:
            apex = edges.apex[place]
            face = edges.face[place]
            kind = OLD_FACE_APEX if coarse.covered[face] else NEW_FACE_APEX
            below += 1
            uncovered += 1 - kind
            count = _add_family(
                candidates, vertices, count, children[apex], children[apex + 1],
                ends_and_apex, kind, face, number, wanted,
            )  # fmt: skip
            place += 1
        for end in range(2):
            parent = first_parent if end == 0 else second_parent
            vertex = ends_and_apex[end]
            lowest = max(int(children[parent]), vertex - WINDOW)
            highest = min(int(children[parent + 1]), vertex + WINDOW + 1)
            count = _add_family(
                candidates, vertices, count, lowest, highest, ends_and_apex, SIBLING, -1, number, wanted
            )
        return count, below, uncovered
    lowest = int(children[first_parent])
    highest = int(children[first_parent + 1])
    if highest - lowest <= CAPACITY:
        count = _add_family(
            candidates, vertices, count, lowest, highest, ends_and_apex, COMMON_SIBLING, -1, number, wanted
        )
    else:
        start = lowest
        for end in range(2):
            vertex = min(first, second) if end == 0 else max(first, second)
            stop = min(highest, vertex + WINDOW + 1)
            start = max(start, vertex - WINDOW)
            count = _add_family(
                candidates, vertices, count, start, stop, ends_and_apex, COMMON_SIBLING, -1, number, wanted
            )
            start = stop
    listing = 2 * number + (wanted & 1)
    candidates.seen[first_parent] = listing
    stop = min(int(edges.start[first_parent + 1]), int(edges.start[first_parent]) + NEIGHBOUR_LIMIT)
    for place in range(edges.start[first_parent], stop):
        for side in range(2):
            neighbour = edges.target[place] if side == 0 else edges.apex[place]
            if candidates.seen[neighbour] != listing:
                candidates.seen[neighbour] = listing
                count = _add_family(
                    candidates, vertices, count, children[neighbour], children[neighbour + 1],
                    ends_and_apex, NEIGHBOUR, -1, number, wanted,
                )  # fmt: skip
    return count, below, uncovered
