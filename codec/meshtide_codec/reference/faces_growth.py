"""A level's faces while they become known, and the ways in which a face joins (docs/format.md, section 9.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.faces_mesh import CLOSES_FIRST, CLOSES_SECOND, FineMesh, Marks
from meshtide_codec.reference.faces_shapes import Shapes

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_candidates import Candidate
    from meshtide_codec.reference.faces_coarse import CoarseMesh
    from meshtide_codec.reference.faces_states import FaceStates
    from meshtide_codec.reference.octree import Cell
    from meshtide_codec.reference.range_decoder import RangeDecoder


class Growth:
    """The state of a traversal.

    Args:
        coarse: the coarse level.
        face_count: number of fine faces, announced.
        positions: of the fine vertices in half cells, or None.
        states: scores and neurons.
        decoder: where decisions come from.
    """

    def __init__(
        self,
        coarse: CoarseMesh,
        face_count: int,
        positions: list[Cell] | None,
        states: FaceStates,
        decoder: RangeDecoder,
    ) -> None:
        self.coarse = coarse
        shapes = None if positions is None else Shapes(positions)
        self.fine = FineMesh(len(coarse.parents), shapes)
        self.scores = states.scores_of(coarse, self.fine)
        self.choices = states.choices_from(decoder)
        self._face_count = face_count
        self.closed = bool(decoder.raw_bits(1))
        self.clean = bool(decoder.raw_bits(1))
        self._copy_faces()

    @property
    def complete(self) -> bool:
        """Whether all faces are known."""
        return len(self.fine.faces) >= self._face_count

    def borders(self, first: int, second: int) -> int:
        """How many of two vertices lie at a border."""
        return self.fine.at_border[first] + self.fine.at_border[second]

    def add_at_gate(self, gate: int, chosen: Candidate, marks: Marks) -> None:
        """Add the face between a gate and its apex, closing the edges that it closes."""
        fine, apex = self.fine, chosen.vertex
        first, second = fine.end(gate), fine.start(gate)
        if chosen.coarse_face >= 0:
            self.coarse.covered[chosen.coarse_face] = True
        base = fine.begin_face(first, second, apex)
        fine.pair(gate, base)
        if chosen.flags & CLOSES_SECOND:
            fine.pair(marks.closing_second[apex], base + 1)
        elif self._may_have_another_face(apex, second):
            fine.open(base + 1)
        if chosen.flags & CLOSES_FIRST:
            fine.pair(marks.closing_first[apex], base + 2)
        elif self._may_have_another_face(first, apex):
            fine.open(base + 2)
        for corner in range(3):
            fine.link(base + corner)
        fine.add_angles(first, second, apex)

    def add_anywhere(self, a: int, b: int, c: int) -> None:
        """Add a face that no gate has led to."""
        if len({a, b, c}) < 3:
            raise MapConnError("a face names one vertex twice; the stream is damaged")
        fine = self.fine
        base = fine.begin_face(a, b, c)
        for corner in range(3):
            fine.attach(base + corner)
        for corner in range(3):
            fine.link(base + corner)
        self.coarse.cover(a, b, c)
        fine.add_angles(a, b, c)

    def _copy_faces(self) -> None:
        """The faces above coarse faces without split corners."""
        coarse, fine = self.coarse, self.fine
        for face, covered in zip(coarse.faces, list(coarse.covered), strict=True):
            if not covered:
                continue
            a, b, c = (coarse.children[corner].start for corner in face)
            base = fine.begin_face(a, b, c)
            for corner in range(3):
                start, end = face[corner], face[(corner + 1) % 3]
                if coarse.active[start]:
                    fine.link(base + corner)
                    apexes = [apex for apex, _ in coarse.at_edge(end, start)]
                    if coarse.active[end] and apexes and all(coarse.split[apex] for apex in apexes):
                        fine.open(base + corner)

    def _may_have_another_face(self, start: int, end: int) -> bool:
        """Whether a face with the directed edge start -> end is possible and not a copied one."""
        one, other = self.coarse.parents[start], self.coarse.parents[end]
        if self.coarse.split[one] or self.coarse.split[other]:
            return True
        return any(self.coarse.split[apex] for apex, _ in self.coarse.at_edge(one, other))
