"""Mirror symmetry: found by the encoder, told in the stream header, used as a context by Map and Diff.

Scanned and modelled objects are often symmetric to a plane across an axis. The encoder looks for the plane that takes
the most vertices to within a step of another vertex; candidates are the middle of the bounding box and the most
frequent sum of the coordinates of two vertices that agree in the other two. O(n log n) per axis.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.cell_table_kernels import build_cell_table
from meshtide_codec.compact.mirror_kernels import find_mirrored_cells
from meshtide_codec.errors import OptionError
from meshtide_codec.quantize import LARGEST_B

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.level import Level

SMALLEST_SHARE = 0.25
"""From this share of vertices with a mirror image on, the symmetry is worth its contexts."""

SAMPLE = 3_000
"""Vertices that candidates are judged by."""

_NO_CELLS = np.zeros((0, 2), np.int32)


@dataclasses.dataclass(frozen=True)
class Mirror:
    """A mirror plane across an axis.

    Attributes:
        axis: 0, 1 or 2 for a plane across x, y or z.
        coordinate_sum: x + x' in finest steps for a vertex x and its image x': twice the plane's position.
        bits: depth of the finest level, which `coordinate_sum` counts in.
    """

    axis: int
    coordinate_sum: int
    bits: int

    def plane(self, depth: int) -> float:
        """Twice the plane's position in half cells of `depth`: what a position and its image sum up to."""
        return 2.0 * (self.coordinate_sum + 1) / (1 << (self.bits - depth))

    def __post_init__(self) -> None:
        if self.axis not in {0, 1, 2} or not 1 <= self.bits <= LARGEST_B:
            raise OptionError(f"a mirror has axis 0 to 2 and 1 to {LARGEST_B} bits, not {self.axis} and {self.bits}")
        if not 0 <= self.coordinate_sum < 2 << self.bits:
            raise OptionError(f"a mirror's coordinate sum must be in 0..{(2 << self.bits) - 1}")


def find_mirror(positions: NDArray[np.int32], bits: int) -> Mirror | None:
    """The plane that takes the largest share of vertices to vertices, or None if that is too small.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different.
        bits: depth of the finest level.

    >>> right = np.array([[9, 1, 2], [7, 5, 3], [8, 8, 8]], np.int32)
    >>> find_mirror(np.concatenate([right, right * [-1, 1, 1] + [11, 0, 0]]), 4)
    Mirror(axis=0, coordinate_sum=11, bits=4)
    """
    present = np.sort(_packed(positions))
    sample = positions[:: max(1, len(positions) // SAMPLE)]
    best_share, best = SMALLEST_SHARE, None
    for axis in range(3):
        for coordinate_sum in _candidates(positions, axis):
            share = _mirrored_share(present, sample, axis, coordinate_sum)
            if share > best_share:
                best_share, best = share, Mirror(axis, coordinate_sum, bits)
    return best


def mirrored_cells(level: Level, mirror: Mirror | None) -> tuple[NDArray[np.int32], int]:
    """What the Map coder asks about the mirror images of a level's cells, and the axis (-1 without a mirror)."""
    if mirror is None:
        return _NO_CELLS, -1
    split = (~level.leaves).astype(np.uint8)
    table = build_cell_table(level.cells, split)
    found = find_mirrored_cells(
        level.cells, level.leaves, table, mirror.axis, mirror.coordinate_sum, level.depth, mirror.bits
    )
    return found, mirror.axis


def _packed(positions: NDArray[np.int32]) -> NDArray[np.int64]:
    """One integer per position, with room for a step beyond the grid on either side."""
    shifted = positions.astype(np.int64) + 2
    packed: NDArray[np.int64] = (shifted[:, 0] << 44) | (shifted[:, 1] << 22) | shifted[:, 2]
    return packed


def _candidates(positions: NDArray[np.int32], axis: int) -> list[int]:
    """Coordinate sums worth a look: around the middle of the box, and the most frequent one of aligned vertices."""
    along = positions[:, axis].astype(np.int64)
    middle = int(along.min() + along.max())
    sums = set(range(max(0, middle - 1), middle + 2))
    first, second = (positions[:, other].astype(np.int64) for other in range(3) if other != axis)
    order = np.lexsort((along, second, first))
    lines = np.flatnonzero(np.r_[True, (np.diff(first[order]) != 0) | (np.diff(second[order]) != 0), True])
    lows, highs = along[order[lines[:-1]]], along[order[lines[1:] - 1]]
    paired = (lows + highs)[lows != highs]
    if len(paired):
        sums.add(int(np.bincount(paired).argmax()))
    return sorted(sums)


def _mirrored_share(present: NDArray[np.int64], sample: NDArray[np.int32], axis: int, coordinate_sum: int) -> float:
    """Share of the sampled vertices off the plane with a vertex at their image: mean of exactly and within a step."""
    images = sample.copy()
    images[:, axis] = coordinate_sum - sample[:, axis]
    size = int(present[-1] >> 44) + int(sample.max()) + 1
    aside = (np.abs(images[:, axis] - sample[:, axis]) > 2) & (images[:, axis] >= -1) & (images[:, axis] <= size)
    images = images[aside]
    matched = np.zeros(len(images), bool)
    exact = 0
    for step in np.ndindex(3, 3, 3):
        keys = _packed(images + (np.array(step, np.int32) - 1))
        places = np.minimum(np.searchsorted(present, keys), len(present) - 1)
        found = present[places] == keys
        matched |= found
        if step == (1, 1, 1):
            exact = int(found.sum())
    return 0.5 * (float(matched.sum()) + exact) / max(1, int((np.abs(2 * sample[:, axis] - coordinate_sum) > 2).sum()))
