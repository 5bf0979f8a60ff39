"""Index of the directed edges of a triangle set: which faces have the edge from a to b, in time O(log valence).

Every face (a, b, c) is entered three times: under a as (b, c), under b as (c, a), under c as (a, b). The entries of a
vertex are sorted by target, then by apex, by three stable counting sorts. Cost: O(vertices + faces), whatever the
valences; a look-up is a bisection, so a vertex with a million faces costs no more than others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, kernel, merged_kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Faces = NDArray[np.int32]
    Indices = NDArray[np.int32]

LINEAR_SEARCH = 12  # lists up to this length are scanned, longer ones bisected


class EdgeIndex(NamedTuple):
    """Directed edges of a triangle set, grouped by origin.

    Attributes:
        start: (vertices + 1,) int32, the entries of vertex a are start[a] to start[a + 1].
        target: (entries,) int32, where the edge goes to.
        apex: (entries,) int32, the third corner of the face.
        face: (entries,) int32, row of the face.
    """

    start: Indices
    target: Indices
    apex: Indices
    face: Indices


@kernel
def index_edges(faces: Faces, vertex_count: int, included: NDArray[np.int8]) -> EdgeIndex:
    """Index the faces (m, 3) whose `included` (m,) int8 is not zero; corners must lie in [0, vertex_count)."""
    face_count = 0
    for face in range(len(faces)):
        if included[face]:
            face_count += 1
    order = np.empty(3 * face_count, np.int32)
    entries = 0
    for face in range(len(faces)):
        if included[face]:
            for corner in range(3):
                order[entries] = 4 * face + corner
                entries += 1
    for digit in range(2, -1, -1):
        order, start = _sorted_by_corner(faces, order, vertex_count, digit)
    target = np.empty(entries, np.int32)
    apex = np.empty(entries, np.int32)
    face_of = np.empty(entries, np.int32)
    for place in range(entries):
        face = order[place] >> 2
        corner = order[place] & 3
        face_of[place] = face
        target[place] = faces[face, (corner + 1) % 3]
        apex[place] = faces[face, (corner + 2) % 3]
    return EdgeIndex(start, target, apex, face_of)


@kernel
def _sorted_by_corner(faces: Faces, order: Indices, vertex_count: int, digit: int) -> tuple[Indices, Indices]:
    """`order` stably sorted by the corner that lies `digit` places after the entry's own; and where groups start."""
    start = np.zeros(vertex_count + 1, np.int32)
    for entry in order:
        start[faces[entry >> 2, ((entry & 3) + digit) % 3] + 1] += 1
    for vertex in range(vertex_count):
        start[vertex + 1] += start[vertex]
    place = start[:-1].copy()
    result = np.empty_like(order)
    for entry in order:
        vertex = faces[entry >> 2, ((entry & 3) + digit) % 3]
        result[place[vertex]] = entry
        place[vertex] += 1
    return result, start


@inlined_kernel
def is_degenerate(a: int, b: int, c: int) -> bool:
    """Whether two corners of a triangle are the same."""
    return a == b or b == c or c == a  # noqa: PLR1714 - kernels compare faster than they search tuples


@merged_kernel
def first_entry(index: EdgeIndex, origin: int, target: int, apex: int) -> int:
    """First entry of `origin` that is not before (target, apex); the end of its list if there is none."""
    low = int(index.start[origin])
    high = int(index.start[origin + 1])
    while high - low > LINEAR_SEARCH:
        middle = (low + high) >> 1
        there = index.target[middle]
        if there < target or (there == target and index.apex[middle] < apex):
            low = middle + 1
        else:
            high = middle
    while low < high:
        there = index.target[low]
        if there > target or (there == target and index.apex[low] >= apex):
            break
        low += 1
    return low


@borrowing_kernel
def find_entry(index: EdgeIndex, origin: int, target: int, apex: int) -> int:
    """The entry of face (origin, target, apex) under `origin`, or -1."""
    place = first_entry(index, origin, target, apex)
    if place < index.start[origin + 1] and index.target[place] == target and index.apex[place] == apex:
        return place
    return -1


@kernel
def sorted_faces(triangles: Faces, vertex_count: int) -> Faces:
    """The first three columns of `triangles`, rotated so that the smallest corner is first, in lexicographic order."""
    faces = np.empty((len(triangles), 3), np.int32)
    order = np.empty(len(triangles), np.int32)
    for row in range(len(triangles)):
        a, b, c = triangles[row, 0], triangles[row, 1], triangles[row, 2]
        if b < a and b < c:
            a, b, c = b, c, a
        elif c < a and c < b:
            a, b, c = c, a, b
        faces[row, 0], faces[row, 1], faces[row, 2] = a, b, c
        order[row] = 4 * row
    for digit in range(2, -1, -1):
        order, _ = _sorted_by_corner(faces, order, vertex_count, digit)
    result = np.empty_like(faces)
    for row in range(len(order)):
        for corner in range(3):
            result[row, corner] = faces[order[row] >> 2, corner]
    return result
