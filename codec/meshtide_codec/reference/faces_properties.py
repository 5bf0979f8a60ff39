"""Nineteen properties of a candidate, for faces that are coded deeply (docs/format.md, section 9.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.faces_candidates import NEW_FACE_APEX
from meshtide_codec.reference.faces_mesh import CLOSES_FIRST, CLOSES_SECOND
from meshtide_codec.reference.faces_shapes import angle_class, bend_class, length_class, short_length

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_candidates import Candidate
    from meshtide_codec.reference.faces_coarse import CoarseMesh
    from meshtide_codec.reference.faces_mesh import FineMesh, Marks
    from meshtide_codec.reference.faces_shapes import Shapes

# Where the places of each property begin.
KIND = 0
VALENCE = KIND + 6 * 12
BOTH_ENDS = VALENCE + 10 * 4 * 12
LENGTH = BOTH_ENDS + 16 * 16
SHORT_LENGTH = LENGTH + 6 * 16 * 32
ANGLE_SUM = SHORT_LENGTH + 16 * 16 * 16
BEND = ANGLE_SUM + 12 * 8 * 32
END_ANGLE_SUM = BEND + 12 * 32 * 8
END_FAMILY = END_ANGLE_SUM + 16 * 4 * 32
APEX_FAMILY = END_FAMILY + 2 * 3 * 5 * 2
SPHERE = APEX_FAMILY + 2 * 3 * 5 * 4
ACROSS = SPHERE + 5 * 3 * 6
CLOSED_BEND = ACROSS + 16 * 16 * 16
PARALLELOGRAM = CLOSED_BEND + 33 * 8
BEND_AND_ANGLE = PARALLELOGRAM + 16 * 32
MARGIN = BEND_AND_ANGLE + 32 * 32
PLACES = MARGIN + 16 * 4 * 12

FAMILY_SCAN_LIMIT = 32
SPHERE_LIMIT = 24
NO_BEND = 32


class Properties:
    """Measures the candidates at one gate.

    Args:
        coarse: the coarse mesh.
        fine: the fine mesh so far.
        shapes: its positions.
        ends: the gate's two ends, and the apex of the face behind it.
        marks: what was found around the ends.
        candidates: all of them.
    """

    def __init__(
        self,
        coarse: CoarseMesh,
        fine: FineMesh,
        shapes: Shapes,
        ends: tuple[int, int, int],
        marks: Marks,
        candidates: list[Candidate],
    ) -> None:
        self._coarse = coarse
        self._fine = fine
        self._shapes = shapes
        self._first, self._second, self._known = ends
        self._marks = marks
        self._candidates = candidates

    def places(self, candidate: Candidate) -> list[int]:
        """The places of the properties of one of the candidates."""
        return self._around(candidate) + self._lengths(candidate) + self._bends(candidate) + self._in_sphere(candidate)

    def _around(self, candidate: Candidate) -> list[int]:
        """What the connectivity says."""
        vertex, corner = candidate.vertex, candidate.corner
        at_first, at_second = self._ends(candidate)
        own = candidate.kind == NEW_FACE_APEX
        shared = self._coarse.parents[self._first] == self._coarse.parents[self._second]
        open_pairs = min(self._fine.open_edges[vertex] >> 1, 3)
        completes = at_first >= 8 and at_second >= 8 and open_pairs == 1
        return [
            KIND + candidate.kind * 12 + corner,
            VALENCE + (min(len(self._fine.leaving[vertex]), 9) * 4 + open_pairs) * 12 + corner,
            BOTH_ENDS + max(at_first, at_second) * 16 + min(at_first, at_second),
            END_FAMILY + self._lacking(self._first, at_first >= 8, own) * 2 + shared,
            END_FAMILY + self._lacking(self._second, at_second >= 8, own) * 2 + shared,
            APEX_FAMILY + self._lacking(vertex, completes, own) * 4 + corner // 3,
        ]

    def _ends(self, candidate: Candidate) -> tuple[int, int]:
        """For each end its faces, up to 7, and 8 more if the candidate's face closes the edge there."""
        return (
            min(len(self._fine.leaving[self._first]), 7) + 8 * bool(candidate.flags & CLOSES_FIRST),
            min(len(self._fine.leaving[self._second]), 7) + 8 * bool(candidate.flags & CLOSES_SECOND),
        )

    def _lacking(self, vertex: int, closed: bool, own: bool) -> int:
        parent = self._coarse.parents[vertex]
        around = self._coarse.entries[parent][:FAMILY_SCAN_LIMIT]
        lacking = sum(not self._coarse.covered[face] for _, _, face in around)
        size = min(len(self._coarse.children[parent]), 3) - 1
        return (closed * 3 + size) * 5 + min(max(lacking - own, 0), 4)

    def _lengths(self, candidate: Candidate) -> list[int]:
        """What lengths and angles say."""
        vertex, shapes = candidate.vertex, self._shapes
        gate, one, other = self._sides(vertex)
        across = shapes.squared(self._known, vertex)
        angle = angle_class(gate, one, other)
        shorter, longer = sorted((short_length(one), short_length(other)))
        sides = (shorter * 16 + longer) * 16
        faces = min(len(self._fine.leaving[vertex]), 7)
        at_first, at_second = self._ends(candidate)
        return [
            LENGTH + (candidate.kind * 16 + length_class(across, gate)) * 32 + angle,
            SHORT_LENGTH + sides + short_length(gate),
            ACROSS + sides + short_length(across),
            ANGLE_SUM + (candidate.corner * 8 + faces) * 32 + self._angle_sum(vertex, angle),
            self._end_angle_sum(self._first, at_first, angle_class(other, one, gate)),
            self._end_angle_sum(self._second, at_second, angle_class(one, other, gate)),
        ]

    def _end_angle_sum(self, vertex: int, end: int, angle: int) -> int:
        open_edges = min(self._fine.open_edges[vertex], 3)
        return END_ANGLE_SUM + (end * 4 + open_edges) * 32 + self._angle_sum(vertex, angle)

    def _angle_sum(self, vertex: int, angle: int) -> int:
        return min((self._fine.angles[vertex] + angle) >> 1, 31)

    def _sides(self, vertex: int) -> tuple[float, float, float]:
        shapes = self._shapes
        gate = shapes.squared(self._first, self._second)
        return gate, shapes.squared(self._first, vertex), shapes.squared(self._second, vertex)

    def _bends(self, candidate: Candidate) -> list[int]:
        """What the direction of the candidate's face says."""
        vertex, shapes, marks = candidate.vertex, self._shapes, self._marks
        gate, one, other = self._sides(vertex)
        angle = angle_class(gate, one, other)
        normal = shapes.normal(self._first, self._second, vertex)
        bend = bend_class(normal, shapes.normal(self._second, self._first, self._known))
        closed = [NO_BEND, NO_BEND]
        for end, flag, closing in ((0, CLOSES_FIRST, marks.closing_first), (1, CLOSES_SECOND, marks.closing_second)):
            if candidate.flags & flag:
                behind = closing[vertex]
                corners = self._fine.start(behind), self._fine.end(behind), self._fine.apex(behind)
                closed[end] = bend_class(normal, shapes.normal(*corners))
        apex, first, second, known = map(shapes.point, (vertex, self._first, self._second, self._known))
        x, y, z = (apex[axis] - (first[axis] + second[axis] - known[axis]) for axis in range(3))
        from_parallelogram = length_class(x * x + y * y + z * z, gate)
        return [
            BEND + (candidate.corner * 32 + bend) * 8 + (angle >> 2),
            CLOSED_BEND + closed[0] * 8 + (bend >> 2),
            CLOSED_BEND + closed[1] * 8 + (bend >> 2),
            PARALLELOGRAM + from_parallelogram * 32 + bend,
            BEND_AND_ANGLE + bend * 32 + angle,
        ]

    def _in_sphere(self, candidate: Candidate) -> list[int]:
        """Whether others lie in the smallest sphere through gate and candidate."""
        inside, near, margin = self._look_in_sphere(candidate.vertex)
        return [
            SPHERE + (inside * 3 + near) * 6 + candidate.kind,
            MARGIN + (margin * 4 + min(inside, 3)) * 12 + candidate.corner,
        ]

    def _look_in_sphere(self, vertex: int) -> tuple[int, int, int]:
        shapes = self._shapes
        first, second, apex = map(shapes.point, (self._first, self._second, vertex))
        e = [second[axis] - first[axis] for axis in range(3)]
        d = [apex[axis] - first[axis] for axis in range(3)]
        ee = shapes.squared(self._first, self._second)
        dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        ed = e[0] * d[0] + e[1] * d[1] + e[2] * d[2]
        determinant = 2.0 * (ee * dd - ed * ed)
        if not determinant > 0.0:
            return 4, 0, 0
        along_e, along_d = dd * (ee - ed) / determinant, ee * (dd - ed) / determinant
        x, y, z = (along_e * e[axis] + along_d * d[axis] for axis in range(3))
        radius = x * x + y * y + z * z
        if not radius > 0.0:
            return 4, 0, 0
        centre = (x + first[0], y + first[1], z + first[2])
        others = [other.vertex for other in self._candidates[:SPHERE_LIMIT] if other.vertex != vertex]
        distances = [shapes.squared_to(other, centre) for other in others]
        inside = sum(distance < radius * 0.96875 for distance in distances)
        near = sum(radius * 0.96875 <= distance < radius * 1.03125 for distance in distances)
        margin = min(int(min([4.0 * radius, *distances]) / radius * 8.0), 15)
        return min(inside, 4), min(near, 2), margin
