"""One decision coded with the joint opinion of two adaptive contexts.

The two opinions are added in the logistic domain, where certainty counts for more than doubt; their weights learn
(M. Mahoney, "Adaptive weighing of context models for lossless data compression", 2005).
Cost: O(1) per decision.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import inlined_kernel
from meshtide_codec.entropy.mixing_kernels import (
    SQUASH,
    STRETCH_LIMIT,
    WEIGHT_BITS,
    WEIGHT_ONE,
    hear,
    shift_weight,
    teach,
)
from meshtide_codec.entropy.model_kernels import COUNT_LIMIT
from meshtide_codec.entropy.range_coder_kernels import code_bit

if TYPE_CHECKING:
    from meshtide_codec.entropy.mixing_kernels import Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

FIRST_WEIGHT = WEIGHT_ONE * 9 // 16  # of each context: a little over one half, since agreement is worth more
WEIGHT_RATE = 17  # each weight moves by opinion * error / 2^17


@inlined_kernel
def code_paired_bit(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    pair: int,
    one: int,
    other: int,
    bit: int,
) -> int:
    """Code one decision with the contexts at `one` and `other`; they and the weights of the pair learn from it."""
    first = hear(contexts, one, 1)
    second = hear(contexts, other, 1)
    opinion = (weights[2 * pair] * first + weights[2 * pair + 1] * second) >> WEIGHT_BITS
    opinion = min(max(opinion, -STRETCH_LIMIT), STRETCH_LIMIT)
    probability = int(SQUASH[opinion + STRETCH_LIMIT + 1])
    bit = code_bit(coder, buffer, probability, bit)
    error = (bit << 16) - probability
    shift_weight(weights, 2 * pair, first, error, WEIGHT_RATE)
    shift_weight(weights, 2 * pair + 1, second, error, WEIGHT_RATE)
    teach(contexts, one, 1, COUNT_LIMIT, bit)
    teach(contexts, other, 1, COUNT_LIMIT, bit)
    return bit
