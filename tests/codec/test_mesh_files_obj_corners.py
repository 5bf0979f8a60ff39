from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.mesh_files.obj.corners import ZeroIndexError, read_corners
from meshtide_codec.mesh_files.text_numbers import PADDING, NotANumber, padded

INDEX = st.integers(1, 10**18 - 1) | st.integers(-(10**18) + 1, -1) | st.integers(1, 9)
CORNER = st.tuples(INDEX, st.none() | INDEX, st.none() | INDEX)


def written(corner: tuple[int, int | None, int | None], slashes: str) -> str:
    v, t, n = corner
    if n is not None:
        return f"{v}/{'' if t is None else t}/{n}"
    return f"{v}{slashes}" if t is None else f"{v}/{t}{slashes[:1]}"


@settings(max_examples=100, deadline=None)
@given(st.lists(CORNER, min_size=1, max_size=12), st.sampled_from(["", "", "/", "//"]), st.booleans())
def test_corners_of_all_forms(corners: list[tuple[int, int | None, int | None]], slashes: str, alike: bool) -> None:
    corners = [corners[0]] * len(corners) if alike else corners
    words = [written(corner, slashes) for corner in corners]
    found = read_corners(padded(" ".join(words).encode()))
    for place in range(3):
        column = found.indices[place]
        expected = [corner[place] or 0 for corner in corners]
        assert ([0] * len(corners) if column is None else column.tolist()) == expected
        assert place == 0 or (column is None) == (not any(expected))
    signs = [word.startswith("-") for word in words]
    starts = [PADDING + sum(len(word) + 1 for word in words[:i]) + signs[i] for i in range(len(words))]
    assert found.places.tolist() == starts


@pytest.mark.parametrize(
    "word",
    ["x", "1/x", "1/2/3/4", "/1", "//1", "1///2", "1.5", "+1", "1-2", "--1", "1/-", "1 /", "1e5", "9" * 19, "1/ /2"],
)
def test_words_that_are_no_corners_are_found(word: str) -> None:
    with pytest.raises(NotANumber) as caught:
        read_corners(padded(f"1/2/3 4//5 -6 {word} 7 8/9".encode()))
    assert caught.value.place == PADDING + 14 + (2 if word in {"1 /", "1/ /2"} else 0) + (word == "1/ /2")


@pytest.mark.parametrize(("text", "place"), [("1 0", 2), ("1/0/2", 2), ("1//00 0", 3), ("-0", 1)])
def test_an_index_0_is_found(text: str, place: int) -> None:
    with pytest.raises(ZeroIndexError) as caught:
        read_corners(padded(text.encode()))
    assert caught.value.place == PADDING + place


def test_no_corners() -> None:
    assert read_corners(padded(b" \n")).places.tolist() == []
