"""Lengths and positions in as few bytes as tell them exactly.

Most meshes come from text files of a few decimals, or from single precision. So a number is written as an integer
divided by a power of ten if that is shortest, as a float32 if that is exact, and as a double otherwise.
"""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING

from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from collections.abc import Iterator

MOST_DECIMALS = 22
"""10^22 is the largest power of ten that a double holds exactly, so the division is rounded once."""
LARGEST_MANTISSA = 1 << 53
LARGEST_SINGLE = 3.4028234663852886e38
SINGLE, DOUBLE = 32, 64
"""First bytes of numbers that are not decimal; that of a decimal one is the number of its decimals."""


def pack_coordinate(value: float) -> bytes:
    """The shortest form of a number.

    >>> pack_coordinate(-2.45912).hex(), pack_coordinate(0.5).hex(), len(pack_coordinate(1 / 3))
    ('05af821e', '010a', 9)
    """
    return min(_forms(value), key=len)


def unpack_coordinate(data: bytes, position: int) -> tuple[float, int]:
    """The number that begins at `position`, and where the next one begins.

    Raises:
        BadValueError: it is cut off, or of no known form.
    """
    kind = data[position] if position < len(data) else -1
    position += 1
    if 0 <= kind <= MOST_DECIMALS:
        mantissa, position = read_number(data, position)
        if mantissa > 2 * LARGEST_MANTISSA:
            raise BadValueError(f"a decimal number of more digits than a double holds, before byte {position}")
        return unfolded(mantissa) / 10**kind, position
    if kind not in (SINGLE, DOUBLE) or position + kind // 8 > len(data):
        raise BadValueError(f"a number before byte {position} is cut off or of no known form")
    layout = "<f" if kind == SINGLE else "<d"
    value: float = struct.unpack_from(layout, data, position)[0]
    return value, position + kind // 8


def folded(value: int) -> int:
    """Signed to unsigned: 0, -1, 1, -2, ... become 0, 1, 2, 3, ...

    >>> [folded(value) for value in (0, -1, 1, -2)]
    [0, 1, 2, 3]
    """
    return 2 * value if value >= 0 else -2 * value - 1


def unfolded(value: int) -> int:
    """The signed integer that `folded` made unsigned."""
    return -(value + 1) // 2 if value & 1 else value // 2


def _forms(value: float) -> Iterator[bytes]:
    """All forms that tell `value` exactly, down to the sign of a zero."""
    if math.isfinite(value) and (value != 0.0 or math.copysign(1.0, value) > 0.0):
        for decimals in range(MOST_DECIMALS + 1):
            product = value * 10**decimals
            if abs(product) > LARGEST_MANTISSA:
                break
            if round(product) / 10**decimals == value:
                yield bytes([decimals]) + write_number(folded(round(product)))
                break
    if abs(value) <= LARGEST_SINGLE and struct.unpack("<f", struct.pack("<f", value))[0] == value:
        yield bytes([SINGLE]) + struct.pack("<f", value)
    yield bytes([DOUBLE]) + struct.pack("<d", value)
