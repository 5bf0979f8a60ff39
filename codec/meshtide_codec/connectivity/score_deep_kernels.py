"""How likely each candidate is, where faces are coded deeply: as in `score_kernels`, with more and finer scores.

A score counts SCORE_ONE per nat. Every choice moves the scores of all candidates by what it had of surprise, those that
have moved seldom more than those that have moved often: a logistic regression by stochastic gradient descent.
Cost: O(candidates * PROPERTIES), beside the properties.
"""

from __future__ import annotations

from decimal import Context
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import borrowing_kernel
from meshtide_codec.connectivity.property_deep_kernels import PROPERTIES, measure_candidates

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.level_kernels import Level

SCORE_ONE = 1 << 16
SCORE_LIMIT = 1 << 24  # scores stay within +-256 nats
FULL_WEIGHT = 1 << 20  # weight of the best candidate
WEIGHT_STEPS = 64  # steps of the table of weights for each nat
_STEP_SHIFT = 10  # SCORE_ONE / WEIGHT_STEPS
LOWEST_STEP = 1023

COUNT_LIMIT = 255
NEGLIGIBLE = 16  # errors below this, in 65536ths, move nothing
RATES: NDArray[np.int64] = np.array([655 + 9830 * 16 // (16 + seen) for seen in range(COUNT_LIMIT + 1)], np.int64)
"""How far a score moves at a full surprise, by how often it has moved."""


def _weights() -> NDArray[np.int64]:
    """FULL_WEIGHT * exp(-i / WEIGHT_STEPS), rounded, at least 1; by `decimal`, so the same on every machine."""
    context = Context(prec=20)
    exact = [
        context.multiply(FULL_WEIGHT, context.exp(context.divide(-i, WEIGHT_STEPS))) for i in range(LOWEST_STEP + 1)
    ]
    return np.array([max(1, int(weight.to_integral_value())) for weight in exact], np.int64)


WEIGHTS = _weights()


class Scores(NamedTuple):
    """The scores, and room for what they are looked up by.

    Attributes:
        scores: (PLACES,) int32, of the properties.
        counts: (PLACES,) int32, how often each has moved, at most COUNT_LIMIT.
        properties: (CAPACITY, PROPERTIES) int32, places of the candidates that were weighed last.
    """

    scores: NDArray[np.int32]
    counts: NDArray[np.int32]
    properties: NDArray[np.int32]


@borrowing_kernel
def weigh_candidates(
    table: Scores, level: Level, count: int, first: int, second: int, known_apex: int
) -> tuple[int, int]:
    """Fill `level.candidates.weight`; returns the row of the best candidate and the sum of all weights."""
    candidates = level.candidates
    weight = candidates.weight
    measure_candidates(table.properties, candidates, count, level.coarse, level.fine, first, second, known_apex)
    best = 0
    for row in range(count):
        score = 0
        for index in range(PROPERTIES):
            score += int(table.scores[table.properties[row, index]])
        weight[row] = score
        if score > weight[best]:
            best = row
    highest = int(weight[best])
    total = 0
    for row in range(count):
        share = int(WEIGHTS[min((highest - int(weight[row])) >> _STEP_SHIFT, LOWEST_STEP)])
        weight[row] = share
        total += share
    return best, total


@borrowing_kernel
def learn_choice(table: Scores, level: Level, count: int, chosen: int, total: int) -> None:
    """Move the scores towards the candidate that was chosen among those weighed last.

    `total` is the sum of all weights before the choice; refused candidates have the weight -1 - (weight before).
    """
    if count == 1:
        return
    for row in range(count):
        share = int(level.candidates.weight[row])
        share = max(share, -1 - share)
        error = (65536 if row == chosen else 0) - (share << 16) // total
        if -NEGLIGIBLE < error < NEGLIGIBLE:
            continue
        for index in range(PROPERTIES):
            place = table.properties[row, index]
            seen = table.counts[place]
            moved = int(table.scores[place]) + ((error * RATES[seen] + 32768) >> 16)
            table.scores[place] = min(max(moved, -SCORE_LIMIT), SCORE_LIMIT)
            table.counts[place] = min(seen + 1, COUNT_LIMIT)
