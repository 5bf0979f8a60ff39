from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.reference.container import read_packet_rows, read_state_rows
from meshtide_codec.stream.plain_values import BadValueError
from meshtide_codec.stream.tables import pack_packets, pack_states, unpack_packets, unpack_states

PACKETS = st.lists(
    st.tuples(st.integers(0, 7), st.integers(0, 63), st.integers(0, 65535), st.integers(0, 2**40)), max_size=20
)
LEVELS = st.lists(st.integers(0, 63), min_size=1, max_size=20)


def flat(rows: list[tuple[int, int, int, int]]) -> list[int]:
    return [number for row in rows for number in row]


@given(PACKETS)
def test_any_packet_table_comes_back(rows: list[tuple[int, int, int, int]]) -> None:
    packed = pack_packets(rows)
    assert unpack_packets(packed) == flat(rows)
    assert read_packet_rows(packed) == rows


@given(LEVELS, st.data())
def test_any_table_of_states_comes_back(levels: list[int], data: st.DataObject) -> None:
    counts = sorted(data.draw(st.lists(st.integers(1, len(levels)), max_size=12)))
    rows = [
        (data.draw(st.integers(0, 63)), count, data.draw(st.integers(0, 2**30)), data.draw(st.integers(0, 2**31)))
        for count in counts
    ]
    distances = [data.draw(st.binary(min_size=4, max_size=4)) for _ in rows]
    packed = pack_states(rows, distances, levels)
    assert unpack_states(packed, levels, 4) == (flat(rows), b"".join(distances))
    assert read_state_rows(packed, levels) == rows


def test_what_is_expected_takes_a_byte() -> None:
    whole_levels = [(0, 5, 0, 100), *((1 + 2 * (i % 2), 4 - i // 2, 0, 100) for i in range(10))]
    assert len(pack_packets(whole_levels)) == 4 + 2 * 10
    levels = [level for _, level, _, _ in whole_levels]
    states = [(5, 1, 50, 96), (4, 3, 50, 96), (0, 11, 50, 96)]
    assert len(pack_states(states, [bytes(4)] * 3, levels)) == 3 * (1 + 1 + 1 + 4)


@pytest.mark.parametrize(
    "data",
    [
        bytes([32, 1]),  # no such step
        bytes([24, 1]),  # slice and length are missing
        bytes([0]),  # the length is missing
        bytes([0x80]),  # a number that is cut off
        bytes([0, 0xFF]),
    ],
)
def test_damaged_packet_tables_are_refused(data: bytes) -> None:
    with pytest.raises(BadValueError):
        unpack_packets(data)


@pytest.mark.parametrize(
    ("data", "wrong"),
    [
        (bytes([0, 2, 2, 0, 0, 0, 0]), "0 packets of 2"),
        (bytes([6, 2, 2, 0, 0, 0, 0]), "3 packets of 2"),
        (bytes([2, 2, 2, 0, 0, 0]), "distances"),
        (bytes([2, 2]), "cut off"),
        (bytes([3]), "cut off"),
    ],
)
def test_damaged_tables_of_states_are_refused(data: bytes, wrong: str) -> None:
    with pytest.raises(BadValueError, match=wrong):
        unpack_states(data, [1, 0], 4)
