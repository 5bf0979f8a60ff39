from __future__ import annotations

import string

import numpy as np
import pytest

from meshtide_codec.rendering.lettering import _GLYPHS, COLUMNS, ROWS, draw_text, text_width


def test_every_glyph_is_whole_and_no_two_are_alike() -> None:
    assert set(string.ascii_uppercase + string.digits) <= set(_GLYPHS)
    rows = [bytes.fromhex(glyph) for glyph in _GLYPHS.values()]
    assert {len(glyph) for glyph in rows} == {ROWS}
    assert all(row < 1 << COLUMNS for glyph in rows for row in glyph)
    assert len(set(rows)) == len(rows)


def test_a_letter_is_drawn_dot_by_dot() -> None:
    image = np.zeros((ROWS, COLUMNS, 3), np.uint8)
    draw_text(image, "t", 0, 0, colour=(255, 0, 0))
    assert ["".join("#" if dot else "." for dot in row) for row in image[:, :, 0]] == ["#####", *["..#.."] * 6]
    assert image[:, :, 1:].max() == 0


@pytest.mark.parametrize("scale", [1, 3])
def test_the_width_is_what_is_drawn(scale: int) -> None:
    image = np.zeros((40, 200, 3), np.uint8)
    draw_text(image, "MM", 10, 5, scale=scale, colour=(1, 1, 1))
    columns = np.flatnonzero(image.any(axis=(0, 2)))
    rows = np.flatnonzero(image.any(axis=(1, 2)))
    assert (columns[0], columns[-1]) == (10, 10 + text_width("MM", scale) - 1)
    assert (rows[0], rows[-1]) == (5, 5 + ROWS * scale - 1)


def test_what_does_not_fit_is_cut_off_and_unknown_letters_are_gaps() -> None:
    image = np.zeros((5, 9, 3), np.uint8)
    draw_text(image, "é88888", 0, 0, colour=(9, 9, 9))
    assert not image[:, :COLUMNS].any()
    assert image[:, COLUMNS + 1 :].any()
    draw_text(image, "", 0, 0, colour=(9, 9, 9))
