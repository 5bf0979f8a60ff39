"""Several byte strings in one payload: their lengths but the last one's, then the strings, without gaps.

A length is written in base 128, lowest digits first, the high bit set on all but its last byte (LEB128), so two
parts cost one to three bytes more than one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

LONGEST_NUMBER = 9  # bytes: 63 bits


def join_parts(parts: Sequence[bytes]) -> bytes:
    r"""One payload of at least one part.

    >>> join_parts([b"ab", b"", b"cde"])
    b'\x02\x00abcde'
    """
    return b"".join([*(write_number(len(part)) for part in parts[:-1]), *parts])


def split_parts(payload: bytes, count: int) -> list[bytes]:
    r"""The `count` parts that `join_parts` put together.

    Raises:
        BadValueError: a length is cut off or goes beyond the payload.

    >>> split_parts(b"\x02\x00abcde", 3)
    [b'ab', b'', b'cde']
    """
    lengths = []
    position = 0
    for _ in range(count - 1):
        length, position = read_number(payload, position)
        lengths.append(length)
    if position + sum(lengths) > len(payload):
        raise BadValueError(f"its parts take {position + sum(lengths)} bytes of {len(payload)}")
    parts = []
    for length in lengths:
        parts.append(payload[position : position + length])
        position += length
    return [*parts, payload[position:]]


def write_number(value: int) -> bytes:
    """A number from 0 on in base 128.

    >>> write_number(300).hex()
    'ac02'
    """
    digits = bytearray()
    while value >= 0x80:
        digits.append(value & 0x7F | 0x80)
        value >>= 7
    digits.append(value)
    return bytes(digits)


def read_number(payload: bytes, position: int) -> tuple[int, int]:
    """The number that begins at `position`, and where the next one begins.

    Raises:
        BadValueError: it is cut off, or longer than 63 bits.
    """
    value = 0
    for digit in range(LONGEST_NUMBER):
        if position + digit >= len(payload):
            raise BadValueError(f"a number at byte {position} is cut off")
        byte = payload[position + digit]
        value |= (byte & 0x7F) << (7 * digit)
        if byte < 0x80:
            return value, position + digit + 1
    raise BadValueError(f"a number at byte {position} is longer than {LONGEST_NUMBER} bytes")
