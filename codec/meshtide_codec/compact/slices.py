"""Slices: Diffs cut into runs of neighbouring vertices, each of which decodes without the others.

A slice is a range of Morton codes in the finest grid. A leaf belongs to the slice that its cell's lowest corner lies
in, at every depth, so a slice is a contiguous range of each level's vertices and known from reliable data alone.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from meshtide_codec.compact.level import Level


@dataclasses.dataclass(frozen=True)
class Slices:
    """Where the slices of a stream begin.

    Attributes:
        bits: depth of the finest level.
        starts: the first Morton code of each slice, strictly increasing from 0.
    """

    bits: int
    starts: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        if not self.starts or self.starts[0] != 0 or self.starts[-1] >= 1 << (3 * self.bits):
            raise OptionError(f"slices begin at code 0 and below {1 << (3 * self.bits)}, not at {self.starts}")
        if any(later <= earlier for earlier, later in itertools.pairwise(self.starts)):
            raise OptionError("the slices' first codes must increase strictly")

    def __len__(self) -> int:
        return len(self.starts)

    def vertices(self, level: Level, slice_index: int) -> range:
        """The indices of a level's vertices that belong to a slice.

        >>> from meshtide_codec.compact.level import root_level
        >>> Slices(4, (0, 100)).vertices(root_level(1), 0)
        range(0, 1)
        """
        if len(self.starts) == 1:
            return range(level.vertex_count)
        shift = 3 * (self.bits - level.depth)
        begin = int(np.searchsorted(level.codes, -(-self.starts[slice_index] >> shift)))
        if slice_index + 1 == len(self.starts):
            return range(begin, level.vertex_count)
        return range(begin, int(np.searchsorted(level.codes, -(-self.starts[slice_index + 1] >> shift))))


def even_slices(level: Level, bits: int, count: int) -> Slices:
    """At most `count` slices of about equally many vertices of `level`, best the first one whose cells are all leaves.

    Raises:
        OptionError: `count` is less than 1.
    """
    if count < 1:
        raise OptionError(f"there must be at least one slice, not {count}")
    shift = 3 * (bits - level.depth)
    cuts = {int(level.codes[level.vertex_count * part // count]) << shift for part in range(1, count)}
    return Slices(bits, (0, *sorted(cuts - {0})))
