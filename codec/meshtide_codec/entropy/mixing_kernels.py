"""Logistic mixing: several contexts each give their opinion of a decision, and a small neuron weighs them.

Probabilities are moved to the logistic domain (stretch), summed with weights, moved back (squash); after the decision
each weight moves by its input times the error. After M. Mahoney, "Adaptive weighing of context models for lossless
data compression", 2005 (PAQ6), with integers throughout. Cost: O(inputs) per decision.

A context may speak about the opposite of the decision (mirrored statistics share one context): its sign is -1 then.
Probabilities are 16-bit fractions; a stretched probability is 256 ln(p / (1 - p)), a weight of 1 is WEIGHT_ONE.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import inlined_kernel
from meshtide_codec.entropy.model_kernels import ADAPTATION_RATES
from meshtide_codec.entropy.range_coder_kernels import PROBABILITY_MAXIMUM, PROBABILITY_MINIMUM, code_bit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Weights = NDArray[np.int32]
    Opinions = NDArray[np.int64]

INPUTS = 6
WEIGHT_BITS = 14
WEIGHT_ONE = 1 << WEIGHT_BITS
WEIGHT_LIMIT = 8 * WEIGHT_ONE  # weights are kept within +-8

STRETCH_LIMIT = 2047  # stretched values stay within +-2047, that is +-8 natural logarithms
_UNIT_BITS = 128
_DECAY = 0xFF801FFAAB554445B04105B043E8F48D  # floor(2^128 exp(-1/512)), the only constant the tables are made of


def _decays(count: int) -> list[int]:
    """floor-like 2^128 exp(-k/512) for k in range(count), by repeated multiplication of integers."""
    decays = [1 << _UNIT_BITS]
    while len(decays) < count:
        decays.append(decays[-1] * _DECAY >> _UNIT_BITS)
    return decays


def squash_table() -> NDArray[np.int32]:
    """(4096,) probabilities 65536 / (1 + exp(-z / 256)) for z = index - 2048, clamped to what the coder codes.

    >>> squash_table()[[0, 2048, 2048 + 256, 4095]].tolist()
    [48, 32768, 47910, 65488]
    """
    decays = _decays(2 * (STRETCH_LIMIT + 1) + 1)
    one = 1 << _UNIT_BITS
    table = np.zeros(2 * (STRETCH_LIMIT + 1), np.int32)
    for index in range(len(table)):
        decay = decays[2 * abs(index - STRETCH_LIMIT - 1)]
        numerator = one if index > STRETCH_LIMIT else decay
        table[index] = (numerator << 16) // (one + decay)
    return np.clip(table, PROBABILITY_MINIMUM, PROBABILITY_MAXIMUM)


def stretch_table() -> NDArray[np.int32]:
    """(4096,) stretched probabilities round(256 ln(p / (1 - p))) for p = (index + 1/2) / 4096, clamped to +-2047.

    >>> stretch_table()[[0, 2047, 2048, 3072, 4095]].tolist()
    [-2047, 0, 0, 281, 2047]
    """
    decays = _decays(2 * (STRETCH_LIMIT + 1) + 2)
    table = np.zeros(4096, np.int32)
    place = 0
    for index in range(2048, 4096):  # p >= 1/2: find k with exp(-(k + 1/2) / 256) < (1 - p) / p
        others = 8191 - 2 * index
        while place < STRETCH_LIMIT and decays[2 * place + 1] * (2 * index + 1) > others << _UNIT_BITS:
            place += 1
        table[index] = place
        table[4095 - index] = -place
    return table


STRETCH = stretch_table()
SQUASH = squash_table()


def new_weights(neurons: int, total: float) -> Weights:
    """Equal weights that sum to `total` for each of the neurons, as one flat int32 array."""
    return np.full(neurons * INPUTS, int(WEIGHT_ONE * total / INPUTS), np.int32)


@inlined_kernel
def hear(contexts: Contexts, place: int, sign: int) -> int:
    """The stretched probability of a one by the context at `place`, or of a zero when `sign` is -1."""
    return int(STRETCH[np.uintp(contexts[np.uintp(place)] >> 12)]) * sign


@inlined_kernel
def teach(contexts: Contexts, place: int, sign: int, limit: int, bit: int) -> None:
    """Let the context at `place` learn the decision; its count is capped at `limit`."""
    context = int(contexts[np.uintp(place)])
    count = context & 255
    probability = context >> 8
    target = 65535 if (bit == 1) == (sign > 0) else 0
    probability += ((target - probability) * ADAPTATION_RATES[np.uintp(count)]) >> 16
    contexts[np.uintp(place)] = (probability << 8) | min(count + 1, limit)


@inlined_kernel
def shift_weight(weights: Weights, place: int, stretched: int, error: int, rate: int) -> None:
    """Move a weight by its input times the error, in steps shifted right by `rate`."""
    weight = weights[np.uintp(place)] + ((stretched * error + (1 << (rate - 1))) >> rate)
    weights[np.uintp(place)] = min(max(weight, -WEIGHT_LIMIT), WEIGHT_LIMIT)


@inlined_kernel
def code_mixed_bit(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    neuron: int,
    places: Opinions,
    signs: Opinions,
    rate: int,
    limit: int,
    bit: int,
) -> int:
    """Code one decision by mixing INPUTS contexts with a neuron; contexts and weights learn from it.

    `places` and `signs` hold each input's index into `contexts` and its sign (+1, -1); `neuron` counts in groups of
    INPUTS weights. `rate` slows the weights' learning; `limit` caps the contexts' counts (at most COUNT_LIMIT).
    Written out for each input: this is the innermost loop of the whole codec.
    """
    place_0, place_1, place_2 = places[0], places[1], places[2]
    place_3, place_4, place_5 = places[3], places[4], places[5]
    sign_0, sign_1, sign_2 = signs[0], signs[1], signs[2]
    sign_3, sign_4, sign_5 = signs[3], signs[4], signs[5]
    opinion_0 = hear(contexts, place_0, sign_0)
    opinion_1 = hear(contexts, place_1, sign_1)
    opinion_2 = hear(contexts, place_2, sign_2)
    opinion_3 = hear(contexts, place_3, sign_3)
    opinion_4 = hear(contexts, place_4, sign_4)
    opinion_5 = hear(contexts, place_5, sign_5)
    first = neuron * INPUTS
    total = weights[np.uintp(first)] * opinion_0
    total += weights[np.uintp(first + 1)] * opinion_1
    total += weights[np.uintp(first + 2)] * opinion_2
    total += weights[np.uintp(first + 3)] * opinion_3
    total += weights[np.uintp(first + 4)] * opinion_4
    total += weights[np.uintp(first + 5)] * opinion_5
    total = min(max(total >> WEIGHT_BITS, -STRETCH_LIMIT), STRETCH_LIMIT)
    probability = int(SQUASH[np.uintp(total + STRETCH_LIMIT + 1)])
    bit = code_bit(coder, buffer, probability, bit)
    error = (bit << 16) - probability
    shift_weight(weights, first, opinion_0, error, rate)
    shift_weight(weights, first + 1, opinion_1, error, rate)
    shift_weight(weights, first + 2, opinion_2, error, rate)
    shift_weight(weights, first + 3, opinion_3, error, rate)
    shift_weight(weights, first + 4, opinion_4, error, rate)
    shift_weight(weights, first + 5, opinion_5, error, rate)
    teach(contexts, place_0, sign_0, limit, bit)
    teach(contexts, place_1, sign_1, limit, bit)
    teach(contexts, place_2, sign_2, limit, bit)
    teach(contexts, place_3, sign_3, limit, bit)
    teach(contexts, place_4, sign_4, limit, bit)
    teach(contexts, place_5, sign_5, limit, bit)
    return bit
