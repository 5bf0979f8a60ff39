"""The decisions that cost bits: does the gate have a face, which candidate is its apex.

A choice is coded as a row of questions 'is it this one?', best candidate first; the answer is expected with the
confidence of the score table, corrected by adaptive contexts. After MAXIMUM_QUESTIONS the place in the list is
written plainly, so the cost of a choice is O(MAXIMUM_QUESTIONS * candidates).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.candidate_kernels import CLOSINGS, CORNERS, KINDS
from meshtide_codec.connectivity.mixing_kernels import code_paired_bit
from meshtide_codec.connectivity.score_kernels import FULL_WEIGHT
from meshtide_codec.entropy.model_kernels import SIGNED_CONTEXTS
from meshtide_codec.entropy.range_coder_kernels import code_raw_bits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates
    from meshtide_codec.connectivity.half_edge_kernels import FineMesh
    from meshtide_codec.entropy.mixing_kernels import Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

# Who asks for a choice: each has contexts of its own.
AT_GATE = 0
AT_EXTRA_FACE = 1
AT_CORNER = 2
STAGES = 3

MAXIMUM_QUESTIONS = 24
NO_SUCH_CANDIDATE = -2  # status: the stream names a candidate that is not in the list

ODDS_CLASSES = 24
ODDS_LIMIT = 4096


def _odds_classes() -> NDArray[np.int64]:
    """Class of odds against a candidate, given in units of 1/256: two classes for each doubling."""
    classes = [min(ODDS_CLASSES - 1, max(0, (i**2).bit_length() - 3)) for i in range(ODDS_LIMIT + 1)]
    return np.array(classes, np.int64)


ODDS_CLASS = _odds_classes()

# Sections of the contexts.
ODDS_CONTEXTS = 0
KIND_CONTEXTS = ODDS_CONTEXTS + STAGES * ODDS_CLASSES * 4 * 2
GATE_CONTEXTS = KIND_CONTEXTS + KINDS * CORNERS * 4 * 4 * 6
GATE_CONFIDENCE_CONTEXTS = GATE_CONTEXTS + 7 * 3 * CLOSINGS * 4
EXTRA_CONTEXTS = GATE_CONFIDENCE_CONTEXTS + 6 * 4 * CLOSINGS * 2 * 2 * 3
EXTRA_DIRECTION_CONTEXTS = EXTRA_CONTEXTS + 2 * 6 * 3 * 3 * 2 * 2
LEFTOVER_CONTEXTS = EXTRA_DIRECTION_CONTEXTS + 2
LISTED_CONTEXTS = LEFTOVER_CONTEXTS + 4 * 2
OFFSET_CONTEXTS = LISTED_CONTEXTS + 2
CONTEXTS = OFFSET_CONTEXTS + SIGNED_CONTEXTS

# Pairs of weights: for each stage and the first ranks of a choice, then for gates.
GATE_PAIR = STAGES * 4
PAIRS = GATE_PAIR + 2


@inlined_kernel
def borders(fine: FineMesh, first: int, second: int) -> int:
    """How many of two vertices lie at a known border."""
    return int(fine.vertices[first, half_edges.AT_BORDER] + fine.vertices[second, half_edges.AT_BORDER])


@merged_kernel
def code_gate_has_face(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    surroundings: tuple[bool, int, int, int],
    count: int,
    closed: int,
    total: int,
    has_face: int,
) -> int:
    """Code whether one of `count` candidates completes a face at a gate.

    `surroundings` says whether both ends share their parent, how many coarse faces lie at the coarse edge, how many of
    those are not accounted for, and how many ends lie at a border; `closed` is what the best candidate closes, in
    [0, CLOSINGS), `total` the sum of the weights.
    """
    shared, below, uncovered, at_border = surroundings
    family = 0 if shared else 1 + min(below, 2) * 2 + (1 if uncovered else 0)
    one = ((family * 3 + at_border) * CLOSINGS + closed) * 4 + min(count - 1, 3)
    doubt = min(3, total // FULL_WEIGHT - 1)
    other = (min(count - 1, 5) * 4 + doubt) * CLOSINGS + closed
    other = ((other * 2 + (1 if shared else 0)) * 2 + min(uncovered, 1)) * 3 + at_border
    pair = GATE_PAIR + (1 if closed == CLOSINGS - 1 else 0)
    one += GATE_CONTEXTS
    other += GATE_CONFIDENCE_CONTEXTS
    return code_paired_bit(coder, buffer, contexts, weights, pair, one, other, has_face)


@merged_kernel
def code_choice(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    stage: int,
    candidates: Candidates,
    count: int,
    best: int,
    total: int,
) -> int:
    """Code which candidate is right (in an encoder: the first with `right` >= 0 in order of weight).

    Returns its row, or NO_SUCH_CANDIDATE.
    """
    weight = candidates.weight
    row = best
    rank = 0
    remaining = count
    while remaining > 1:
        if rank == MAXIMUM_QUESTIONS:
            return code_place(coder, buffer, candidates, count, remaining)
        odds = (total << 8) // weight[row] - 256 if weight[row] > 0 else ODDS_LIMIT
        odds_class = ODDS_CLASS[min(odds, ODDS_LIMIT)]
        place = min(rank, 3)
        one = ((stage * ODDS_CLASSES + odds_class) * 4 + place) * 2 + (1 if remaining > 2 else 0)
        other = int(candidates.kind[row]) * CORNERS + int(candidates.corner[row])
        other = ((other * 4 + place) * 4 + min(remaining - 2, 3)) * 6 + (odds_class >> 2)
        pair = stage * 4 + place
        one += ODDS_CONTEXTS
        other += KIND_CONTEXTS
        right = 1 if candidates.right[row] >= 0 else 0
        if code_paired_bit(coder, buffer, contexts, weights, pair, one, other, right):
            return row
        total -= weight[row]
        weight[row] = -1 - weight[row]
        remaining -= 1
        rank += 1
        row = next_best(weight, count)
    return row


@inlined_kernel
def next_best(weight: NDArray[np.int64], count: int) -> int:
    """The first row with the greatest weight."""
    best = 0
    for row in range(1, count):
        if weight[row] > weight[best]:
            best = row
    return best


@borrowing_kernel
def code_place(coder: Coder, buffer: Buffer, candidates: Candidates, count: int, remaining: int) -> int:
    """Code the place of the right candidate among those that are not refused yet."""
    bits = 0
    while (remaining - 1) >> bits:
        bits += 1
    place = 0
    for row in range(count):
        if candidates.weight[row] >= 0:
            if candidates.right[row] >= 0:
                break
            place += 1
    place = code_raw_bits(coder, buffer, bits, place)
    for row in range(count):
        if candidates.weight[row] >= 0:
            if place == 0:
                return row
            place -= 1
    return NO_SUCH_CANDIDATE
