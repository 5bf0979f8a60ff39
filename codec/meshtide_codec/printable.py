"""Text of others, made safe to show: names of files, words of a peer, lines of a log.

What steers a terminal or turns lines around is written as a backslash escape: control characters (C0, C1 and DEL),
line and paragraph separators, surrogates (bytes of a name that are not UTF-8), and the marks that set the direction of
writing (Unicode Standard Annex 9; "Trojan Source", Boucher and Anderson, 2021). All else is left as it is.
"""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

from meshtide_codec.file_suffix import split_name

if TYPE_CHECKING:
    from pathlib import Path

LONGEST_TEXT = 1000
"""Characters that `printable` shows by default: a path of a few folders, or a message, in full."""

LONGEST_NAME = 200
"""Characters of a file's name that servers take."""
LONGEST_SUFFIX = 20

ELLIPSIS = "…"

_UNSAFE_CATEGORIES = frozenset({"Cc", "Cs", "Zl", "Zp"})
_DIRECTION_MARKS = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    r"""`text` in one line that no terminal obeys, at most `longest` characters of it, an ellipsis for the rest.

    No escape is cut through. What is printable already is given back unchanged, so it may be done twice.

    >>> print(printable("a\x1b[31mb\n\u202eply.exe \udcff Käse"))
    a\x1b[31mb\n\u202eply.exe \udcff Käse
    >>> printable("abcdef", longest=4)
    'abc…'
    """
    shown: list[str] = []
    length = 0
    for character in text[: longest + 1]:
        piece = _escaped(character) if _is_unsafe(character) else character
        shown.append(piece)
        length += len(piece)
    if length <= longest:
        return "".join(shown)
    while shown and length > longest - len(ELLIPSIS):
        length -= len(shown.pop())
    return "".join(shown) + ELLIPSIS


def _is_unsafe(character: str) -> bool:
    return character in _DIRECTION_MARKS or unicodedata.category(character) in _UNSAFE_CATEGORIES


def _escaped(character: str) -> str:
    """The backslash escape of one character, as Python writes it."""
    return character.encode("unicode_escape").decode("ascii")


def shown(name: object) -> str:
    r"""The name of a file, or any other text, as `printable` shows it.

    >>> from pathlib import Path
    >>> print(shown(Path("scans") / "a\nb.ply"))
    scans/a\nb.ply
    """
    return printable(str(name))


def listed_name(path: Path) -> str:
    r"""The name of a file as listings and catalogues have it: printable, with its suffix, `LONGEST_NAME` at most.

    >>> from pathlib import Path
    >>> print(listed_name(Path("scans/a\nb.ply")))
    a\nb.ply
    """
    stem, suffix = split_name(path)
    suffix = printable(suffix, LONGEST_SUFFIX)
    return printable(stem, LONGEST_NAME - len(suffix)) + suffix


def encodable(text: str) -> str:
    r"""`text` with nothing escaped but surrogates, which neither UTF-8 nor strict readers of JSON take.

    >>> print(encodable("a\udcff ü"))
    a\udcff ü
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
