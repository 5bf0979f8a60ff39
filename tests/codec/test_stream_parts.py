from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.stream.parts import join_parts, read_number, split_parts, write_number
from meshtide_codec.stream.plain_values import BadValueError


@given(st.lists(st.binary(max_size=300), min_size=1, max_size=8))
def test_parts_come_back(parts: list[bytes]) -> None:
    payload = join_parts(parts)
    assert split_parts(payload, len(parts)) == parts
    assert len(payload) <= sum(map(len, parts)) + 2 * (len(parts) - 1)


@given(st.integers(0, 2**63 - 1))
def test_numbers_come_back(value: int) -> None:
    written = write_number(value)
    assert read_number(b"x" + written + b"y", 1) == (value, 1 + len(written))


@given(st.binary(max_size=40), st.integers(1, 6))
def test_any_bytes_split_into_parts_of_themselves_or_are_refused(payload: bytes, count: int) -> None:
    try:
        parts = split_parts(payload, count)
    except BadValueError:
        assert count > 1
        return
    assert len(parts) == count
    assert payload.endswith(b"".join(parts))


@pytest.mark.parametrize("payload", [b"", b"\x80", b"\x80" * 9 + b"\x01", b"\x02a"])
def test_lengths_that_are_cut_off_or_too_long(payload: bytes) -> None:
    with pytest.raises(BadValueError):
        split_parts(payload, 2)
