"""Equal points become one: sorted by a hash of their bits, which is checked, in the order of their first occurrence.

Cost: O(n log n); of n points of c components about 40 n bytes beside the points themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MULTIPLIER = 0x9E3779B97F4A7C15
_SHIFT = 29


def welded(points: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
    """The distinct points (k, c) of `points` (n, c), and of each point (n,) which of them it is.

    Points are equal if their bits are; 0.0 and -0.0 are the same. The first of equal points decides their order.

    >>> found, numbers = welded(np.array([[1.0, 0.0], [2.0, 0.0], [1.0, -0.0]]))
    >>> found.tolist(), numbers.tolist()
    ([[1.0, 0.0], [2.0, 0.0]], [0, 1, 0])
    """
    if len(points) == 0:
        return points, np.zeros(0, np.int64)
    with np.errstate(invalid="ignore"):  # a signalling NaN, which no mesh may have, is refused later
        positive = np.ascontiguousarray(points) + points.dtype.type(0)  # -0.0 becomes 0.0
    bits = positive.view(np.uint32 if positive.dtype.itemsize == 4 else np.uint64)
    hashes = _hashed(bits)
    order = np.argsort(hashes)
    keys: NDArray[np.uint64] | None = hashes
    del hashes
    if not _is_new(bits, order, keys)[1]:  # different points have one hash: sort by the bits themselves
        order = np.lexsort(bits.T)
        keys = None
    new, _ = _is_new(bits, order, keys)
    del keys
    starts = np.flatnonzero(new)
    first = np.minimum.reduceat(order, starts)
    is_first = np.zeros(len(points), bool)
    is_first[first] = True
    numbers = np.cumsum(is_first) - 1
    owner = numbers[first]
    numbers[order] = np.repeat(owner, np.diff(np.append(starts, len(points))))
    return positive[is_first], numbers


def _hashed(bits: NDArray[np.unsignedinteger]) -> NDArray[np.uint64]:
    """A number of 64 bits for each row; rows that differ have different ones but for bad luck."""
    keys = np.zeros(len(bits), np.uint64)
    for column in bits.T:
        keys ^= column
        keys *= np.uint64(_MULTIPLIER)
        keys ^= keys >> np.uint64(_SHIFT)
    return keys


def _is_new(
    bits: NDArray[np.unsignedinteger], order: NDArray[np.int64], keys: NDArray[np.uint64] | None
) -> tuple[NDArray[np.bool_], bool]:
    """Which rows, in an order that puts equal ones together, differ from the one before; whether their keys do too."""
    new = np.ones(len(order), bool)
    new[1:] = False
    for column in bits.T:
        ordered = column[order]
        new[1:] |= ordered[1:] != ordered[:-1]
    if keys is None:
        return new, True
    ordered = keys[order]
    return new, bool(((ordered[1:] != ordered[:-1]) == new[1:]).all())
