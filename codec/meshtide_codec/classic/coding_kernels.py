"""Kernels that code what a classic level adds: child counts (the map), Diffs, and the coarsest level's cells.

Each walks its array once and codes every value with adaptive contexts; in decoding the values read are written into
the array. A negative result tells that the payload holds a value that no encoder writes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy.model_kernels import SIGNED_CONTEXTS, UNSIGNED_CONTEXTS, code_signed, code_unsigned

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

OK = 0
BAD_VALUE = -1
SIZE_CLASSES = 6
MAP_CONTEXTS = 4 * UNSIGNED_CONTEXTS
DIFF_CONTEXTS = 3 * SIZE_CLASSES * SIGNED_CONTEXTS
CELL_CONTEXTS = UNSIGNED_CONTEXTS


@kernel
def code_child_counts(
    coder: Coder, buffer: Buffer, contexts: Contexts, counts: NDArray[np.int64], vertex_count: Integer
) -> Integer:
    """Code how many vertices each coarse vertex splits into; they add up to `vertex_count`.

    A count less one is coded in the context of the count before it (1, 2, 3, more).
    """
    before = 0
    left = vertex_count - len(counts)
    for i in range(len(counts)):
        extra = code_unsigned(coder, buffer, contexts, min(before, 3) * UNSIGNED_CONTEXTS, counts[i] - 1)
        if extra < 0 or extra > left:
            return BAD_VALUE
        left -= extra
        counts[i] = extra + 1
        before = extra
    return OK if left == 0 else BAD_VALUE


@kernel
def code_differences(coder: Coder, buffer: Buffer, contexts: Contexts, differences: NDArray[np.int64]) -> Integer:
    """Code Diffs (n, 3), each coordinate with its own contexts, chosen by the size of the two Diffs before it.

    No value depends on anything outside of this packet, so Diffs decode without each other.
    """
    size = 0
    for i in range(len(differences)):
        size_class = 0
        while size_class < SIZE_CLASSES - 1 and size >> (size_class + 1):
            size_class += 1
        total = 0
        for axis in range(3):
            base = (axis * SIZE_CLASSES + size_class) * SIGNED_CONTEXTS
            value = code_signed(coder, buffer, contexts, base, differences[i, axis])
            if value == -(1 << 31):
                return BAD_VALUE
            differences[i, axis] = value
            total += abs(value)
        size = (size + total) >> 1
    return OK


@kernel
def code_ascending(
    coder: Coder, buffer: Buffer, contexts: Contexts, codes: NDArray[np.int64], bits: Integer, end: Integer
) -> Integer:
    """Code strictly ascending integers in [0, end) by their gaps.

    A gap is coded in `bits`-wide halves, since an integer model takes at most 32 bits.
    """
    previous = -1
    for i in range(len(codes)):
        gap = codes[i] - previous - 1
        high = code_unsigned(coder, buffer, contexts, 0, gap >> bits)
        if high < 0 or high > (end >> bits):
            return BAD_VALUE
        low = code_unsigned(coder, buffer, contexts, CELL_CONTEXTS, gap & ((1 << bits) - 1))
        if low < 0 or low >= 1 << bits:
            return BAD_VALUE
        previous += (high << bits) + low + 1
        if previous >= end:
            return BAD_VALUE
        codes[i] = previous
    return OK
