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


def new_weights(count: int, inputs: int, total: float) -> Weights:
    """`count` neurons of `inputs` equal weights that sum to `total`, as one flat int32 array."""
    return np.full(count * inputs, int(WEIGHT_ONE * total / inputs), np.int32)


@inlined_kernel
def code_mixed_bit(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    first_weight: int,
    places: Opinions,
    signs: Opinions,
    stretched: Opinions,
    inputs: int,
    rate: int,
    limit: int,
    bit: int,
) -> int:
    """Code one decision by mixing `inputs` contexts; contexts and weights learn from it.

    `places` and `signs` hold each input's index into `contexts` and its sign (+1, -1); `first_weight` is the neuron's
    first weight; `stretched` is scratch of at least `inputs` elements. Weights move by steps shifted right by `rate`
    (larger learns slower); the contexts' counts are capped at `limit` (at most COUNT_LIMIT).
    """
    total = 0
    for opinion in range(inputs):
        value = STRETCH[contexts[places[opinion]] >> 12] * signs[opinion]
        stretched[opinion] = value
        total += weights[first_weight + opinion] * value
    total >>= WEIGHT_BITS
    total = min(max(total, -STRETCH_LIMIT), STRETCH_LIMIT)
    probability = int(SQUASH[total + STRETCH_LIMIT + 1])
    bit = code_bit(coder, buffer, probability, bit)
    error = (bit << 16) - probability
    for opinion in range(inputs):
        weight = weights[first_weight + opinion] + ((stretched[opinion] * error + (1 << (rate - 1))) >> rate)
        weights[first_weight + opinion] = min(max(weight, -WEIGHT_LIMIT), WEIGHT_LIMIT)
        context = int(contexts[places[opinion]])
        chance = context >> 8
        count = context & 255
        target = 65535 if (bit == 1) == (signs[opinion] > 0) else 0
        chance += ((target - chance) * ADAPTATION_RATES[count]) >> 16
        if count < limit:
            count += 1
        contexts[places[opinion]] = (chance << 8) | count
    return bit
