"""Tables that turn measured quantities into small classes for contexts: made of integers by integers.

A value is looked up as floor(32 |value|), capped at the table's end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEPS = 32  # table entries per unit
SATURATING_ENTRIES = 512
LOGARITHM_ENTRIES = 2048


def saturating_classes(classes: int, twice_knee: int) -> NDArray[np.int64]:
    """Classes floor(classes * v / (v + knee)): fine near 0, one last class for everything large.

    >>> saturating_classes(8, 2)[[0, 8, 32, 511]].tolist()
    [0, 1, 4, 7]
    """
    index = np.arange(SATURATING_ENTRIES, dtype=np.int64)
    table: NDArray[np.int64] = np.minimum(2 * classes * index // (2 * index + STEPS * twice_knee), classes - 1)
    return table


def half_octave_classes(classes: int, offset: int) -> NDArray[np.int64]:
    """Classes floor(2 log2(v + 1/50)) + offset, kept within [0, classes).

    >>> half_octave_classes(24, 12)[[0, 1, 8, 32, 2047]].tolist()
    [0, 3, 8, 12, 23]
    """
    numerators = [(100 * index + 64) ** 2 << (2 * LOGARITHM_ENTRIES.bit_length()) for index in range(LOGARITHM_ENTRIES)]
    scale = 2 * LOGARITHM_ENTRIES.bit_length()
    logarithms = [(numerator // 3200**2).bit_length() - 1 - scale for numerator in numerators]
    return np.clip(np.array(logarithms, np.int64) + offset, 0, classes - 1)
