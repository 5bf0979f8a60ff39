"""Adaptive models over the range coder: single binary contexts, and integers made of them.

A binary context counts what it has seen and moves its probability towards it by 1 / (count + 1.6), fast at first
and slowly later: a Krichevsky-Trofimov style estimator whose count is capped, so that it keeps forgetting.
Integers only. Cost: O(1) per decision, O(log value) per integer.

A context is one int32: probability of a one in its upper bits (16-bit fraction), count in the lowest 8.
Integers are coded by adaptive exponential Golomb codes: the length of value + 1 in unary, each step with its own
context, then its bits below the leading one, the uppermost two of them with contexts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import inlined_kernel, kernel
from meshtide_codec.entropy.range_coder_kernels import code_bit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Contexts = NDArray[np.int32]

COUNT_LIMIT = 200  # how much a context remembers; smaller adapts faster
EVEN_CHANCE = (1 << 15) << 8  # a fresh context

ADAPTATION_RATES: NDArray[np.int64] = np.array(
    [65536 * 10 // (10 * count + 16) for count in range(COUNT_LIMIT + 1)], np.int64
)
"""1 / (count + 1.6) as a 16-bit fraction."""

MAXIMUM_BITS = 32  # integers below 2^32 - 1
UNSIGNED_CONTEXTS = MAXIMUM_BITS + 3 * (MAXIMUM_BITS + 1)  # contexts that one unsigned integer model takes
SIGNED_CONTEXTS = UNSIGNED_CONTEXTS + 1
OUT_OF_RANGE = -1  # what a decoder returns for a length that no encoder writes


def new_contexts(count: int) -> Contexts:
    """`count` fresh binary contexts, each at even chances."""
    return np.full(count, EVEN_CHANCE, np.int32)


@inlined_kernel
def code_adaptive_bit(coder: Coder, buffer: Buffer, contexts: Contexts, index: Integer, bit: Integer) -> Integer:
    """Code one decision with the context at `index`, and let the context learn from it."""
    context = np.int64(contexts[index])
    probability = context >> 8
    count = context & 255
    bit = code_bit(coder, buffer, probability, bit)
    target = 65535 if bit else 0
    probability += ((target - probability) * ADAPTATION_RATES[count]) >> 16
    if count < COUNT_LIMIT:
        count += 1
    contexts[index] = (probability << 8) | count
    return bit


@kernel
def code_unsigned(coder: Coder, buffer: Buffer, contexts: Contexts, base: Integer, value: Integer) -> Integer:
    """Code an integer in [0, 2^32 - 2]; takes UNSIGNED_CONTEXTS contexts from `base` on.

    Returns the integer, or OUT_OF_RANGE when the decoder reads a length that no encoder writes.
    """
    shifted = value + 1
    length = 0
    if value >= 0:
        while shifted >> (length + 1):
            length += 1
    place = 0
    while code_adaptive_bit(coder, buffer, contexts, base + place, 1 if place < length else 0):
        place += 1
        if place >= MAXIMUM_BITS:
            return OUT_OF_RANGE
    length = place
    result = 1
    tree = base + MAXIMUM_BITS + 3 * length
    for place in range(length - 1, -1, -1):
        bit = (shifted >> place) & 1
        below = length - 1 - place
        if below == 0:
            bit = code_adaptive_bit(coder, buffer, contexts, tree, bit)
        elif below == 1:
            bit = code_adaptive_bit(coder, buffer, contexts, tree + 1 + (result & 1), bit)
        else:
            bit = code_bit(coder, buffer, 1 << 15, bit)
        result = (result << 1) | bit
    return result - 1


@kernel
def code_signed(coder: Coder, buffer: Buffer, contexts: Contexts, base: Integer, value: Integer) -> Integer:
    """Code an integer in (-2^31, 2^31): magnitude first, then its sign; takes SIGNED_CONTEXTS contexts.

    A decoder that reads a magnitude out of range returns -2^31, which no encoder writes.
    """
    magnitude = code_unsigned(coder, buffer, contexts, base, abs(value))
    if magnitude < 0 or magnitude >= 1 << 31:
        return -(1 << 31)
    if magnitude == 0:
        return 0
    negative = code_adaptive_bit(coder, buffer, contexts, base + UNSIGNED_CONTEXTS, 1 if value < 0 else 0)
    return -magnitude if negative else magnitude
