"""The words of a PLY file in text form as rows of 64-bit numbers, which are then read like those of a binary file.

Rows are a stream of words, however the lines are broken. A megabyte of text is looked at at a time, as `Words`, which
knows the lines of a whole text, would take several times its size. Cost: O(bytes).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import CONTROL, without_control
from meshtide_codec.mesh_files.ply.rows import RowReader, Stored
from meshtide_codec.mesh_files.text_numbers import BLANK, leading_numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.ply.header import PlyElement

CHUNK = 1 << 20
"""Bytes of text that are parsed at a time."""
_WORD_BYTES = 8
_TYPICAL_WORD = 10
_SHOWN = 40
_BLANKS = bytes(range(BLANK + 1))
_GAP = re.compile(rb"[\t-\r ]")
_LINE_ENDS = re.compile(rb"\r\n?|\n")


class PlyText:
    """The rows of a file in text form.

    Args:
        data: the whole file.
        at: where its rows begin.
    """

    def __init__(self, data: bytes, at: int) -> None:
        self.at = at
        self._data = data
        self._body = at

    def read(self, element: PlyElement) -> RowReader:
        """Take all rows of an element; they begin where those of the one before it ended.

        Raises:
            MeshFileError: they are fewer than declared, or a word is not a number.
        """
        types = [kind for one in element.properties for kind in (one.item, one.length) if kind is not None]
        kind: np.dtype[Any] = np.dtype(np.int64 if all(each.kind in "iu" for each in types) else np.float64)
        words: NDArray[Any] = np.zeros(0, kind)
        size = min(CHUNK, _TYPICAL_WORD * (element.count * (len(types) + 2) + 1))  # a short element of many: little
        reader = RowReader(element, _stored(element, kind), _WORD_BYTES)
        while reader.left:
            begin, end = self.at, self._cut(self.at + size)
            new, starts = self._parsed(begin, end, kind)
            if new.dtype != kind:  # a word that is not an integer: from here on all are doubles
                kind = new.dtype
                reader.stored = _stored(element, kind)
            words = np.concatenate([words.astype(kind, copy=False), new])
            wrong = len(new) < len(starts)
            used = reader.take(words.view(np.uint8), last=end == len(self._data) and not wrong) // _WORD_BYTES
            words = words[used:]
            if wrong and reader.left:
                self._refuse(begin + int(starts[len(new)]))
            size = max(size, CHUNK) if used else 2 * size
            rest = len(words) + len(starts) - len(new)
            self.at = end if reader.left or rest == 0 else begin + int(starts[len(starts) - rest])
        return reader

    def _refuse(self, place: int) -> NoReturn:
        word = self._data[place : self._cut(place)]
        shown = word[:_SHOWN].decode("ascii", "replace")
        control = "has a control byte and " if CONTROL.search(word) else ""
        raise MeshFileError(f"line {self._line_at(place)}: {shown!r} {control}is not a number")

    def rest(self) -> int:
        """How many bytes follow the last row, but for blanks."""
        return len(self._data[self.at :].strip(_BLANKS))

    def ends_with_a_line(self) -> bool:
        """Whether something stands after the last word, so that it is whole."""
        return self._data[-1:] in _BLANKS

    def line(self, word: int) -> int:
        """The number, from 1, of the file's line that the word of that number of the rows stands in."""
        at = self._body
        while at < len(self._data):
            end = self._cut(at + CHUNK)
            starts = _starts(np.frombuffer(self._data, np.uint8, end - at, at))
            if word < len(starts):
                return self._line_at(at + int(starts[word]))
            word -= len(starts)
            at = end
        return self._line_at(at)

    def _line_at(self, place: int) -> int:
        return 1 + sum(1 for _ in _LINE_ENDS.finditer(self._data, 0, place))

    def _cut(self, end: int) -> int:
        """The first place from there on that no word goes across."""
        found = _GAP.search(self._data, end)
        return len(self._data) if found is None else found.start()

    def _parsed(self, begin: int, end: int, kind: np.dtype[Any]) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """The numbers of a part of the text as far as its words are any, and where each word begins in it."""
        text = np.frombuffer(without_control(self._data[begin:end]), np.uint8)
        starts = _starts(text)
        return leading_numbers(text, starts, len(text), whole=kind.kind == "i"), starts


def _stored(element: PlyElement, kind: np.dtype[Any]) -> list[Stored]:
    return [Stored(kind, None if one.length is None else kind) for one in element.properties]


def _starts(text: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Where each word begins."""
    inside = text > BLANK
    begins = inside.copy()
    begins[1:] &= ~inside[:-1]
    return np.flatnonzero(begins)
