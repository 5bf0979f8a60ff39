"""The display filter's inner loop: one step of Laplacian smoothing, kept within the cells that are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel
def smooth_within_cells(
    middles: NDArray[np.int64],
    half_sides: NDArray[np.int64],
    starts: NDArray[np.int32],
    members: NDArray[np.int32],
    strength: float,
) -> NDArray[np.float64]:
    """Positions x - strength K x, each coordinate clamped to middle +- half side; half side 1 means exactly known.

    All in half finest steps; K x is x minus the mean of the ring's members.
    """
    smoothed = np.empty(middles.shape, np.float64)
    for vertex in range(len(middles)):
        first, last = int(starts[vertex]), int(starts[vertex + 1])
        half_side = half_sides[vertex]
        for axis in range(3):
            middle = middles[vertex, axis]
            position = float(middle)
            if last > first and half_side > 1:
                total = 0
                for slot in range(first, last):
                    total += middles[members[slot], axis]
                position -= strength * (position - total / (last - first))
                position = min(max(position, float(middle - half_side)), float(middle + half_side))
            smoothed[vertex, axis] = position
    return smoothed
