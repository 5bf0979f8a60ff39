"""Numbers as colours: from dark blue over green to yellow, ever lighter, so that a grey print keeps their order.

As in the paper's error plots (figs. 4, 8, 12, 16, 20), darker is smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

ANCHORS = np.array(
    [[62, 56, 150], [50, 94, 184], [36, 132, 172], [40, 164, 130], [124, 198, 84], [216, 216, 60], [255, 242, 170]],
    float,
)


@dataclass(frozen=True, slots=True)
class ColourScale:
    """Colours for the numbers from `low` to `high`; smaller ones look like `low`, larger ones like `high`.

    Args:
        low: what the darkest colour stands for.
        high: what the lightest colour stands for.
        label: what the numbers are, with their unit.

    Raises:
        OptionError: the ends are not finite, or not in order.

    >>> ColourScale(0.0, 2.0, "error").colours(np.array([-1.0, 0.0, 2.0])).tolist()
    [[62.0, 56.0, 150.0], [62.0, 56.0, 150.0], [255.0, 242.0, 170.0]]
    """

    low: float
    high: float
    label: str

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise OptionError(f"a colour scale needs two numbers in ascending order, not {self.low} and {self.high}")

    def colours(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) colours, 0 to 255, of values (n,)."""
        places = np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0) * (len(ANCHORS) - 1)
        steps = np.arange(len(ANCHORS))
        return np.stack([np.interp(places, steps, channel) for channel in ANCHORS.T], axis=1)
