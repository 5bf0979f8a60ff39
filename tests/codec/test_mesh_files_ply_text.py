"""Words of PLY files in text form: how they are broken into lines, what is a number, where an error is."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.ply import text as ply_text
from meshtide_codec.mesh_files.ply.header import PlyElement, PlyProperty
from meshtide_codec.mesh_files.ply.text import PlyText

LEVEL = PlyProperty("level", np.dtype("f8"))
NUMBER = PlyProperty("number", np.dtype("i4"))
INDICES = PlyProperty("indices", np.dtype("i4"), np.dtype("u1"))


def element(count: int, *properties: PlyProperty) -> PlyElement:
    return PlyElement("some", count, list(properties))


@pytest.mark.parametrize("chunk", [1, 5, 30, 1 << 20])
def test_elements_follow_each_other_wherever_pieces_end(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ply_text, "CHUNK", chunk)
    data = b"head\n 1.5 -2e1\n\n.25 3 1 2\r\n3 0\t2 4 5 7 8 9 the end\n"
    text = PlyText(data, 5)
    assert text.read(element(3, LEVEL)).columns().scalars["level"].tolist() == [1.5, -20, 0.25]
    column = text.read(element(3, INDICES)).columns().lists["indices"]
    assert column.counts.tolist() == [3, 0, 2]
    assert column.items.tolist() == [1, 2, 3, 4, 5]
    numbers = text.read(element(3, NUMBER)).columns().scalars["number"]
    assert (numbers.tolist(), numbers.dtype) == ([7, 8, 9], np.int32)
    assert text.rest() == len("the end")


def test_a_short_element_costs_little_of_a_long_text(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[int] = []
    parse = PlyText._parsed
    monkeypatch.setattr(PlyText, "_parsed", lambda self, a, b, kind: parsed.append(b - a) or parse(self, a, b, kind))
    text = PlyText(b"1 2 3\n" * 100_000, 0)
    for _ in range(100):
        text.read(element(1, NUMBER))
    assert sum(parsed) < 100 * 100


def test_a_long_list_is_parsed_in_growing_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ply_text, "CHUNK", 16)
    parsed: list[int] = []
    parse = PlyText._parsed
    monkeypatch.setattr(PlyText, "_parsed", lambda self, a, b, kind: parsed.append(b - a) or parse(self, a, b, kind))
    kind = PlyProperty("indices", np.dtype("i4"), np.dtype("i4"))
    data = b"20000 " + b" ".join(b"%d" % at for at in range(20_000))
    column = PlyText(data, 0).read(element(1, kind)).columns().lists["indices"]
    assert column.items.reshape(-1).tolist() == list(range(20_000))
    assert len(parsed) < 20
    assert sum(parsed) <= len(data)


@pytest.mark.parametrize(
    ("word", "value"),
    [
        (b"+1", 1.0),
        (b"1.", 1.0),
        (b"1E-3", 0.001),
        (b"0.1234567890123456789", 0.1234567890123456789),
        (b"inf", np.inf),
        (b"-Infinity", -np.inf),
        (b"1.#INF", np.inf),
        (b"-1.#inf", -np.inf),
        (b"nan", np.nan),
        (b"-NaN", np.nan),
        (b"-1.#IND", np.nan),
        (b"1.#QNAN", np.nan),
        (b"-nan(ind)", np.nan),
    ],
)
def test_words_that_are_numbers(word: bytes, value: float) -> None:
    found = PlyText(b"1 " + word + b" 2", 0).read(element(3, LEVEL)).columns().scalars["level"]
    assert np.array_equal(found, [1, value, 2], equal_nan=True)


@pytest.mark.parametrize("word", [b"x", b"1_0", b"0x10", b"1,5", b"1-2", b"--1", b"1e", b"\xff", b"\0", b"."])
@pytest.mark.parametrize("kind", [LEVEL, NUMBER])
def test_words_that_are_none(word: bytes, kind: PlyProperty) -> None:
    for line_end in (b"\n", b"\r", b"\r\n"):
        text = PlyText(b"head\n\n".replace(b"\n", line_end) + b"1" + line_end + word + b" 2", 6)
        with pytest.raises(MeshFileError, match="line 4: .* is not a number"):
            text.read(element(3, kind))
    text = PlyText(b"1 2 3 " + word, 0)
    text.read(element(3, kind))
    assert text.rest() == len(word.strip(b"\0"))


def test_integers_are_exact_and_others_doubles() -> None:
    wide = PlyProperty("wide", np.dtype("i8"))
    assert PlyText(b"9007199254740993 -5", 0).read(element(2, wide)).columns().scalars["wide"].tolist() == [
        2**53 + 1,
        -5,
    ]
    reader = PlyText(b"1 99999999999999999999", 0).read(element(2, wide))
    assert reader.columns().scalars["wide"].tolist() == [1, 1e20]
    assert reader.inexact == {"wide"}
    assert PlyText(b"1.0 2e1", 0).read(element(2, NUMBER)).columns().scalars["number"].tolist() == [1, 20]


def test_a_fraction_after_many_integers_makes_doubles_of_those_that_follow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ply_text, "CHUNK", 8)
    monkeypatch.setattr(ply_text, "_TYPICAL_WORD", 1)
    reader = PlyText(b"1 2 3 4 5 6 7.5 8", 0).read(element(8, NUMBER))
    assert reader.columns().scalars["number"].tolist() == [1, 2, 3, 4, 5, 6, 7.5, 8]
    assert reader.inexact == {"number"}


def test_the_line_of_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ply_text, "CHUNK", 4)
    for line_end in (b"\n", b"\r", b"\r\n"):
        head = b"a\nb\n".replace(b"\n", line_end)
        text = PlyText(head + b"1 2\n\n3\n4 5".replace(b"\n", line_end), len(head))
        assert [text.line(word) for word in range(5)] == [3, 3, 5, 6, 6]


def test_the_end_of_the_last_line() -> None:
    assert PlyText(b"1 2\n", 0).ends_with_a_line()
    assert PlyText(b"1 2\x1a", 0).ends_with_a_line()
    assert not PlyText(b"1 2", 0).ends_with_a_line()
