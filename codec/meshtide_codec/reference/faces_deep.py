"""Scores and questions where faces are coded deeply (docs/format.md, sections 9.9 and 9.10)."""

from __future__ import annotations

from decimal import Context
from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.faces_choices import MOST_QUESTIONS, Choices
from meshtide_codec.reference.faces_properties import PLACES, Properties
from meshtide_codec.reference.mixing import STRETCH

if TYPE_CHECKING:
    from meshtide_codec.reference.deep_mixing import DeepNeurons
    from meshtide_codec.reference.faces_candidates import Candidate
    from meshtide_codec.reference.faces_coarse import CoarseMesh
    from meshtide_codec.reference.faces_mesh import FineMesh, Marks
    from meshtide_codec.reference.faces_shapes import Shapes
    from meshtide_codec.reference.mixing import Neurons
    from meshtide_codec.reference.range_decoder import RangeDecoder

FULL_WEIGHT = 1 << 20
WAITS = tuple(FULL_WEIGHT * share // 64 for share in (65, 66, 68, 72, 80, 100, 130, 200))
RATES = [655 + 157280 // (16 + seen) for seen in range(256)]
LARGEST_SCORE = 1 << 24

# Where each block of contexts begins.
GATE = 8 * PLACES
SHARE = GATE + PLACES
CORNER = SHARE + 2 * 32 * 4 * 4
RIVAL = CORNER + 72 * 4 * 4 * 8
GATE_FAMILY = RIVAL + 32 * 16 * 4 * 2
GATE_DOUBT = GATE_FAMILY + 7 * 3 * 4 * 4
GATE_CORNER = GATE_DOUBT + 6 * 4 * 4 * 2 * 2 * 3
CONTEXTS = GATE_CORNER + 72 * 3 * 7
INPUTS = 4 * 22 + 2
# And each block of neurons.
BY_TURN, BY_GATE, BY_CORNER, BY_FAMILY, BY_SHARE, BY_GATE_SHARE, BY_RIVAL, BY_CLOSED = (
    0, 32, 36, 108, 122, 154, 186, 218,
)  # fmt: skip


def _weights() -> list[int]:
    """2^20 exp(-i / 64), rounded, at least 1."""
    context = Context(prec=20)
    exact = [context.multiply(FULL_WEIGHT, context.exp(context.divide(-i, 64))) for i in range(1024)]
    return [max(1, int(weight.to_integral_value())) for weight in exact]


WEIGHTS = _weights()


class DeepScores:
    """The scores of a stream.

    Args:
        scores: of the properties' places.
        counts: how often each has moved.
    """

    def __init__(self, scores: list[int], counts: list[int]) -> None:
        self._scores = list(scores)
        self._counts = list(counts)

    def weigh(self, candidates: list[Candidate], properties: Properties) -> tuple[Candidate, int]:
        """Set the weights of one or more candidates at a gate; returns the best one and the sum of the weights."""
        for candidate in candidates:
            candidate.places = properties.places(candidate)
        sums = [sum(self._scores[place] for place in candidate.places) for candidate in candidates]
        highest = max(sums)
        for candidate, score in zip(candidates, sums, strict=True):
            candidate.weight = WEIGHTS[min((highest - score) >> 10, 1023)]
        return candidates[sums.index(highest)], sum(candidate.weight for candidate in candidates)

    def learn(self, candidates: list[Candidate], chosen: Candidate, total: int) -> None:
        """Move the scores towards the candidate that was chosen."""
        if len(candidates) == 1:
            return
        for candidate in candidates:
            error = (65536 if candidate is chosen else 0) - (candidate.weight << 16) // total
            if abs(error) < 16:
                continue
            for place in candidate.places:
                moved = self._scores[place] + ((error * RATES[self._counts[place]] + 32768) >> 16)
                self._scores[place] = min(max(moved, -LARGEST_SCORE), LARGEST_SCORE)
                self._counts[place] = min(self._counts[place] + 1, 255)


class LevelScores:
    """The scores as the traversal of one level asks for them, like `faces_scores.Scores`.

    Args:
        scores: of the stream.
        coarse: the coarse mesh.
        fine: the fine mesh so far.
        shapes: its positions.
    """

    waits = WAITS

    def __init__(self, scores: DeepScores, coarse: CoarseMesh, fine: FineMesh, shapes: Shapes) -> None:
        self._scores = scores
        self._coarse = coarse
        self._fine = fine
        self._shapes = shapes

    def weigh(self, candidates: list[Candidate], ends: tuple[int, int, int], marks: Marks) -> tuple[Candidate, int]:
        """See `DeepScores.weigh`."""
        properties = Properties(self._coarse, self._fine, self._shapes, ends, marks, candidates)
        return self._scores.weigh(candidates, properties)

    def learn(self, candidates: list[Candidate], _ends: tuple[int, int, int], chosen: Candidate, total: int) -> None:
        """See `DeepScores.learn`."""
        self._scores.learn(candidates, chosen, total)


class DeepChoices(Choices):
    """Reads decisions from one payload, those at gates and extra faces with the stream's deep neurons."""

    def __init__(self, decoder: RangeDecoder, neurons: Neurons, deep: DeepNeurons) -> None:
        super().__init__(decoder, neurons)
        self._deep = deep

    def gate_has_face(
        self, family: tuple[bool, int, int], at_border: int, candidates: list[Candidate], best: Candidate, total: int
    ) -> bool:
        """Whether one of the candidates is the apex of a face at a gate; see `Choices.gate_has_face`."""
        shared, below, uncovered = family
        count, closed = len(candidates), best.corner // 3
        blocked = closed == 3
        relation = 0 if shared else 1 + min(below, 2) * 2 + (uncovered > 0)
        corner = best.kind * 12 + best.corner
        stretched = STRETCH[min((best.weight << 12) // total, 4095)]
        share = (stretched + 2048) >> 7
        doubt = ((min(count - 1, 5) * 4 + (share >> 3)) * 4 + closed) * 2 + shared
        heard = [GATE + place for place in best.places]
        heard += [
            GATE_FAMILY + ((relation * 3 + at_border) * 4 + closed) * 4 + min(count - 1, 3),
            GATE_DOUBT + (doubt * 2 + min(uncovered, 1)) * 3 + at_border,
            GATE_CORNER + (corner * 3 + at_border) * 7 + relation,
        ]
        state = 3 if blocked else at_border
        chosen = (
            BY_GATE + state,
            BY_FAMILY + 7 * blocked + relation,
            BY_GATE_SHARE + share,
            BY_CLOSED + closed * 3 + at_border,
        )
        return self._bit(chosen, 8 + blocked, 8 + state, heard, stretched)

    def choose(self, stage: int, candidates: list[Candidate], best: Candidate, total: int) -> Candidate:
        """Which candidate is right; see `Choices.choose`. Only corners are asked for as there."""
        if not best.places:
            return super().choose(stage, candidates, best, total)
        left = list(candidates)
        asked = best
        for rank in range(MOST_QUESTIONS):
            if len(left) == 1:
                return left[0]
            if self._is_apex(stage, min(rank, 3), asked, left, total):
                return asked
            total -= asked.weight
            left = [candidate for candidate in left if candidate is not asked]
            asked = max(left, key=lambda candidate: candidate.weight)
        place = self.decoder.raw_bits((len(left) - 1).bit_length())
        if place >= len(left):
            raise MapConnError("a face names a candidate that is not in the list; the stream is damaged")
        return left[place]

    def _is_apex(self, stage: int, turn: int, asked: Candidate, left: list[Candidate], total: int) -> bool:
        stretched = STRETCH[min((asked.weight << 12) // total, 4095)]
        share = (stretched + 2048) >> 7
        rival = max(candidate.weight for candidate in left if candidate is not asked)
        rivalry = min((rival << 4) // (total - asked.weight), 15)
        again, remaining = turn > 0, min(len(left) - 2, 3)
        corner = asked.kind * 12 + asked.corner
        heard = [(place * 2 + again) * 4 + (share >> 3) for place in asked.places]
        heard += [
            SHARE + ((stage * 32 + share) * 4 + turn) * 4 + remaining,
            CORNER + ((corner * 4 + turn) * 4 + remaining) * 8 + (share >> 2),
            RIVAL + ((share * 16 + rivalry) * 4 + remaining) * 2 + again,
        ]
        final = stage * 4 + turn
        chosen = (
            BY_TURN + final * 4 + remaining,
            BY_CORNER + corner,
            BY_SHARE + share,
            BY_RIVAL + rivalry * 2 + again,
        )
        return self._bit(chosen, final, final, heard, stretched)

    def _bit(self, chosen: tuple[int, ...], final: int, correction: int, heard: list[int], stretched: int) -> bool:
        places = [(place, 1) for place in heard]
        return bool(self._deep.bit(self.decoder, chosen, final, correction, places, (stretched, 256)))
