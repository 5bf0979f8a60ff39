"""The decisions at gates and extra faces at effort high: each is mixed deeply from the candidate's properties.

As in `decision_kernels`, a choice is a row of questions 'is it this one?'. Every property of the candidate in question
is a context, together with how likely the scores call it; three more contexts look at the list as a whole.
Cost: O(PROPERTIES) for a question, O(MAXIMUM_QUESTIONS * candidates) for a choice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel
from meshtide_codec.connectivity.candidate_kernels import CLOSINGS, CORNERS, KINDS, STATES
from meshtide_codec.connectivity.decision_kernels import MAXIMUM_QUESTIONS, code_place, next_best
from meshtide_codec.connectivity.property_deep_kernels import PLACES, PROPERTIES
from meshtide_codec.entropy.deep_mixing_kernels import HEARD, code_deep_bit
from meshtide_codec.entropy.mixing_kernels import STRETCH, STRETCH_LIMIT

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates
    from meshtide_codec.connectivity.score_deep_kernels import Scores
    from meshtide_codec.entropy.deep_mixing_kernels import Inputs, Mixer
    from meshtide_codec.entropy.mixing_kernels import Opinions
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

RATE = 18  # weights learn by input * error / 2^18

SHARES = 32  # classes of a candidate's stretched share of the weights
_SHARE_SHIFT = 7
RIVALS = 16  # classes of the greatest other weight's share of the other weights
STAGES = 2
TURNS = 4
FAMILIES = 7

# Sections of the contexts: for each property, then three of questions, then three of gates.
QUESTION_CONTEXTS = 0
GATE_CONTEXTS = QUESTION_CONTEXTS + PLACES * 8
SHARE_CONTEXTS = GATE_CONTEXTS + PLACES
CORNER_CONTEXTS = SHARE_CONTEXTS + STAGES * SHARES * TURNS * 4
RIVAL_CONTEXTS = CORNER_CONTEXTS + KINDS * CORNERS * TURNS * 4 * (SHARES // 4)
GATE_FAMILY_CONTEXTS = RIVAL_CONTEXTS + SHARES * RIVALS * 4 * 2
GATE_DOUBT_CONTEXTS = GATE_FAMILY_CONTEXTS + FAMILIES * 3 * CLOSINGS * 4
GATE_CORNER_CONTEXTS = GATE_DOUBT_CONTEXTS + 6 * 4 * CLOSINGS * 2 * 2 * 3
CONTEXTS = GATE_CORNER_CONTEXTS + KINDS * CORNERS * 3 * FAMILIES

HEARD_CONTEXTS = PROPERTIES + 3
NUMBERS = HEARD * HEARD_CONTEXTS  # where the plain numbers begin: the stretched share, and a constant
INPUTS = NUMBERS + 2
CONSTANT = 256

# Four sets of neurons, each with its neurons of questions before those of gates.
TURN_NEURONS = 0
TURN_GATE_NEURONS = TURN_NEURONS + STAGES * TURNS * 4
CORNER_NEURONS = TURN_GATE_NEURONS + 4
CORNER_GATE_NEURONS = CORNER_NEURONS + KINDS * CORNERS
SHARE_NEURONS = CORNER_GATE_NEURONS + 2 * FAMILIES
SHARE_GATE_NEURONS = SHARE_NEURONS + SHARES
RIVAL_NEURONS = SHARE_GATE_NEURONS + SHARES
RIVAL_GATE_NEURONS = RIVAL_NEURONS + RIVALS * 2
NEURONS = RIVAL_GATE_NEURONS + CLOSINGS * 3
CHOSEN_NEURONS = 4

GATE_FINALS = STAGES * TURNS
FINALS = GATE_FINALS + 2
GATE_CORRECTIONS = STAGES * TURNS
CORRECTIONS = GATE_CORRECTIONS + 4


class Questions(NamedTuple):
    """What the coder expects, and room for one decision.

    Attributes:
        mixer: contexts (2 * CONTEXTS), weights (NEURONS * INPUTS), final weights (FINALS * CHOSEN_NEURONS),
            corrections of CORRECTIONS classes; all int32.
        places: (HEARD_CONTEXTS,) int64, contexts of the decision.
        signs: (HEARD_CONTEXTS,) int64, all 1.
        inputs: (INPUTS,) int32.
        neurons: (CHOSEN_NEURONS,) int64.
        outputs: (CHOSEN_NEURONS,) int32.
    """

    mixer: Mixer
    places: Opinions
    signs: Opinions
    inputs: Inputs
    neurons: Opinions
    outputs: NDArray[np.int32]


@borrowing_kernel
def _code(coder: Coder, buffer: Buffer, questions: Questions, final: int, correction: int, bit: int) -> int:
    return code_deep_bit(
        coder,
        buffer,
        questions.mixer,
        questions.neurons,
        final,
        correction,
        questions.places,
        questions.signs,
        questions.inputs,
        questions.outputs,
        RATE,
        bit,
    )


@inlined_kernel
def _stretched_share(weight: int, total: int) -> int:
    """The stretched probability that a weight is, in proportion to the sum of all."""
    return int(STRETCH[min((weight << 12) // total, 4095)])


@borrowing_kernel
def code_choice_deeply(
    coder: Coder,
    buffer: Buffer,
    questions: Questions,
    table: Scores,
    stage: int,
    candidates: Candidates,
    count: int,
    best: int,
    total: int,
) -> int:
    """Code which candidate is right, as `decision_kernels.code_choice` does, whose arguments these are."""
    weight = candidates.weight
    row = best
    rank = 0
    remaining = count
    while remaining > 1:
        if rank == MAXIMUM_QUESTIONS:
            return code_place(coder, buffer, candidates, count, remaining)
        turn = min(rank, TURNS - 1)
        _ask_for(questions, table, candidates, count, row, (stage, turn, min(remaining - 2, 3)), total)
        right = 1 if candidates.right[row] >= 0 else 0
        final = stage * TURNS + turn
        if _code(coder, buffer, questions, final, final, right):
            return row
        total -= weight[row]
        weight[row] = -1 - weight[row]
        remaining -= 1
        rank += 1
        row = next_best(weight, count)
    return row


@borrowing_kernel
def _ask_for(
    questions: Questions,
    table: Scores,
    candidates: Candidates,
    count: int,
    row: int,
    state: tuple[int, int, int],
    total: int,
) -> None:
    """Set the contexts and neurons of the question for a candidate; `state` is stage, turn and how many are left."""
    stage, turn, left = state
    weight = candidates.weight
    rival = 0
    for other in range(count):
        if other != row and weight[other] > rival:
            rival = int(weight[other])
    stretched = _stretched_share(int(weight[row]), total)
    share = (stretched + STRETCH_LIMIT + 1) >> _SHARE_SHIFT
    rivalry = min((rival << 4) // (total - int(weight[row])), RIVALS - 1)
    again = 1 if turn > 0 else 0
    corner = int(candidates.kind[row]) * CORNERS + int(candidates.corner[row])
    places = questions.places
    for index in range(PROPERTIES):
        places[index] = QUESTION_CONTEXTS + (int(table.properties[row, index]) * 2 + again) * 4 + (share >> 3)
    places[PROPERTIES] = SHARE_CONTEXTS + ((stage * SHARES + share) * TURNS + turn) * 4 + left
    places[PROPERTIES + 1] = CORNER_CONTEXTS + ((corner * TURNS + turn) * 4 + left) * (SHARES // 4) + (share >> 2)
    places[PROPERTIES + 2] = RIVAL_CONTEXTS + ((share * RIVALS + rivalry) * 4 + left) * 2 + again
    questions.inputs[NUMBERS] = stretched
    questions.inputs[NUMBERS + 1] = CONSTANT
    neurons = questions.neurons
    neurons[0] = TURN_NEURONS + (stage * TURNS + turn) * 4 + left
    neurons[1] = CORNER_NEURONS + corner
    neurons[2] = SHARE_NEURONS + share
    neurons[3] = RIVAL_NEURONS + rivalry * 2 + again


@borrowing_kernel
def code_gate_has_face_deeply(
    coder: Coder,
    buffer: Buffer,
    questions: Questions,
    table: Scores,
    surroundings: tuple[bool, int, int, int],
    candidates: Candidates,
    count: int,
    best: int,
    total: int,
    has_face: int,
) -> int:
    """Code whether one of the candidates completes a face, as `decision_kernels.code_gate_has_face` does."""
    is_shared, below, uncovered, at_border = surroundings
    shared = 1 if is_shared else 0
    family = 0 if is_shared else 1 + min(below, 2) * 2 + (1 if uncovered else 0)
    closed = int(candidates.corner[best]) // STATES
    blocked = 1 if closed == CLOSINGS - 1 else 0
    corner = int(candidates.kind[best]) * CORNERS + int(candidates.corner[best])
    stretched = _stretched_share(int(candidates.weight[best]), total)
    share = (stretched + STRETCH_LIMIT + 1) >> _SHARE_SHIFT
    places = questions.places
    for index in range(PROPERTIES):
        places[index] = GATE_CONTEXTS + int(table.properties[best, index])
    place = ((family * 3 + at_border) * CLOSINGS + closed) * 4 + min(count - 1, 3)
    places[PROPERTIES] = GATE_FAMILY_CONTEXTS + place
    place = ((min(count - 1, 5) * 4 + (share >> 3)) * CLOSINGS + closed) * 2 + shared
    places[PROPERTIES + 1] = GATE_DOUBT_CONTEXTS + (place * 2 + min(uncovered, 1)) * 3 + at_border
    places[PROPERTIES + 2] = GATE_CORNER_CONTEXTS + (corner * 3 + at_border) * FAMILIES + family
    questions.inputs[NUMBERS] = stretched
    questions.inputs[NUMBERS + 1] = CONSTANT
    neurons = questions.neurons
    state = 3 if blocked else at_border
    neurons[0] = TURN_GATE_NEURONS + state
    neurons[1] = CORNER_GATE_NEURONS + blocked * FAMILIES + family
    neurons[2] = SHARE_GATE_NEURONS + share
    neurons[3] = RIVAL_GATE_NEURONS + closed * 3 + at_border
    return _code(coder, buffer, questions, GATE_FINALS + blocked, GATE_CORRECTIONS + state, has_face)
