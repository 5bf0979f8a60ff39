"""Kernel that codes a permutation by the steps from each entry to the next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy.model_kernels import code_signed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

OK = 0
BAD_VALUE = -1


@kernel
def code_steps(coder: Coder, buffer: Buffer, contexts: Contexts, values: NDArray[np.int64], end: Integer) -> Integer:
    """Code integers in [0, end), each by its difference from one more than the one before."""
    expected = 0
    for i in range(len(values)):
        value = expected + code_signed(coder, buffer, contexts, 0, values[i] - expected)
        if value < 0 or value >= end:
            return BAD_VALUE
        values[i] = value
        expected = value + 1
    return OK
