"""Which vertices may be the apex of a face at a gate (docs/format.md, section 9.3)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from meshtide_codec.reference.faces_mesh import BLOCKED, CLOSES_FIRST, CLOSES_SECOND, Marks

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_coarse import CoarseMesh
    from meshtide_codec.reference.faces_mesh import FineMesh

CAPACITY = 256
WINDOW = 48
NEIGHBOUR_LIMIT = 128

NEW_FACE_APEX, OLD_FACE_APEX, SIBLING, COMMON_SIBLING, NEIGHBOUR, KNOWN_APEX = range(6)
UNBLOCKED, BLOCKED_ONLY, EVERYTHING = range(3)
BLOCKED_CORNER = 9
NOBODY = -1


@dataclass
class Candidate:
    """A vertex that may be the apex.

    Attributes:
        vertex: which one.
        kind: how it was found.
        flags: which edges its face would close, or that it is blocked.
        corner: edges closed (3: blocked) * 3 + 0 for a vertex without faces, 1 with open edges, 2 without open edges.
        coarse_face: the coarse face below its face, or NOBODY.
        weight: how likely it is, against the others.
        refused: whether it has been asked for in vain.
        places: of its properties, where faces are coded deeply.
    """

    vertex: int
    kind: int
    flags: int = 0
    corner: int = 0
    coarse_face: int = NOBODY
    weight: int = 0
    refused: bool = False
    places: list[int] = field(default_factory=list)


class Gathering:
    """Collects the candidates at the gate first -> second.

    Args:
        coarse: the coarse level.
        fine: the fine mesh so far.
        ends: the gate's two ends, and the apex of the face behind it or NOBODY.
        marks: what was found around the ends.
        wanted: UNBLOCKED, BLOCKED_ONLY or EVERYTHING.

    Attributes:
        candidates: the list, at most CAPACITY long.
        below: coarse faces at the coarse edge below the gate.
        uncovered: of those, not accounted for.
    """

    def __init__(
        self, coarse: CoarseMesh, fine: FineMesh, ends: tuple[int, int, int], marks: Marks, wanted: int
    ) -> None:
        self._coarse = coarse
        self._fine = fine
        self._first, self._second, self._known_apex = ends
        self._marks = marks
        self._wanted = wanted
        self.candidates: list[Candidate] = []
        self.below = self.uncovered = 0
        if coarse.parents[self._first] == coarse.parents[self._second]:
            self._at_one_parent(coarse.parents[self._first])
        else:
            self._at_two_parents(coarse.parents[self._first], coarse.parents[self._second])

    def _at_two_parents(self, first_parent: int, second_parent: int) -> None:
        for apex, face in self._coarse.at_edge(first_parent, second_parent):
            covered = self._coarse.covered[face]
            self.below += 1
            self.uncovered += not covered
            kind = OLD_FACE_APEX if covered else NEW_FACE_APEX
            self._add(self._coarse.children[apex], kind, face)
        for vertex, parent in ((self._first, first_parent), (self._second, second_parent)):
            self._add(_window(vertex, self._coarse.children[parent]), SIBLING)

    def _at_one_parent(self, parent: int) -> None:
        children = self._coarse.children[parent]
        if len(children) <= CAPACITY:
            self._add(children, COMMON_SIBLING)
        else:
            lower = _window(min(self._first, self._second), children)
            upper = _window(max(self._first, self._second), children)
            self._add(lower, COMMON_SIBLING)
            self._add(range(max(upper.start, lower.stop), upper.stop), COMMON_SIBLING)
        seen = {parent}
        for target, apex, _ in self._coarse.entries[parent][:NEIGHBOUR_LIMIT]:
            for neighbour in (target, apex):
                if neighbour not in seen:
                    seen.add(neighbour)
                    self._add(self._coarse.children[neighbour], NEIGHBOUR)

    def _add(self, vertices: range, kind: int, coarse_face: int = NOBODY) -> None:
        """Append those of the vertices that can be the apex."""
        for vertex in vertices[: CAPACITY - len(self.candidates)]:
            if vertex in {self._first, self._second}:
                continue
            flags = self._marks.flags.get(vertex, 0)
            state = 0
            if self._fine.leaving[vertex]:
                state = 1 if self._fine.open_edges[vertex] > 0 else 2
            known = vertex == self._known_apex
            if flags & BLOCKED or state == 2 or known:  # a vertex without open edges is complete
                if self._wanted == UNBLOCKED:
                    continue
                flags = BLOCKED
                corner = BLOCKED_CORNER + state
            elif self._wanted == BLOCKED_ONLY:
                continue
            else:
                corner = (bool(flags & CLOSES_FIRST) + bool(flags & CLOSES_SECOND)) * 3 + state
            self.candidates.append(Candidate(vertex, KNOWN_APEX if known else kind, flags, corner, coarse_face))


def _window(vertex: int, siblings: range) -> range:
    """The siblings around a vertex that are considered."""
    return range(max(siblings.start, vertex - WINDOW), min(siblings.stop, vertex + WINDOW + 1))
