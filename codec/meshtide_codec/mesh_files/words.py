"""The words of a text file and the lines that they stand on: found at once, made to numbers in blocks.

Where each word starts and which word starts each line are found by comparing bytes as arrays; `text_numbers` makes the
numbers. Cost: linear in the text.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import CONTROL, without_control
from meshtide_codec.mesh_files.text_numbers import BLANK, leading_numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

_INT32 = 1 << 31


class Words:
    r"""The words of a text.

    Args:
        text: in ASCII, its lines ended by line feeds.
        offset: the byte that the first word starts at, or a blank before it.

    >>> words = Words(b"OFF\n1 2.5\n\n3", 3)
    >>> words.count, words.first.tolist(), words.numbers(0, 2).tolist(), words.line(2)
    (3, [0, 2], [1.0, 2.5], 4)
    """

    def __init__(self, text: bytes, offset: int = 0) -> None:
        self.text = text
        self._raw = np.frombuffer(without_control(text), np.uint8)
        raw = self._raw[offset:]
        begins = raw > BLANK
        begins[1:] &= raw[:-1] <= BLANK
        kind = np.int32 if len(text) < _INT32 else np.int64
        self.starts: NDArray[np.signedinteger] = np.flatnonzero(begins).astype(kind)
        """(count,) where each word starts, in bytes of `text`."""
        del begins
        breaks = np.flatnonzero(raw == ord("\n")).astype(kind)
        first: NDArray[np.signedinteger] = np.searchsorted(self.starts, breaks).astype(kind)
        del breaks
        first = np.concatenate([np.zeros(1, first.dtype), first])
        following = np.append(first[1:], len(self.starts))
        self.first: NDArray[np.signedinteger] = first[first < following]
        """(lines,) the first word of each line that has one."""
        self.starts += offset
        self.count = len(self.starts)

    def numbers(self, start: int, stop: int) -> NDArray[np.float64]:
        """Words `start` to `stop` as numbers.

        Raises:
            MeshFileError: one is none; it is named with its line.
        """
        values = leading_numbers(self._raw, self.starts[start:stop], self._end(stop))
        if len(values) < stop - start:
            self.refuse(start + len(values))
        return values.astype(np.float64, copy=False)

    def leading(self, start: int, stop: int) -> NDArray[np.float64] | NDArray[np.int64]:
        """The same up to the first word that is none, as integers where all of them are."""
        return leading_numbers(self._raw, self.starts[start:stop], self._end(stop), whole=True)

    def refuse(self, word: int) -> NoReturn:
        """Say that a word is not a number.

        Raises:
            MeshFileError: always.
        """
        found = self.text[int(self.starts[word]) : self._end(word + 1)].split(maxsplit=1)[0]
        shown = found[:40].decode("ascii", "replace")
        control = ", which has a control byte," if CONTROL.search(found) else ""
        raise MeshFileError(f"line {self.line(word)}: a number is missing where {shown!r}{control} stands")

    def line(self, word: int) -> int:
        """The line that a word stands on, from 1; of the word after the last one, that of the end."""
        end = int(self.starts[word]) if word < self.count else len(self.text)
        return self.text.count(b"\n", 0, end) + 1

    def _end(self, stop: int) -> int:
        """Where the words before `stop` have ended."""
        return int(self.starts[stop]) if stop < self.count else len(self.text)


def without_comments(text: bytes) -> bytes:
    r"""The text without what follows a # on its line.

    >>> without_comments(b"1 # one\n2")
    b'1 \n2'
    """
    return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text
