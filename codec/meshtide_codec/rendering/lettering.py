"""Captions for pictures: a few letters of five by seven dots, drawn into an array."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

ROWS = 7
COLUMNS = 5
_ADVANCE = COLUMNS + 1

# Seven rows a letter from top to bottom, each two hexadecimal digits whose five lowest bits are dots.
_GLYPHS = {
    "0": "0e11131519110e",
    "1": "040c040404040e",
    "2": "0e11010204081f",
    "3": "1f02040201110e",
    "4": "02060a121f0202",
    "5": "1f101e0101110e",
    "6": "0608101e11110e",
    "7": "1f010204080808",
    "8": "0e11110e11110e",
    "9": "0e11110f01020c",
    "A": "0e11111f111111",
    "B": "1e11111e11111e",
    "C": "0e11101010110e",
    "D": "1c12111111121c",
    "E": "1f10101e10101f",
    "F": "1f10101e101010",
    "G": "0e11101711110f",
    "H": "1111111f111111",
    "I": "0e04040404040e",
    "J": "0702020202120c",
    "K": "11121418141211",
    "L": "1010101010101f",
    "M": "111b1515111111",
    "N": "11111915131111",
    "O": "0e11111111110e",
    "P": "1e11111e101010",
    "Q": "0e11111115120d",
    "R": "1e11111e141211",
    "S": "0f10100e01011e",
    "T": "1f040404040404",
    "U": "1111111111110e",
    "V": "11111111110a04",
    "W": "1111111515150a",
    "X": "11110a040a1111",
    "Y": "1111110a040404",
    "Z": "1f01020408101f",
    ":": "000c0c000c0c00",
    ",": "000000000c0408",
    ".": "00000000000c0c",
    "-": "0000001f000000",
    "+": "0004041f040400",
    "=": "00001f001f0000",
    "/": "01010204081010",
    "(": "02040808080402",
    ")": "08040202020408",
    "%": "18190204081303",
    "_": "0000000000001f",
    " ": "00000000000000",
}


def text_width(text: str, scale: int = 1) -> int:
    """Pixels that `text` takes from left to right."""
    return max(0, len(text) * _ADVANCE - 1) * scale


def draw_text(image: Image, text: str, left: int, top: int, *, scale: int = 1, colour: tuple[int, int, int]) -> None:
    """Write `text` into an (h, w, 3) image, each dot `scale` pixels wide; what does not fit is cut off.

    Small letters become capitals; characters without a glyph leave a gap.
    """
    dots = np.zeros((ROWS, max(1, len(text) * _ADVANCE)), bool)
    for i, letter in enumerate(text.upper()):
        dots[:, i * _ADVANCE : i * _ADVANCE + COLUMNS] = _glyph(letter)
    large = np.kron(dots, np.ones((scale, scale), bool))
    target = image[top : top + large.shape[0], left : left + large.shape[1]]
    target[large[: target.shape[0], : target.shape[1]]] = colour


def _glyph(letter: str) -> NDArray[np.bool_]:
    rows = bytes.fromhex(_GLYPHS.get(letter, _GLYPHS[" "]))
    return np.unpackbits(np.frombuffer(rows, np.uint8)[:, None], axis=1)[:, -COLUMNS:].astype(bool)
