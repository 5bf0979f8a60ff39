from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.stream.shortage import Shortage, find_shortage
from streams import MadeUpStream

STREAM = MadeUpStream((100, 5000, 20, 900, 7))
COUNT = len(STREAM.packets)


@given(st.sets(st.integers(0, COUNT - 1)), st.integers(0, COUNT))
def test_what_is_missing_is_counted(held: set[int], wanted: int) -> None:
    missing = sorted(set(range(wanted)) - held)
    found = find_shortage(STREAM.header, held, wanted)
    assert (found is None) == (not missing)
    if found is not None:
        entries = [STREAM.header.packets[index] for index in missing]
        assert (found.packets, found.wanted) == (len(missing), wanted)
        assert found.size == sum(entry.length for entry in entries)
        assert found.first == STREAM.header.packets[missing[0]]
        assert sum(found.kinds.values()) == len(missing)
        assert set(found.kinds) == {entry.kind.label for entry in entries}


def test_it_is_told_with_level_kinds_counts_and_bytes() -> None:
    shortage = find_shortage(STREAM.header, {0, 1}, COUNT)
    assert isinstance(shortage, Shortage)
    assert str(shortage) == "3 of 5 packets are missing (927 bytes, from level 1 on: 1 Diff, 1 Map&Conn, 1 Param)"
    for kind, count in shortage.kinds.items():
        assert f"{count} {kind}" in str(shortage)


@pytest.mark.parametrize("wanted", [0, COUNT])
def test_nothing_is_missing_where_all_is_held(wanted: int) -> None:
    assert find_shortage(STREAM.header, range(COUNT), wanted) is None
