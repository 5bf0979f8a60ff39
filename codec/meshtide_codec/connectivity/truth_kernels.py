"""What the encoder knows and the decoder does not: the faces that are to be coded, and which of them are done.

The decoder passes an empty Truth to the same kernels and never looks into it. Cost: look-ups by bisection.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import borrowing_kernel, kernel, merged_kernel
from meshtide_codec.connectivity import edge_index_kernels as edge_index
from meshtide_codec.connectivity.edge_index_kernels import EdgeIndex

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates

SHORT_RUN = 4  # faces at one directed edge that are compared one by one


class Truth(NamedTuple):
    """The faces of the level being encoded.

    Attributes:
        faces: (m, 3) int32.
        edges: index of all faces.
        done: (m,) int8, 1 once the face is coded.
        waiting: (entries,) int32; at the first entry of each directed edge: the entry before which all are done.
    """

    faces: NDArray[np.int32]
    edges: EdgeIndex
    done: NDArray[np.int8]
    waiting: NDArray[np.int32]


@kernel
def build_truth(faces: NDArray[np.int32], vertex_count: int) -> Truth:
    """Index the faces of the level; indices must have been checked."""
    edges = edge_index.index_edges(faces, vertex_count, np.ones(len(faces), np.int8))
    return Truth(faces, edges, np.zeros(len(faces), np.int8), np.arange(3 * len(faces)).astype(np.int32))


def empty_truth() -> Truth:
    """What a decoder passes."""
    nothing = np.zeros(1, np.int32)
    return Truth(
        np.zeros((1, 3), np.int32), EdgeIndex(nothing, nothing, nothing, nothing), np.zeros(1, np.int8), nothing
    )


@merged_kernel
def waiting_entry(truth: Truth, origin: int, target: int) -> int:
    """An entry of a face at the directed edge origin -> target that is not coded yet, or -1."""
    edges = truth.edges
    run = edge_index.first_entry(edges, origin, target, -1)
    stop = edges.start[origin + 1]
    if run >= stop or edges.target[run] != target:
        return -1
    place = int(truth.waiting[run])
    while place < stop and edges.target[place] == target and truth.done[edges.face[place]]:
        place += 1
    truth.waiting[run] = place
    if place < stop and edges.target[place] == target:
        return place
    return -1


@merged_kernel
def find_right(truth: Truth, candidates: Candidates, count: int, first: int, second: int) -> bool:
    """Set `candidates.right` for the gate first -> second; returns whether any candidate is right."""
    edges = truth.edges
    for row in range(count):
        candidates.right[row] = -1
    place = waiting_entry(truth, first, second)
    if place < 0:
        return False
    stop = edges.start[first + 1]
    found = False
    for entry in range(place, min(place + SHORT_RUN, stop)):
        if edges.target[entry] != second:
            return found
        if not truth.done[edges.face[entry]]:
            for row in range(count):
                if candidates.vertex[row] == edges.apex[entry]:
                    candidates.right[row] = entry
                    found = True
    if place + SHORT_RUN >= stop or edges.target[place + SHORT_RUN] != second:
        return found
    for row in range(count):
        entry = edge_index.find_entry(edges, first, second, candidates.vertex[row])
        if entry >= 0 and not truth.done[edges.face[entry]]:
            candidates.right[row] = entry
            found = True
    return found


@borrowing_kernel
def finish_face(truth: Truth, a: int, b: int, c: int) -> bool:
    """Note that the face (a, b, c) is coded; returns False if it is not one of the faces or was coded before."""
    entry = edge_index.find_entry(truth.edges, a, b, c)
    if entry < 0 or truth.done[truth.edges.face[entry]]:
        return False
    truth.done[truth.edges.face[entry]] = 1
    return True


@kernel
def survey(truth: Truth) -> tuple[bool, bool, bool]:
    """Whether faces are distinct; every directed edge has an opposite one; no directed edge has two faces."""
    edges = truth.edges
    distinct = True
    closed = True
    simple = True
    for origin in range(len(edges.start) - 1):
        for entry in range(edges.start[origin], edges.start[origin + 1]):
            target = edges.target[entry]
            if entry > edges.start[origin] and edges.target[entry - 1] == target:
                simple = False
                if edges.apex[entry - 1] == edges.apex[entry]:
                    distinct = False
            opposite = edge_index.first_entry(edges, target, origin, -1)
            if opposite >= edges.start[target + 1] or edges.target[opposite] != origin:
                closed = False
    return distinct, closed, simple
