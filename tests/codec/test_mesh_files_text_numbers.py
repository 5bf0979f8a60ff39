from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.mesh_files import text_numbers
from meshtide_codec.mesh_files.text_numbers import (
    TOO_LARGE,
    NotANumber,
    decimals,
    digit_runs,
    leading_numbers,
    padded,
    values_of_runs,
)


def bits(values: object) -> list[int]:
    return np.array(values, np.float64).view(np.int64).tolist()


FORMATS = st.sampled_from(
    ["{!r}", "{:.17g}", "{:.6f}", "{:.0f}", "{:.3e}", "{:.6E}", "{:.0e}", "{:.17e}", "{:.20f}", "{:+.4f}"]
)
FLOATS = st.floats(-1e9, 1e9) | st.floats(allow_nan=False, allow_infinity=False)
WORDS = st.builds(lambda form, number: form.format(number), FORMATS, FLOATS) | st.from_regex(
    r"-?[0-9]{1,24}(\.[0-9]{1,24})?", fullmatch=True
)


@settings(max_examples=80, deadline=None)
@given(st.lists(WORDS, min_size=1, max_size=30), st.sampled_from([" ", "\n", " \t ", "\0"]))
def test_numbers_are_read_as_float_reads_them(words: list[str], gap: str) -> None:
    values, places = decimals(padded(gap.join(words).encode()))
    assert bits(values) == bits([float(word) for word in words])
    assert len(places) == len(words)


POWERS = [f"{number}{mark}{power}" for number in ("1", "-12.5", "9007199254740993", "0.3", "0") for mark in ("e", "E+")
          for power in (0, 1, 5, 21, 22, 23, 30, 300, 999)]  # fmt: skip


@pytest.mark.parametrize("count", [1, 300])
def test_powers_of_ten_are_rounded_once(count: int) -> None:
    words = [*POWERS, *(word.replace("e", "e-").replace("+", "-") for word in POWERS)] * count
    assert bits(decimals(padded(" ".join([*words, "7"]).encode()))[0]) == bits([float(word) for word in [*words, "7"]])


def test_texts_with_powers_of_ten_are_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(text_numbers, "_spelled_otherwise", refuse)
    words = [f"{number:e}" for number in np.random.default_rng(0).standard_normal(3000).tolist()]
    assert bits(decimals(padded(" ".join(words).encode()))[0]) == bits([float(word) for word in words])


def leading(words: list[str], *, whole: bool = False) -> np.ndarray:
    text = "\n".join(words).encode()
    starts = np.cumsum([0] + [len(word) + 1 for word in words])[:-1]
    return leading_numbers(np.frombuffer(text, np.uint8), starts, len(text), whole=whole)


@pytest.mark.parametrize("block", [1, 4, 1000])
@pytest.mark.parametrize("bad", [0, 3, 4, 17, 20])
def test_numbers_are_read_up_to_the_first_word_that_is_none(
    block: int, bad: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_numbers, "_BLOCK", block)
    words = [f"{number}.5" for number in range(20)]
    assert leading([*words[:bad], "x", *words[bad:], "y"]).tolist() == [float(word) for word in words[:bad]]
    assert leading(words).tolist() == [float(word) for word in words]


@pytest.mark.parametrize("block", [1, 2, 1000])
def test_whole_numbers_are_exact_and_others_floats(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_numbers, "_BLOCK", block)
    largest = ["9007199254740993", "-9223372036854775808", "9223372036854775807", "-1", "0", "-0", "007", "-01"]
    assert leading(largest, whole=True).tolist() == [int(word) for word in largest]
    for word in ("9223372036854775808", "1.0", "1e2", "nan", "1" * 40):
        found = leading(["1", word, "3"], whole=True)
        assert found.dtype == np.float64
        assert bits(found) == bits([1, float(word), 3])
    assert bits(leading(["-0", "0"])) == bits([-0.0, 0.0])
    assert leading([], whole=True).dtype == np.int64


def test_halves_between_two_floats_are_rounded_right() -> None:
    # Decimals of 16 to 18 digits at or beside the middle of two floats: where division in double precision ends.
    middles = [(2**53 + 1 + 2 * i) for i in range(-8, 40)]
    words = [f"{middle // 10**k}.{middle % 10**k:0{k}d}" for middle in middles for k in range(1, 16)]
    words += [f"{middle}" for middle in middles] + [f"0.{middle}" for middle in middles]
    assert bits(decimals(padded(" ".join(words).encode()))[0]) == bits([float(word) for word in words])


@pytest.mark.parametrize("count", [3, 300])
@pytest.mark.parametrize(
    "word", ["1e5", ".5", "-.5", "5.", "+7", "nan", "-inf", "1E-400", "123456789012345678901234567890"]
)
def test_other_spellings_few_or_many(word: str, count: int) -> None:
    for words in ([word] * count, ["0.25", word] * count, [word, *(["-7"] * 2000)]):
        values, places = decimals(padded(" ".join(words).encode()))
        assert bits(values) == bits([float(one) for one in words])
        starts = np.cumsum([0] + [len(one) + 1 for one in words])[:-1] + text_numbers.PADDING
        assert (np.abs(places - starts) <= 1).all()


@pytest.mark.parametrize(
    "word", ["x", "1.2.3", "1-2", "--1", "1_0", "0x10", "1,5", "-", ".", "1e", "1.#Q", "\xe9", "e5"]
)
@pytest.mark.parametrize("count", [1, 400])
def test_words_that_are_no_numbers_are_found(word: str, count: int) -> None:
    text = f"1.5 -2 {'3e1 ' * count}{word} {'4 ' * count}"
    with pytest.raises(NotANumber) as caught:
        decimals(padded(text.encode("latin-1")))
    assert caught.value.place == text_numbers.PADDING + 7 + 4 * count


def test_long_words_take_time_in_proportion() -> None:
    values, _ = decimals(padded(b"0." + b"0" * 100_000 + b"1 " + b"1" * 300 + b" 2"))
    assert values.tolist() == [0.0, float("1" * 300), 2.0]


def test_nothing_is_no_numbers() -> None:
    assert decimals(padded(b""))[0].tolist() == []
    assert decimals(padded(b" \n "))[0].tolist() == []


@settings(max_examples=50, deadline=None)
@given(st.lists(st.from_regex(r"[0-9]{1,26}", fullmatch=True), min_size=1, max_size=20))
def test_runs_of_digits(words: list[str]) -> None:
    text = padded("/".join(words).encode())
    runs = digit_runs(text)
    values = values_of_runs(text, runs.starts, runs.ends - runs.starts).tolist()
    for word, value in zip(words, values, strict=True):
        assert value == int(word) if len(word) <= 18 else value in {int(word), int(TOO_LARGE)}
        assert int(word) < 10**18 or value == int(TOO_LARGE)


def test_padding_and_whole_words() -> None:
    text = padded(b"abc")
    assert len(text) % 8 == 0
    assert bytes(text).strip() == b"abc"
    assert bytes(text[: text_numbers.PADDING]) == b" " * text_numbers.PADDING
