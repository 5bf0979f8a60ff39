from __future__ import annotations

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.stream import plain_values
from meshtide_codec.stream.plain_values import BadValueError

FAULTS = {
    "a string in it is not UTF-8",
    "it is nested too deeply",
    "a byte begins no value, or a map has a key that cannot be one",
    "it ends early, or an item is longer than is taken",
}


@given(st.binary(max_size=80))
def test_unpack_raises_nothing_else(data: bytes) -> None:
    try:
        plain_values.unpack(data, 100)
    except BadValueError as error:
        assert str(error).removeprefix("not a msgpack value: ") in FAULTS or "bytes follow it" in str(error)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"\xa2\xa8\xa9", "a string in it is not UTF-8"),
        (b"\x01\x02\x03", "2 bytes follow it"),
        (b"\x91" * 5000, "it is nested too deeply"),
        (b"\xc1", "a byte begins no value, or a map has a key that cannot be one"),
        (b"\x81\x80\x80", "a byte begins no value, or a map has a key that cannot be one"),
        (b"", "it ends early, or an item is longer than is taken"),
        (b"\xd4\x01\x02", "it ends early, or an item is longer than is taken"),
    ],
    ids=["text", "more", "deep", "no type", "key", "empty", "extension"],
)
def test_what_is_wrong_is_told_in_words_of_this_program(data: bytes, fault: str) -> None:
    with pytest.raises(BadValueError) as caught:
        plain_values.unpack(data, 100)
    assert str(caught.value) == f"not a msgpack value: {fault}"


def test_unpack_holds_items_against_the_limit() -> None:
    assert plain_values.unpack(msgpack.packb([1] * 5), 5) == [1] * 5
    for value in ([1] * 6, b"123456", "123456", {i: i for i in range(6)}):
        with pytest.raises(BadValueError):
            plain_values.unpack(msgpack.packb(value), 5)


def test_unpack_refuses_left_over_bytes_deep_nesting_and_false_lengths() -> None:
    for data in (b"\x01\x02", b"\x91" * 5000, b"\xdd\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b""):
        with pytest.raises(BadValueError):
            plain_values.unpack(data, 1 << 20)


@pytest.mark.parametrize("value", [True, 1.0, "1", None, -1, 11, 1 << 400])
def test_integer_refuses(value: object) -> None:
    with pytest.raises(BadValueError, match=r"size must be an integer in 0\.\.10"):
        plain_values.integer(value, "size", 0, 10)


@pytest.mark.parametrize("value", [False, "1", None, float("nan"), float("inf"), -0.5, 2.5])
def test_number_refuses(value: object) -> None:
    with pytest.raises(BadValueError, match="error must be a"):
        plain_values.number(value, "error", 0.0, 2.0)


def test_what_is_right_passes() -> None:
    assert plain_values.integer(10, "size", 0, 10) == 10
    assert plain_values.number(2, "error", 0.0, 2.0) == 2.0
    assert plain_values.text("abc", "name", 3) == "abc"
    assert plain_values.binary(b"abc", "data", 3, 3) == b"abc"
    assert plain_values.array([1, 2], "pair", 2) == [1, 2]


def test_texts_bytes_and_arrays_of_other_lengths_are_refused() -> None:
    with pytest.raises(BadValueError, match="name"):
        plain_values.text("abcd", "name", 3)
    with pytest.raises(BadValueError, match="data"):
        plain_values.binary(b"ab", "data", 3, 3)
    with pytest.raises(BadValueError, match="an array of 2"):
        plain_values.array([1], "pair", 2)
    with pytest.raises(BadValueError, match="an array"):
        plain_values.array({}, "pair")


def test_hostile_values_print_shortly() -> None:
    assert plain_values.shown(b"x" * 1000) == "bytes of 1000"
    assert plain_values.shown(1 << 5000) == "a huge integer"
    assert len(plain_values.shown("y" * 1000)) <= 62
