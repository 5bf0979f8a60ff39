from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.reference.packed_header import read_coordinate
from meshtide_codec.stream.coordinates import folded, pack_coordinate, unfolded, unpack_coordinate
from meshtide_codec.stream.plain_values import BadValueError

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def bits(value: float) -> bytes:
    return struct.pack("<d", value)


@given(
    FINITE | st.floats(width=32, allow_nan=False, allow_infinity=False) | st.decimals(-999, 999, places=6).map(float)
)
def test_every_number_comes_back_bit_for_bit(value: float) -> None:
    data = pack_coordinate(value)
    assert len(data) <= 9
    found, end = unpack_coordinate(b"abc" + data + b"d", 3)
    assert (bits(found), end) == (bits(value), 3 + len(data))
    assert bits(read_coordinate(data, 0)[0]) == bits(value)


@given(st.integers(-(10**6), 10**6), st.integers(0, 9))
def test_decimal_numbers_take_four_bytes(digits: int, decimals: int) -> None:
    assert len(pack_coordinate(float(f"{digits}e-{decimals}"))) <= 4


@pytest.mark.parametrize(
    ("value", "size"),
    [(0.0, 2), (-0.0, 5), (1.0, 2), (1e22, 9), (-2.45912, 4), (0.1 + 0.2, 9), (float(2**100), 5), (math.pi, 9)],
)
def test_the_shortest_form_is_taken(value: float, size: int) -> None:
    assert len(pack_coordinate(value)) == size


@pytest.mark.parametrize(
    "data",
    [
        b"",
        bytes([5]),
        bytes([5, 0x80]),
        bytes([23, 1]),
        bytes([33, 0, 0, 0, 0]),
        bytes([32, 0, 0, 0]),
        bytes([64, 0, 0, 0, 0, 0, 0, 0]),
        bytes([255]) * 9,
        bytes([0]) + bytes([0xFF] * 8) + bytes([0x7F]),  # more digits than a double holds
    ],
)
def test_damaged_numbers_are_refused(data: bytes) -> None:
    with pytest.raises(BadValueError):
        unpack_coordinate(data, 0)


@given(st.integers(-(2**60), 2**60))
def test_folding(value: int) -> None:
    assert folded(value) >= 0
    assert unfolded(folded(value)) == value
