"""What the coarse level says about the fine one: which vertices split, which faces are copied, which are accounted for.

A coarse vertex with one child is unsplit. A coarse face whose corners are all unsplit has exactly one fine face above
it: it is copied for nothing. Everything else happens at split vertices and their neighbours: the active part.
Cost: O(coarse vertices + coarse faces).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import borrowing_kernel, kernel, merged_kernel
from meshtide_codec.connectivity import edge_index_kernels as edge_index
from meshtide_codec.connectivity import half_edge_kernels as half_edges

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.edge_index_kernels import EdgeIndex
    from meshtide_codec.connectivity.half_edge_kernels import FineMesh

ACTIVE = 1  # shares a face with a split vertex, or is one
SPLIT = 2  # has more than one child

TOO_MANY_FACES = -1  # status: there are more faces than were announced

APEX_SCAN_LIMIT = 64  # faces at one coarse edge that are looked at


class CoarseMesh(NamedTuple):
    """The level above the one being coded.

    Attributes:
        children: (c + 1,) int32; the children of coarse vertex a are children[a] to children[a + 1].
        faces: (k, 3) int32.
        activity: (c,) int8, bits ACTIVE and SPLIT.
        covered: (k,) int8, 1 once a fine face above the coarse face is known.
        edges: index of the faces with an active corner.
    """

    children: NDArray[np.int32]
    faces: NDArray[np.int32]
    activity: NDArray[np.int8]
    covered: NDArray[np.int8]
    edges: EdgeIndex


@kernel
def build_coarse_mesh(parents: NDArray[np.int32], faces: NDArray[np.int32], coarse_count: int) -> CoarseMesh:
    """Collect what the traversal asks of the coarse level; indices must have been checked."""
    children = np.zeros(coarse_count + 1, np.int32)
    for parent in parents:
        children[parent + 1] += 1
    activity = np.zeros(coarse_count, np.int8)
    for vertex in range(coarse_count):
        if children[vertex + 1] > 1:
            activity[vertex] = ACTIVE | SPLIT
        children[vertex + 1] += children[vertex]
    covered = np.ones(len(faces), np.int8)
    for face in range(len(faces)):
        if (activity[faces[face, 0]] | activity[faces[face, 1]] | activity[faces[face, 2]]) & SPLIT:
            covered[face] = 0
            for corner in range(3):
                activity[faces[face, corner]] |= ACTIVE
    included = np.zeros(len(faces), np.int8)
    for face in range(len(faces)):
        if activity[faces[face, 0]] | activity[faces[face, 1]] | activity[faces[face, 2]]:
            included[face] = 1
    return CoarseMesh(children, faces, activity, covered, edge_index.index_edges(faces, coarse_count, included))


@borrowing_kernel
def copy_free_faces(coarse: CoarseMesh, fine: FineMesh) -> int:
    """Write the faces above coarse faces without split corners; returns their number or TOO_MANY_FACES."""
    activity = coarse.activity
    triangles = fine.triangles
    vertices = fine.vertices
    count = 0
    for face in range(len(coarse.faces)):
        if not coarse.covered[face]:
            continue
        if count == len(triangles):
            return TOO_MANY_FACES
        a, b, c = coarse.faces[face, 0], coarse.faces[face, 1], coarse.faces[face, 2]
        half_edges.write_corners(fine, count, coarse.children[a], coarse.children[b], coarse.children[c])
        if activity[a] | activity[b] | activity[c]:
            for corner in range(3):
                start = coarse.faces[face, corner]
                end = coarse.faces[face, (corner + 1) % 3]
                half_edge = 4 * count + corner
                if activity[start]:
                    half_edges.link(triangles, vertices, half_edge, coarse.children[start])
                    if activity[end] and only_split_apexes(coarse, end, start):
                        half_edges.open_edge(
                            triangles, vertices, half_edge, coarse.children[start], coarse.children[end]
                        )
        count += 1
    return count


@borrowing_kernel
def only_split_apexes(coarse: CoarseMesh, start: int, end: int) -> bool:
    """Whether the coarse edge start -> end has faces, all of them with a split apex."""
    edges = coarse.edges
    place = edge_index.first_entry(edges, start, end, 0)
    stop = min(int(edges.start[start + 1]), place + APEX_SCAN_LIMIT)
    found = False
    while place < stop and edges.target[place] == end:
        if not coarse.activity[edges.apex[place]] & SPLIT:
            return False
        found = True
        place += 1
    return found


@merged_kernel
def has_split_apex(coarse: CoarseMesh, start: int, end: int) -> bool:
    """Whether one of the coarse faces at the edge start -> end has a split apex."""
    edges = coarse.edges
    place = edge_index.first_entry(edges, start, end, 0)
    stop = min(int(edges.start[start + 1]), place + APEX_SCAN_LIMIT)
    while place < stop and edges.target[place] == end:
        if coarse.activity[edges.apex[place]] & SPLIT:
            return True
        place += 1
    return False


@borrowing_kernel
def cover(coarse: CoarseMesh, fine: FineMesh, triangle: int) -> None:
    """Note that the coarse face below a fine triangle, if there is one, is accounted for."""
    a = fine.parents[fine.triangles[triangle, 0]]
    b = fine.parents[fine.triangles[triangle, 1]]
    c = fine.parents[fine.triangles[triangle, 2]]
    if edge_index.is_degenerate(a, b, c):
        return
    entry = edge_index.find_entry(coarse.edges, a, b, c)
    if entry >= 0:
        coarse.covered[coarse.edges.face[entry]] = 1
