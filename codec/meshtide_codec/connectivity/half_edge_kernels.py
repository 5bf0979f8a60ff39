"""The fine mesh while it grows: triangles, what lies around each vertex, and how half-edges find their twins.

A triangle t owns the half-edges 4 t, 4 t + 1, 4 t + 2; half-edge 4 t + k leaves its corner k. The half-edges that leave
a vertex form a linked list, newest first. Cost of every operation: O(1), or O(length of that list) up to SCAN_LIMIT.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, merged_kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Table = NDArray[np.int32]

# Columns of FineMesh.triangles: three corners, then per corner two fields of the half-edge that leaves it.
CORNER = 0
AROUND = 3  # next half-edge that leaves the same vertex, or NONE
TWIN = 6  # the half-edge that runs the other way, or one of the states below
TRIANGLE_COLUMNS = 9

NONE = -1
OPEN = -1  # no face on the other side yet: a gate
SETTLED = -2  # what lies on the other side is known from the coarse level
BORDER = -3  # the gate was asked and found no face
EXTRA = -4  # a third or later face at this edge

# Columns of FineMesh.vertices.
X = 0  # Y and Z follow
MARK = 3  # number of the gate that last touched the vertex
FLAGS = 4  # what that gate found: CLOSES_FIRST, CLOSES_SECOND, BLOCKED
CLOSING_FIRST = 5  # the open half-edge that a face with this apex closes at the gate's first end
CLOSING_SECOND = 6  # the same at its second end
HEAD = 7  # newest half-edge that leaves the vertex, or NONE
FACES = 8  # faces at the vertex so far
OPEN_EDGES = 9  # open half-edges that leave or reach the vertex
ANGLE = 10  # sum of the angles of its faces, 32 for 180 degrees
AT_BORDER = 11  # 1 when a gate at this vertex found no face
VERTEX_COLUMNS = 12

CLOSES_FIRST = 1
CLOSES_SECOND = 2
BLOCKED = 4  # a face with this apex would repeat a directed edge

SCAN_LIMIT = 64  # half-edges of one vertex that are looked at: hubs of fans have any number


class FineMesh(NamedTuple):
    """The level being coded.

    Attributes:
        parents: (n,) int32, coarse vertex of each fine vertex.
        triangles: (m, TRIANGLE_COLUMNS) int32, rows used up to the number of faces known so far.
        vertices: (n, VERTEX_COLUMNS) int32.
    """

    parents: Table
    triangles: Table
    vertices: Table


@inlined_kernel
def following(half_edge: int) -> int:
    """The next half-edge of the same triangle."""
    return half_edge + 1 if (half_edge & 3) != 2 else half_edge - 2


@inlined_kernel
def preceding(half_edge: int) -> int:
    """The previous half-edge of the same triangle."""
    return half_edge - 1 if (half_edge & 3) != 0 else half_edge + 2


@inlined_kernel
def field(triangles: Table, half_edge: int, column: int) -> int:
    """CORNER, AROUND or TWIN of a half-edge."""
    return int(triangles[half_edge >> 2, (half_edge & 3) + column])


@inlined_kernel
def set_field(triangles: Table, half_edge: int, column: int, value: int) -> None:
    """Set CORNER, AROUND or TWIN of a half-edge."""
    triangles[half_edge >> 2, (half_edge & 3) + column] = value


@merged_kernel
def write_corners(fine: FineMesh, triangle: int, a: int, b: int, c: int) -> None:
    """Start triangle number `triangle` with corners a, b, c; every half-edge is settled until told otherwise."""
    row = fine.triangles[triangle]
    row[CORNER], row[CORNER + 1], row[CORNER + 2] = a, b, c
    for corner in range(3):
        row[AROUND + corner] = NONE
        row[TWIN + corner] = SETTLED


@inlined_kernel
def link(triangles: Table, vertices: Table, half_edge: int, vertex: int) -> None:
    """Enter a half-edge at the head of the list of the vertex that it leaves, and count its face there."""
    set_field(triangles, half_edge, AROUND, vertices[vertex, HEAD])
    vertices[vertex, HEAD] = half_edge
    vertices[vertex, FACES] += 1


@inlined_kernel
def open_edge(triangles: Table, vertices: Table, half_edge: int, start: int, end: int) -> None:
    """Make a half-edge from `start` to `end` a gate."""
    set_field(triangles, half_edge, TWIN, OPEN)
    vertices[start, OPEN_EDGES] += 1
    vertices[end, OPEN_EDGES] += 1


@inlined_kernel
def close_edge(triangles: Table, vertices: Table, gate: int, twin: int, start: int, end: int) -> None:
    """Pair an open half-edge with the new half-edge that runs the other way."""
    set_field(triangles, gate, TWIN, twin)
    set_field(triangles, twin, TWIN, gate)
    vertices[start, OPEN_EDGES] -= 1
    vertices[end, OPEN_EDGES] -= 1


@inlined_kernel
def drop_gate(triangles: Table, vertices: Table, gate: int, start: int, end: int, state: int) -> None:
    """Take an open half-edge out of the gates."""
    set_field(triangles, gate, TWIN, state)
    vertices[start, OPEN_EDGES] -= 1
    vertices[end, OPEN_EDGES] -= 1


@merged_kernel
def mark_surroundings(fine: FineMesh, first: int, second: int, number: int) -> bool:
    """Flag every vertex that shares a face with an end of the gate first -> second.

    A face (first, second, apex) closes an edge where an open half-edge runs from `first` to the apex or from the apex
    to `second`, and is blocked where one of its directed edges exists or an edge of it has two faces already.
    Returns whether the directed edge first -> second exists already.
    """
    triangles = fine.triangles
    vertices = fine.vertices
    filled = False
    steps = 0
    half_edge = int(vertices[first, HEAD])
    while half_edge >= 0 and steps < SCAN_LIMIT:
        steps += 1
        target = field(triangles, following(half_edge), CORNER)
        source = field(triangles, preceding(half_edge), CORNER)
        if field(triangles, half_edge, TWIN) == OPEN:
            if vertices[target, MARK] != number:
                vertices[target, MARK] = number
                vertices[target, FLAGS] = CLOSES_FIRST
                vertices[target, CLOSING_FIRST] = half_edge
        else:
            vertices[target, MARK] = number
            vertices[target, FLAGS] = BLOCKED
        if target == second:
            filled = True
        vertices[source, MARK] = number
        vertices[source, FLAGS] = BLOCKED
        half_edge = field(triangles, half_edge, AROUND)
    steps = 0
    half_edge = int(vertices[second, HEAD])
    while half_edge >= 0 and steps < SCAN_LIMIT:
        steps += 1
        target = field(triangles, following(half_edge), CORNER)
        arriving = preceding(half_edge)
        source = field(triangles, arriving, CORNER)
        vertices[target, MARK] = number
        vertices[target, FLAGS] = BLOCKED
        if vertices[source, MARK] != number:
            vertices[source, MARK] = number
            vertices[source, FLAGS] = 0
        if field(triangles, arriving, TWIN) == OPEN:
            if vertices[source, FLAGS] & (BLOCKED | CLOSES_SECOND) == 0:
                vertices[source, FLAGS] |= CLOSES_SECOND
                vertices[source, CLOSING_SECOND] = arriving
        else:
            vertices[source, FLAGS] = BLOCKED
        half_edge = field(triangles, half_edge, AROUND)
    return filled


@borrowing_kernel
def attach_anywhere(fine: FineMesh, triangle: int) -> None:
    """Give each edge of a new triangle a twin, a gate, or a place among the extra faces of a crowded edge."""
    triangles = fine.triangles
    vertices = fine.vertices
    for corner in range(3):
        half_edge = 4 * triangle + corner
        start = field(triangles, half_edge, CORNER)
        end = field(triangles, following(half_edge), CORNER)
        partner, crowded = _find_partner(triangles, vertices, start, end)
        if partner >= 0:
            if field(triangles, partner, TWIN) == OPEN:
                close_edge(triangles, vertices, partner, half_edge, start, end)
            else:
                set_field(triangles, partner, TWIN, half_edge)
                set_field(triangles, half_edge, TWIN, partner)
        elif crowded:
            set_field(triangles, half_edge, TWIN, EXTRA)
        else:
            open_edge(triangles, vertices, half_edge, start, end)
    for corner in range(3):
        link(triangles, vertices, 4 * triangle + corner, triangles[triangle, corner])


@borrowing_kernel
def _find_partner(triangles: Table, vertices: Table, start: int, end: int) -> tuple[int, bool]:
    """A half-edge from `end` to `start` that has no twin yet, or NONE; and whether the edge has faces at all."""
    crowded = False
    steps = 0
    half_edge = int(vertices[end, HEAD])
    while half_edge >= 0 and steps < SCAN_LIMIT:
        steps += 1
        if field(triangles, following(half_edge), CORNER) == start:
            crowded = True
            state = field(triangles, half_edge, TWIN)
            if state in (OPEN, BORDER):
                return half_edge, True
        half_edge = field(triangles, half_edge, AROUND)
    steps = 0
    half_edge = int(vertices[start, HEAD])
    while half_edge >= 0 and steps < SCAN_LIMIT and not crowded:
        steps += 1
        if field(triangles, following(half_edge), CORNER) == end:
            crowded = True
        half_edge = field(triangles, half_edge, AROUND)
    return NONE, crowded
