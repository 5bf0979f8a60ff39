"""How far a state is from the finest mesh, as the header stores it: a little too far, and never too near.

Both distances of a state take two bytes. The root mean square is a floating-point number of
six bits of mantissa and five of exponent, at most 1/64 too large; the maximum is told by how many times as large it
is, five bits, at most 1/4 too large: nothing that is shown depends on more. All stored values are exact in a double.
The layout stands in docs/format.md, section 2.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

MANTISSA_BITS = 6
MANTISSA = 1 << MANTISSA_BITS
EXPONENT_OF_ONE = 31 + MANTISSA_BITS
"""Code r > 0 is the distance (64 + r mod 64) 2^(r // 64 - 37)."""
LARGEST_CODE = 2047
LARGEST = 127 / 64
"""Two points of a mesh are one diagonal apart at most, and what is drawn of it is in a cube hardly longer than that."""

FACTOR_BITS = 2
FACTOR_MANTISSA = 1 << FACTOR_BITS
NO_FACTOR = 31
"""Code q below this: the maximum is (4 + q mod 4) 2^(q // 4 - 2) times the root mean square, at most `LARGEST`."""

DISTANCE_BYTES = 2
"""Bytes of both distances of a state."""


def stored_distances(rms: float, maximum: float) -> tuple[float, float]:
    """The least root mean square and maximum, not below those given, that a header can hold.

    Beyond `LARGEST` that is what they become. The maximum is never below the root mean square.

    >>> stored_distances(0.01, 0.03)
    (0.010009765625, 0.030029296875)
    >>> stored_distances(0.0, 0.0)
    (0.0, 0.0)
    """
    return unpack_distances(pack_distances(rms, maximum))


def pack_distances(rms: float, maximum: float) -> bytes:
    """Two bytes for root mean square and maximum, rounded up."""
    if rms == 0.0 and maximum == 0.0:
        return bytes(DISTANCE_BYTES)
    code = _least(_rms_of, 1, LARGEST_CODE, rms)
    stored = _rms_of(code)
    factor = _least(lambda place: _maximum_of(stored, place), 0, NO_FACTOR, maximum)
    return struct.pack(">H", code * (NO_FACTOR + 1) + factor)


def unpack_distances(data: bytes) -> tuple[float, float]:
    """Root mean square and maximum of the two bytes of `pack_distances`."""
    (word,) = struct.unpack(">H", data)
    code, factor = divmod(word, NO_FACTOR + 1)
    rms = _rms_of(code)
    return rms, _maximum_of(rms, factor)


def _rms_of(code: int) -> float:
    return 0.0 if code == 0 else (MANTISSA + code % MANTISSA) * 2.0 ** (code // MANTISSA - EXPONENT_OF_ONE)


def _maximum_of(rms: float, factor: int) -> float:
    if factor == NO_FACTOR:
        return LARGEST
    times = (FACTOR_MANTISSA + factor % FACTOR_MANTISSA) * 2.0 ** (factor // FACTOR_MANTISSA - FACTOR_BITS)
    return min(rms * times, LARGEST)


def _least(value_of: Callable[[int], float], low: int, high: int, wanted: float) -> int:
    """The least code from `low` on whose value, which rises with the code, is not below `wanted`; at most `high`."""
    while low < high:
        middle = (low + high) // 2
        if value_of(middle) >= wanted:
            high = middle
        else:
            low = middle + 1
    return low
