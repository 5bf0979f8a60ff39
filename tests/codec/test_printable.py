from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.printable import ELLIPSIS, LONGEST_NAME, LONGEST_TEXT, encodable, listed_name, printable, shown

ANY_TEXT = st.text(st.characters(codec=None), max_size=60)
BIDI = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Käse 網格 🐄 e\u0301 \u200d.ply", "Käse 網格 🐄 e\u0301 \u200d.ply"),
        ("[bold]x[/]", "[bold]x[/]"),
        ("a\\b", "a\\b"),
        ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
        ("\x9b31m", r"\x9b31m"),
        ("one\ntwo\rthree\tfour\x7f\x00", r"one\ntwo\rthree\tfour\x7f\x00"),
        ("\u202eylp.exe\u2066", r"\u202eylp.exe\u2066"),
        ("a\u2028b\u2029c\x85d", r"a\u2028b\u2029c\x85d"),
        (b"caf\xe9.ply".decode("utf-8", "surrogateescape"), r"caf\udce9.ply"),
        ("", ""),
    ],
)
def test_what_steers_a_terminal_is_escaped_and_nothing_else(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(ANY_TEXT, st.integers(1, 80))
def test_any_text_becomes_one_bounded_line_that_any_stream_can_write(text: str, longest: int) -> None:
    shown = printable(text, longest)
    assert len(shown) <= longest
    assert len(shown.splitlines()) <= 1
    assert not any(unicodedata.category(character) in {"Cc", "Cs", "Zl", "Zp"} for character in shown)
    assert not set(shown) & set(BIDI)
    assert shown.encode("utf-8").decode("utf-8") == shown


def test_a_long_name_of_a_packed_file_keeps_both_suffixes() -> None:
    name = listed_name(Path("x" * 300 + ".ply.gz"))
    assert (len(name), name[-8:]) == (LONGEST_NAME, f"{ELLIPSIS}.ply.gz")


@given(ANY_TEXT)
def test_doing_it_twice_changes_nothing(text: str) -> None:
    assert printable(printable(text)) == printable(text)


@given(st.text(st.characters(categories=["L", "N", "P", "S", "Zs"]), max_size=60))
def test_ordinary_text_is_left_as_it_is(text: str) -> None:
    assert printable(text) == text


def test_a_long_text_ends_in_an_ellipsis_and_no_escape_is_cut() -> None:
    assert printable("x" * LONGEST_TEXT) == "x" * LONGEST_TEXT
    assert printable("x" * (LONGEST_TEXT + 1)) == "x" * (LONGEST_TEXT - 1) + ELLIPSIS
    assert printable("abc\x1bdef", 6) == "abc" + ELLIPSIS
    assert printable("\x1b", 1) == ELLIPSIS


@given(ANY_TEXT.filter(lambda name: "/" not in name and "\0" not in name))
def test_listed_names_are_short_printable_and_keep_their_suffix(name: str) -> None:
    for suffix in (".ply", ".x" + "\x1b" * 100):
        listed = listed_name(Path(f"a{name * 9}{suffix}"))
        assert len(listed) <= LONGEST_NAME
        assert printable(listed) == listed
        assert listed.endswith(".ply") or suffix != ".ply"


@given(ANY_TEXT)
def test_encodable_text_differs_in_surrogates_only(text: str) -> None:
    assert encodable(text).encode("utf-8").decode("utf-8") == encodable(text)
    assert encodable(text) == "".join(
        f"\\u{ord(letter):x}" if "\ud800" <= letter <= "\udfff" else letter for letter in text
    )


def test_anything_is_shown() -> None:
    assert shown(Path("a") / "b\t") == r"a/b\t"
    assert shown(7) == "7"
