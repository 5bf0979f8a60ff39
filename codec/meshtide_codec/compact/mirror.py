"""Mirror symmetry: found by the encoder, kept in the stream header, used as a context by Map and Diff.

Scanned and modelled objects are often symmetric to a plane across an axis. The encoder looks for the plane that takes
the most vertices to within a step of another vertex; candidates are the middle of the bounding box and the most
frequent sum of the coordinates of two vertices that agree in the other two (codec/core, surface/mirror.hpp). O(n).
"""

from __future__ import annotations

import dataclasses
from ctypes import byref, c_int32
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.quantize import LARGEST_B

if TYPE_CHECKING:
    from numpy.typing import NDArray


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

    def __post_init__(self) -> None:
        if self.axis not in {0, 1, 2} or not 1 <= self.bits <= LARGEST_B:
            raise OptionError(f"a mirror has axis 0 to 2 and 1 to {LARGEST_B} bits, not {self.axis} and {self.bits}")
        if not 0 <= self.coordinate_sum < 2 << self.bits:
            raise OptionError(f"a mirror's coordinate sum must be in 0..{(2 << self.bits) - 1}")


def find_mirror(positions: NDArray[np.int32], bits: int) -> Mirror | None:
    """The plane that takes the largest share of vertices to vertices, or None if that is too small.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different.
        bits: depth of the finest level, 1 to 20.

    Raises:
        MeshError: the positions are not of that form.

    >>> right = np.array([[9, 1, 2], [7, 5, 3], [8, 8, 8]], np.int32)
    >>> find_mirror(np.concatenate([right, right * [-1, 1, 1] + [11, 0, 0]]), 4)
    Mirror(axis=0, coordinate_sum=11, bits=4)
    """
    axis, total = c_int32(), c_int32()
    points = np.ascontiguousarray(positions, np.int32)
    core.call("mt_find_mirror", points, len(points), bits, byref(axis), byref(total), argument_error=MeshError)
    return Mirror(axis.value, total.value, bits) if axis.value >= 0 else None
