"""The fine mesh while it grows: faces, half-edges and their twins (docs/format.md, section 9.2).

Triangle t owns the half-edges 3 t, 3 t + 1, 3 t + 2; half-edge 3 t + k leaves its corner k.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_shapes import Shapes
    from meshtide_codec.reference.octree import Face

OPEN, SETTLED, BORDER, EXTRA = -1, -2, -3, -4
CLOSES_FIRST, CLOSES_SECOND, BLOCKED = 1, 2, 4
SCAN_LIMIT = 64  # half-edges of one vertex that are looked at


@dataclass
class Marks:
    """What a gate finds around its ends.

    Attributes:
        flags: of the vertices that share a face with an end.
        closing_first: the open half-edge from the first end that a face with this apex would close.
        closing_second: the same for the half-edge that reaches the second end.
        filled: whether the directed edge of the gate exists already.
    """

    flags: dict[int, int] = field(default_factory=dict)
    closing_first: dict[int, int] = field(default_factory=dict)
    closing_second: dict[int, int] = field(default_factory=dict)
    filled: bool = False


class FineMesh:
    """Faces known so far, and what lies around each vertex.

    Attributes:
        faces: in the order in which they became known.
        twins: for each half-edge its twin, or OPEN, SETTLED, BORDER or EXTRA.
        leaving: for each vertex the half-edges that leave it, newest first.
        open_edges: for each vertex the open half-edges that leave or reach it.
        angles: for each vertex the sum of the angle classes of its faces.
        at_border: for each vertex 1 once a gate there has found no face.
    """

    def __init__(self, vertices: int, shapes: Shapes | None) -> None:
        self.faces: list[Face] = []
        self.twins: list[int] = []
        self.leaving: list[list[int]] = [[] for _ in range(vertices)]
        self.open_edges = [0] * vertices
        self.angles = [0] * vertices
        self.at_border = [0] * vertices
        self.shapes = shapes

    def start(self, half_edge: int) -> int:
        """The vertex that a half-edge leaves."""
        return self.faces[half_edge // 3][half_edge % 3]

    def end(self, half_edge: int) -> int:
        """The vertex that it reaches."""
        return self.faces[half_edge // 3][(half_edge + 1) % 3]

    def apex(self, half_edge: int) -> int:
        """The third corner of its face."""
        return self.faces[half_edge // 3][(half_edge + 2) % 3]

    def begin_face(self, a: int, b: int, c: int) -> int:
        """Append a face whose half-edges are settled until told otherwise; returns its first half-edge."""
        self.faces.append((a, b, c))
        self.twins += [SETTLED, SETTLED, SETTLED]
        return 3 * len(self.faces) - 3

    def link(self, half_edge: int) -> None:
        """Enter a half-edge in the list of the vertex that it leaves."""
        self.leaving[self.start(half_edge)].insert(0, half_edge)

    def open(self, half_edge: int) -> None:
        """Make a half-edge a gate."""
        self.twins[half_edge] = OPEN
        self._count_open(half_edge, 1)

    def pair(self, gate: int, half_edge: int) -> None:
        """Make an open half-edge and a new one that runs the other way twins."""
        self._count_open(gate, -1)
        self.twins[gate], self.twins[half_edge] = half_edge, gate

    def drop(self, gate: int, state: int) -> None:
        """Take an open half-edge out of the gates."""
        self._count_open(gate, -1)
        self.twins[gate] = state

    def _count_open(self, half_edge: int, change: int) -> None:
        self.open_edges[self.start(half_edge)] += change
        self.open_edges[self.end(half_edge)] += change

    def mark(self, first: int, second: int) -> Marks:
        """Flag every vertex that shares a face with an end of the gate."""
        marks = Marks()
        for half_edge in self.leaving[first][:SCAN_LIMIT]:
            target = self.end(half_edge)
            if self.twins[half_edge] != OPEN:
                marks.flags[target] = BLOCKED
            elif target not in marks.flags:
                marks.flags[target] = CLOSES_FIRST
                marks.closing_first[target] = half_edge
            if target == second:
                marks.filled = True
            marks.flags[self.apex(half_edge)] = BLOCKED
        for half_edge in self.leaving[second][:SCAN_LIMIT]:
            marks.flags[self.end(half_edge)] = BLOCKED
            arriving = half_edge - 1 if half_edge % 3 else half_edge + 2
            source = self.start(arriving)
            flags = marks.flags.setdefault(source, 0)
            if self.twins[arriving] != OPEN:
                marks.flags[source] = BLOCKED
            elif not flags & (BLOCKED | CLOSES_SECOND):
                marks.flags[source] = flags | CLOSES_SECOND
                marks.closing_second[source] = arriving
        return marks

    def attach(self, half_edge: int) -> None:
        """Give a half-edge of a face from nowhere a twin, a gate, or a place among extra faces."""
        start, end = self.start(half_edge), self.end(half_edge)
        facing = [other for other in self.leaving[end][:SCAN_LIMIT] if self.end(other) == start]
        beside = [other for other in self.leaving[start][:SCAN_LIMIT] if self.end(other) == end]
        partner = next((other for other in facing if self.twins[other] in {OPEN, BORDER}), None)
        if partner is None:
            if facing or beside:
                self.twins[half_edge] = EXTRA
            else:
                self.open(half_edge)
        elif self.twins[partner] == OPEN:
            self.pair(partner, half_edge)
        else:
            self.twins[partner], self.twins[half_edge] = half_edge, partner

    def add_angles(self, first: int, second: int, apex: int) -> None:
        """Add the classes of a face's angles to its corners, if positions are known."""
        if self.shapes is not None:
            for vertex, angle in zip((first, second, apex), self.shapes.angles(first, second, apex), strict=True):
                self.angles[vertex] += angle
