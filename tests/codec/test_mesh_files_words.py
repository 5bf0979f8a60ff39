"""Words of texts: where they stand, what numbers they are, which one is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.words import Words, without_comments


@given(st.text(alphabet="12. \t\n", max_size=60), st.integers(0, 5))
def test_words_are_those_of_split(text: str, offset: int) -> None:
    offset = min(offset, len(text))
    words = Words(text.encode(), offset)
    rest = text[offset:]
    assert words.count == len(rest.split())
    assert [text[start:].split(maxsplit=1)[0] for start in words.starts.tolist()] == rest.split()
    filled = [line.split() for line in rest.split("\n") if line.split()]
    assert words.first.tolist() == np.cumsum([0, *map(len, filled)]).tolist()[: len(filled)]
    for place, start in enumerate(words.starts.tolist()):
        assert words.line(place) == text[:start].count("\n") + 1


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=20))
def test_numbers_read_back_to_the_same_bits(numbers: list[float]) -> None:
    words = Words("\n".join(map(repr, numbers)).encode())
    assert words.numbers(0, words.count).tolist() == numbers
    assert words.numbers(1, words.count).tolist() == numbers[1:]


@pytest.mark.parametrize("bad", ["x", "1-2", "1,5", "0x10", "1e", "--1", "1_0", "1.2.3", "1\x002", "\xff", "nan1", "-"])
@pytest.mark.parametrize("place", [0, 1, 6, 12])
def test_the_first_word_that_is_no_number_is_found(bad: str, place: int) -> None:
    lines = [str(number) for number in range(13)]
    lines[place] = bad
    words = Words("\n".join([*lines, "y"]).encode("latin-1"))
    assert words.leading(0, words.count).tolist() == list(range(place))
    with pytest.raises(MeshFileError, match=f"line {place + 1}: a number is missing where '{bad[:1]}?"):
        words.numbers(0, words.count)
    assert words.numbers(0, place).tolist() == list(range(place))


def test_integers_are_integers_unless_one_is_none() -> None:
    words = Words(b"3 0 1 2 0.5")
    assert words.leading(0, 4).dtype == np.int64
    assert words.leading(0, 5).tolist() == [3, 0, 1, 2, 0.5]
    assert words.leading(2, 2).tolist() == []


def test_a_text_of_blanks_has_no_numbers() -> None:
    for text in (b"", b"  \n"):
        assert Words(text).count == 0
        assert Words(text).first.tolist() == []
        assert Words(text).numbers(0, 0).tolist() == []


def test_comments_are_left_out() -> None:
    text = b"no comment"
    assert without_comments(text) is text
    assert without_comments(b"#a\n1 2#b#c\n#") == b"\n1 2\n"
