"""Extra faces: further ones at edges that have a face already (docs/format.md, section 9.7)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.faces_candidates import EVERYTHING, Gathering
from meshtide_codec.reference.faces_choices import AT_EXTRA_FACE, EXTRA, EXTRA_DIRECTION
from meshtide_codec.reference.faces_mesh import BORDER

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_growth import Growth


class ExtraFaces:
    """One pass over all half-edges that have a twin of a higher number, or are borders."""

    def __init__(self, growth: Growth) -> None:
        self._growth = growth
        self._half_edge = 0

    def decode_one(self) -> bool:
        """Go on to the next extra face and add it; False when there is none."""
        twins = self._growth.fine.twins
        while self._half_edge < len(twins):
            twin = twins[self._half_edge]
            if (twin == BORDER or twin > self._half_edge) and self._ask():
                return True
            self._half_edge += 1
        return False

    def _ask(self) -> bool:
        """Whether there is a further face at the edge; it is added then."""
        growth, fine = self._growth, self._growth.fine
        border = fine.twins[self._half_edge] == BORDER
        first, second = fine.end(self._half_edge), fine.start(self._half_edge)
        place = self._context(first, second, border=border)
        if place is None or not growth.choices.adaptive_bit(EXTRA + place):
            return False
        if growth.choices.adaptive_bit(EXTRA_DIRECTION + border):
            first, second = second, first
        ends = (first, second, fine.apex(self._half_edge))
        marks = fine.mark(first, second)
        candidates = Gathering(growth.coarse, fine, ends, marks, EVERYTHING).candidates
        if not candidates:
            raise MapConnError("an extra face has no candidates; the stream is damaged")
        best, total = growth.scores.weigh(candidates, ends, marks)
        chosen = growth.choices.choose(AT_EXTRA_FACE, candidates, best, total)
        growth.add_anywhere(first, second, chosen.vertex)
        return True

    def _context(self, first: int, second: int, *, border: bool) -> int | None:
        """Context of the question, or None where everything around is unsplit: nothing can be missing there."""
        coarse = self._growth.coarse
        one, other = coarse.parents[first], coarse.parents[second]
        split = coarse.split[one] or coarse.split[other]
        uncovered = 0
        if one == other:
            faces = len(coarse.children[one]) - 2
        else:
            below = coarse.at_edge(one, other) + coarse.at_edge(other, one)
            faces = len(below)
            uncovered = min(2, sum(not coarse.covered[face] for _, face in below))
            split = split or any(coarse.split[apex] for apex, _ in below)
        if not split:
            return None
        context = ((int(one == other) * 6 + min(5, faces)) * 3 + uncovered) * 3 + self._growth.borders(first, second)
        both_split = coarse.split[one] and coarse.split[other]
        return (context * 2 + border) * 2 + (not both_split)
