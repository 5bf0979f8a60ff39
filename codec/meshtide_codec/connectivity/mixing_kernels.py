"""One decision coded with the joint opinion of two adaptive contexts.

The two opinions are added in the logistic domain, where certainty counts for more than doubt; their weights are fixed
(M. Mahoney, "Adaptive weighing of context models for lossless data compression", 2005, without the learning).
Cost: O(1) per decision.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import inlined_kernel
from meshtide_codec.entropy.mixing_kernels import SQUASH, STRETCH_LIMIT, hear, teach
from meshtide_codec.entropy.model_kernels import COUNT_LIMIT
from meshtide_codec.entropy.range_coder_kernels import code_bit

if TYPE_CHECKING:
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

OPINION_WEIGHT = 18  # of each context, in 1/32: a little over one half, since contexts that agree know more than each


@inlined_kernel
def code_paired_bit(coder: Coder, buffer: Buffer, contexts: Contexts, one: int, other: int, bit: int) -> int:
    """Code one decision with the contexts at `one` and `other`, and let both learn from it."""
    opinion = ((hear(contexts, one, 1) + hear(contexts, other, 1)) * OPINION_WEIGHT) >> 5
    opinion = min(max(opinion, -STRETCH_LIMIT), STRETCH_LIMIT)
    bit = code_bit(coder, buffer, int(SQUASH[opinion + STRETCH_LIMIT + 1]), bit)
    teach(contexts, one, 1, COUNT_LIMIT, bit)
    teach(contexts, other, 1, COUNT_LIMIT, bit)
    return bit
