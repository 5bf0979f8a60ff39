"""How likely each candidate is: sums of trained scores that go on learning (docs/format.md, section 9.4)."""

from __future__ import annotations

from decimal import Context
from typing import TYPE_CHECKING

from meshtide_codec.reference.faces_mesh import CLOSES_FIRST, CLOSES_SECOND
from meshtide_codec.reference.faces_shapes import angle_class, bend_class, length_class, short_length

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_candidates import Candidate
    from meshtide_codec.reference.faces_mesh import FineMesh, Marks
    from meshtide_codec.reference.faces_shapes import Shapes

# Where the scores of each property begin.
KIND = 0
VALENCE = KIND + 6 * 12
ENDS = VALENCE + 8 * 4 * 12
LENGTH = ENDS + 16 * 16
SHORT_LENGTH = LENGTH + 6 * 16 * 32
ANGLE_SUM = SHORT_LENGTH + 16 * 16 * 16
BEND = ANGLE_SUM + 12 * 32

FULL_WEIGHT = 4096
MOST_FACES = 7
LEARNING_RATE = 12


def _weights() -> list[int]:
    """4096 exp(-i / 64), rounded."""
    context = Context(prec=20)
    exact = [context.multiply(FULL_WEIGHT, context.exp(context.divide(-i, 64))) for i in range(1024)]
    return [int(weight.to_integral_value()) for weight in exact]


WEIGHTS = _weights()


class Scores:
    """The scores of one level's traversal.

    Args:
        scores: as trained.
        fine: the fine mesh, whose `shapes` are None without positions.

    Attributes:
        waits: for each pass over the gates but the last, the sum of weights beyond which a gate waits.
    """

    waits: tuple[int, ...] = (10240,)

    def __init__(self, scores: list[int], fine: FineMesh) -> None:
        self._scores = scores
        self._fine = fine

    def weigh(self, candidates: list[Candidate], ends: tuple[int, int, int], _marks: Marks) -> tuple[Candidate, int]:
        """Set the weights of one or more candidates at a gate; returns the best one and the sum of the weights."""
        if len(candidates) == 1:
            candidates[0].weight = FULL_WEIGHT
            return candidates[0], FULL_WEIGHT
        sums = [sum(self._scores[place] for place in self._places(candidate, ends)) for candidate in candidates]
        highest = max(sums)
        for candidate, score in zip(candidates, sums, strict=True):
            candidate.weight = WEIGHTS[min((highest - score) >> 2, 1023)]
        return candidates[sums.index(highest)], sum(candidate.weight for candidate in candidates)

    def learn(self, candidates: list[Candidate], ends: tuple[int, int, int], chosen: Candidate, total: int) -> None:
        """Move the scores towards the candidate that was chosen, unless it had seven eighths of all weight."""
        if chosen.weight * 8 >= total * 7:
            return
        for candidate in candidates:
            error = (total if candidate is chosen else 0) - candidate.weight
            change = (LEARNING_RATE * ((error << 6) // total) + 32) >> 6
            for place in self._places(candidate, ends):
                self._scores[place] += change

    def _places(self, candidate: Candidate, ends: tuple[int, int, int]) -> list[int]:
        """Where the scores of a candidate's properties stand."""
        fine = self._fine
        first, second, _ = ends
        faces, at_first, at_second = (
            min(len(fine.leaving[vertex]), MOST_FACES) for vertex in (candidate.vertex, first, second)
        )
        open_pairs = min(fine.open_edges[candidate.vertex] >> 1, 3)
        at_first += 8 * bool(candidate.flags & CLOSES_FIRST)
        at_second += 8 * bool(candidate.flags & CLOSES_SECOND)
        places = [
            KIND + candidate.kind * 12 + candidate.corner,
            VALENCE + (faces * 4 + open_pairs) * 12 + candidate.corner,
            ENDS + at_first * 16 + at_second,
        ]
        if fine.shapes is not None:
            places += self._shape_places(fine.shapes, candidate, ends)
        return places

    def _shape_places(self, shapes: Shapes, candidate: Candidate, ends: tuple[int, int, int]) -> list[int]:
        first, second, known = ends
        apex = candidate.vertex
        gate = shapes.squared(first, second)
        one, other = shapes.squared(first, apex), shapes.squared(second, apex)
        angle = angle_class(gate, one, other)
        length = length_class(shapes.squared(known, apex), gate)
        shorter, longer = sorted((short_length(one), short_length(other)))
        angle_sum = min(31, (self._fine.angles[apex] + angle) >> 1)
        bend = bend_class(shapes.normal(first, second, apex), shapes.normal(second, first, known))
        return [
            LENGTH + (candidate.kind * 16 + length) * 32 + angle,
            SHORT_LENGTH + (shorter * 16 + longer) * 16 + short_length(gate),
            ANGLE_SUM + candidate.corner * 32 + angle_sum,
            BEND + (candidate.corner * 32 + bend) * 8 + (angle >> 2),
        ]
