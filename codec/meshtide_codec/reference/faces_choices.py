"""The decisions about faces: is there one, and which candidate is its apex (docs/format.md, section 9.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_candidates import Candidate
    from meshtide_codec.reference.mixing import Neurons
    from meshtide_codec.reference.range_decoder import RangeDecoder

AT_GATE, AT_EXTRA_FACE, AT_CORNER = range(3)
MOST_QUESTIONS = 24
WORST_ODDS = 4096
RATE = 17
LIMIT = 200

# Where each block of contexts begins.
ODDS = 0
KIND = ODDS + 3 * 24 * 4 * 2
GATE = KIND + 6 * 12 * 4 * 4 * 6
GATE_CONFIDENCE = GATE + 7 * 3 * 4 * 4
EXTRA = GATE_CONFIDENCE + 6 * 4 * 4 * 2 * 2 * 3
EXTRA_DIRECTION = EXTRA + 2 * 6 * 3 * 3 * 2 * 2
LEFTOVER = EXTRA_DIRECTION + 2
LISTED = LEFTOVER + 4 * 2
OFFSET = LISTED + 2

GATE_PAIR = 12
BLOCKED_GATE_PAIR = 13
BLOCKED = 3


class Choices:
    """Reads decisions from one payload; its contexts and weights learn."""

    def __init__(self, decoder: RangeDecoder, neurons: Neurons) -> None:
        self.decoder = decoder
        self._neurons = neurons

    def adaptive_bit(self, place: int) -> bool:
        """A decision with one context."""
        return bool(self._neurons.contexts.bit(self.decoder, place))

    def offset(self) -> int:
        """A signed distance in the order of vertices."""
        return self._neurons.contexts.signed(self.decoder, OFFSET)

    def gate_has_face(
        self, family: tuple[bool, int, int], at_border: int, candidates: list[Candidate], best: Candidate, total: int
    ) -> bool:
        """Whether one of the candidates is the apex of a face at a gate.

        `family` tells whether both ends share their parent, the coarse faces at the edge below, and those of them not
        accounted for; `at_border` how many ends lie at a border; `total` the sum of the weights.
        """
        shared, below, uncovered = family
        count, closed = len(candidates), best.corner // 3
        place = 0 if shared else 1 + min(below, 2) * 2 + (uncovered > 0)
        one = ((place * 3 + at_border) * 4 + closed) * 4 + min(count - 1, 3)
        other = (min(count - 1, 5) * 4 + min(3, total // 4096 - 1)) * 4 + closed
        other = ((other * 2 + shared) * 2 + min(uncovered, 1)) * 3 + at_border
        pair = BLOCKED_GATE_PAIR if closed == BLOCKED else GATE_PAIR
        return bool(self._neurons.bit(self.decoder, pair, [GATE + one, GATE_CONFIDENCE + other], RATE, LIMIT))

    def choose(self, stage: int, candidates: list[Candidate], best: Candidate, total: int) -> Candidate:
        """Which candidate is right: asked one by one, the best first, `total` being the sum of the weights."""
        left = list(candidates)
        asked = best
        for rank in range(MOST_QUESTIONS):
            if len(left) == 1:
                return left[0]
            if self._is_right(stage, rank, asked, len(left), total):
                return asked
            total -= asked.weight
            left = [candidate for candidate in left if candidate is not asked]
            asked = max(left, key=lambda candidate: candidate.weight)
        place = self.decoder.raw_bits((len(left) - 1).bit_length())
        if place >= len(left):
            raise MapConnError("a face names a candidate that is not in the list; the stream is damaged")
        return left[place]

    def _is_right(self, stage: int, rank: int, asked: Candidate, left: int, total: int) -> bool:
        odds = (total << 8) // asked.weight - 256 if asked.weight > 0 else WORST_ODDS
        odds_class = min(23, max(0, (min(odds, WORST_ODDS) ** 2).bit_length() - 3))
        turn = min(rank, 3)
        one = ((stage * 24 + odds_class) * 4 + turn) * 2 + (left > 2)
        other = asked.kind * 12 + asked.corner
        other = ((other * 4 + turn) * 4 + min(left - 2, 3)) * 6 + (odds_class >> 2)
        return bool(self._neurons.bit(self.decoder, stage * 4 + turn, [ODDS + one, KIND + other], RATE, LIMIT))
