"""Numbers in base 128 (docs/format.md, sections 2 and 3)."""

from __future__ import annotations

from meshtide_codec.errors import PacketError


def read_number(payload: bytes, position: int) -> tuple[int, int]:
    """The number in base 128 that begins at `position`, and where it ends.

    Raises:
        PacketError: it is cut off.

    >>> read_number(bytes([0xAC, 0x02]), 0)
    (300, 2)
    """
    value = digit = 0
    while True:
        if position >= len(payload):
            raise PacketError("a number is cut off", offset=position)
        byte = payload[position]
        value |= (byte & 127) << (7 * digit)
        digit += 1
        position += 1
        if byte < 128:  # the high bit says that another digit follows
            return value, position


def read_signed(payload: bytes, position: int) -> tuple[int, int]:
    """A folded number: 0, -1, 1, -2, ... are written as 0, 1, 2, 3, ...

    Raises:
        PacketError: it is cut off.

    >>> [read_signed(bytes([byte]), 0)[0] for byte in range(4)]
    [0, -1, 1, -2]
    """
    value, position = read_number(payload, position)
    return (-(value + 1) // 2 if value % 2 == 1 else value // 2), position
