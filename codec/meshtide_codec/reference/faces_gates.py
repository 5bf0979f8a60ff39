"""Gates: half-edges whose other side is open; most faces are found here (docs/format.md, section 9.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.faces_candidates import BLOCKED_ONLY, UNBLOCKED, Gathering
from meshtide_codec.reference.faces_choices import AT_EXTRA_FACE, AT_GATE
from meshtide_codec.reference.faces_mesh import BORDER, EXTRA, OPEN

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_growth import Growth
    from meshtide_codec.reference.faces_mesh import Marks

Ends = tuple[int, int, int]


class Gates:
    """Passes over the half-edges in the order of their numbers: two, or more where faces are coded deeply."""

    def __init__(self, growth: Growth) -> None:
        self._growth = growth
        self._passes = [0] * (len(growth.scores.waits) + 1)

    def decode(self) -> None:
        """Ask gates until none is left or all faces are known."""
        waits = [*self._growth.scores.waits, None]
        while not self._growth.complete:
            for number, most in enumerate(waits):
                gate = self._passes[number] = self._next_open(self._passes[number])
                if gate < len(self._growth.fine.twins):
                    self._passes[number] += 1
                    self._ask(gate, most)
                    break
            else:
                return

    def _next_open(self, half_edge: int) -> int:
        twins = self._growth.fine.twins
        while half_edge < len(twins) and twins[half_edge] != OPEN:
            half_edge += 1
        return half_edge

    def _ask(self, gate: int, most: int | None) -> None:
        """Decode the face on the open side of a half-edge, or that there is none; beyond `most` weight it waits."""
        growth, fine = self._growth, self._growth.fine
        ends = (fine.end(gate), fine.start(gate), fine.apex(gate))
        marks = fine.mark(ends[0], ends[1])
        if marks.filled:
            fine.drop(gate, EXTRA)
            return
        found = Gathering(growth.coarse, fine, ends, marks, UNBLOCKED)
        if growth.closed and not found.candidates:
            raise MapConnError("a gate of a level announced as closed has no candidates; the stream is damaged")
        family = (self._shared(ends), found.below, found.uncovered)
        if found.candidates:
            best, total = growth.scores.weigh(found.candidates, ends, marks)
            if most is not None and total > most:
                return
            at_border = growth.borders(ends[0], ends[1])
            if growth.closed or growth.choices.gate_has_face(family, at_border, found.candidates, best, total):
                chosen = growth.choices.choose(AT_GATE, found.candidates, best, total)
                growth.scores.learn(found.candidates, ends, chosen, total)
                growth.add_at_gate(gate, chosen, marks)
                return
        if not growth.clean and self._found_blocked(ends, marks, family):
            return
        fine.drop(gate, BORDER)
        fine.at_border[ends[0]] = fine.at_border[ends[1]] = 1

    def _found_blocked(self, ends: Ends, marks: Marks, family: tuple[bool, int, int]) -> bool:
        """Whether a blocked candidate is the apex after all; its face is added then, and the gate stays."""
        growth = self._growth
        candidates = Gathering(growth.coarse, growth.fine, ends, marks, BLOCKED_ONLY).candidates
        if not candidates:
            return False
        best, total = growth.scores.weigh(candidates, ends, marks)
        at_border = growth.borders(ends[0], ends[1])
        if not growth.choices.gate_has_face(family, at_border, candidates, best, total):
            return False
        chosen = growth.choices.choose(AT_EXTRA_FACE, candidates, best, total)
        growth.scores.learn(candidates, ends, chosen, total)
        growth.add_anywhere(ends[0], ends[1], chosen.vertex)
        return True

    def _shared(self, ends: Ends) -> bool:
        parents = self._growth.coarse.parents
        return parents[ends[0]] == parents[ends[1]]
