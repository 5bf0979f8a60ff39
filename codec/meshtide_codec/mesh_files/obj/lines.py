"""The lines of an OBJ file in blocks that fit a cache: found, distinguished, gathered by kind, all of it on arrays.

A line may be indented, end in CR, LF or both, go on in the next one after a backslash (which blanks may follow), and
end in a comment. Blocks are cut between lines, so what a block takes is bounded whatever the file's size is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import CONTROL, has_control
from meshtide_codec.mesh_files.text_numbers import BLANK, PADDING, padded

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

NOTHING, VERTEX, TEXCOORD, NORMAL, FACE, OTHER = range(6)
"""Kinds of lines: blank ones and comments, v, vt, vn, f (and fo), all others."""

_BLOCK = 1 << 17
_LONGEST = 1 << 24  # bytes of a line: a polygon of more than two million corners
_NEWLINE, _HASH, _BACKSLASH, _DOT, _F, _N, _O, _T, _V = b"\n#\\.fnotv"
_SHOWN = 60  # bytes of a line that a message shows
_LAST_END = re.compile(rb"[^\\ \t][ \t]*\n")  # of a line that does not go on


@dataclass(frozen=True, slots=True)
class Gathered:
    """The lines of one kind, without the words that begin them.

    Args:
        text: padded.
        starts: (k,) int64, where each line begins in the text.
        lines: (k,) int64, which line of the block each is.
    """

    text: NDArray[np.uint8]
    starts: NDArray[np.int64]
    lines: NDArray[np.int64]

    def counts(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many of the rising places in the text lie in each line (k,)."""
        each = len(places) // len(self.starts)
        if each and len(places) == each * len(self.starts):
            inside = (places[::each] >= self.starts).all() and (places[each - 1 : -1 : each] < self.starts[1:]).all()
            if inside:
                return np.full(len(self.starts), each)
        return np.diff(np.append(np.searchsorted(places, self.starts), len(places)))

    def line_at(self, place: int) -> int:
        """The line of the block that a place of the text is in."""
        return int(self.lines[np.searchsorted(self.starts, place, "right") - 1])


@dataclass(frozen=True, slots=True)
class Block:
    """Whole lines of a file.

    Args:
        text: padded; of lines of numbers the comments are blanked, as are the ends of lines that go on.
        starts: (k,) int64, where each line begins.
        heads: (k,) int64, where its first word begins.
        stops: (k,) int64, where it has ended.
        kinds: (k,) uint8.
        first: the number of the first line in the file, from 1.
        breaks: (j,) int64, where lines of the file end, if some of them go on in the next one.
    """

    text: NDArray[np.uint8]
    starts: NDArray[np.int64]
    heads: NDArray[np.int64]
    stops: NDArray[np.int64]
    kinds: NDArray[np.uint8]
    first: int
    breaks: NDArray[np.int64] | None

    def line_numbers(self, lines: NDArray[np.int64]) -> NDArray[np.int64]:
        """Which lines of the file some lines of the block are, from 1."""
        if self.breaks is None:
            return lines + self.first
        return np.searchsorted(self.breaks, self.starts[lines]) + self.first

    def line_number(self, line: int) -> int:
        """Which line of the file a line of the block is, from 1."""
        return int(self.line_numbers(np.array([line]))[0])

    def line(self, line: int, most: int | None = None) -> bytes:
        """A line from its first word on, without its end; no more than `most` bytes."""
        stop = self.stops[line] if most is None else min(self.stops[line], self.heads[line] + most)
        return self.text[self.heads[line] : stop].tobytes()

    def gathered(self, kind: int) -> Gathered | None:
        """The lines of one kind; None if there are none."""
        chosen = self.kinds == kind
        lines = np.flatnonzero(chosen)
        if len(lines) == 0:
            return None
        sizes = self.stops - self.starts + 1
        first, last = lines[0], lines[-1]
        if last - first + 1 == len(lines):
            piece = self.text[self.starts[first] : self.stops[last]]
            starts = self.starts[lines] - (self.starts[first] - PADDING)
        else:
            low, high = self.starts[first], self.stops[last] + 1
            piece = self.text[low:high][np.repeat(chosen[first : last + 1], sizes[first : last + 1])]
            starts = np.cumsum(sizes[lines]) - sizes[lines] + PADDING
        text = padded(piece)
        heads = starts + (self.heads[lines] - self.starts[lines])
        text[heads] = BLANK
        if kind in {TEXCOORD, NORMAL, FACE}:
            text[heads + 1] = BLANK  # the second letter, or the blank in its place
        return Gathered(text, starts, lines)


def blocks(data: bytes) -> Iterator[Block]:
    """The lines of a text from `plain_text`, none left out, none cut.

    Raises:
        MeshFileError: a line has no end or one too far away, or a control byte outside comments and names.
    """
    start = 0
    line = 1
    while start < len(data):
        end = _end_of_block(data, start)
        if end - start > _BLOCK + _LONGEST:
            number = line + data.count(b"\n", start, start + _BLOCK)
            raise MeshFileError(f"line {number} or one beside it is longer than {_LONGEST} bytes, which no face needs")
        piece = data[start:end]
        yield _block(piece, line)
        line += piece.count(b"\n")
        start = end


def _end_of_block(data: bytes, start: int) -> int:
    """Where a block that begins at `start` ends: behind a line that does not go on."""
    if len(data) - start <= _BLOCK:
        return len(data)
    end = data.rfind(b"\n", start, start + _BLOCK) + 1 or data.find(b"\n", start + _BLOCK) + 1
    if end and _goes_on(data, start, end - 1):
        last = _LAST_END.search(data, end - 1)
        return last.end() if last else len(data)
    return end or len(data)


def _goes_on(data: bytes, start: int, stop: int) -> bool:
    """Whether the line that ends at `stop` goes on in the next one."""
    line = max(data.rfind(b"\n", start, stop) + 1, start)
    return data[line:stop].rstrip(b" \t").endswith(b"\\")


def _block(piece: bytes, first: int) -> Block:
    text = padded(piece)
    ends = np.flatnonzero(text == _NEWLINE)
    breaks = None
    if b"\\" in piece:
        _join(text, ends)
        breaks, ends = ends, np.flatnonzero(text == _NEWLINE)
    whole = len(ends) > 0 and ends[-1] == PADDING + len(piece) - 1
    stops = ends if whole else np.append(ends, PADDING + len(piece))
    starts = np.empty_like(stops)
    starts[0] = PADDING
    starts[1:] = stops[:-1] + 1
    heads = _first_words(text, starts, stops)
    kinds = _kinds(text, heads)
    block = Block(text, starts, heads, stops, kinds, first, breaks)
    hashes = np.flatnonzero(text == _HASH)
    if len(hashes):
        _blank_comments(block, hashes)
    if has_control(text):
        _refuse_control(block)
    return block


def _join(text: NDArray[np.uint8], ends: NDArray[np.int64]) -> None:
    """Blank the ends of lines that go on in the next one; a comment does not."""
    filled = np.append(np.flatnonzero(text > BLANK), len(text) - 1)
    starts = np.append(PADDING, ends[:-1] + 1)[: len(ends)]
    place = np.searchsorted(filled, ends)
    last, first = filled[place - 1], filled[np.searchsorted(filled, starts)]
    joined = np.flatnonzero((place > 0) & (last >= starts) & (text[last] == _BACKSLASH) & (text[first] != _HASH))
    _blank(text, last[joined], ends[joined] + 1)


def _blank(text: NDArray[np.uint8], starts: NDArray[np.int64], ends: NDArray[np.int64]) -> None:
    """Blank spans of a text, which do not overlap."""
    change = np.zeros(len(text), np.int8)
    change[starts] += 1
    change[ends] -= 1
    text[np.cumsum(change, dtype=np.int8).view(np.bool_)] = BLANK


def _first_words(text: NDArray[np.uint8], starts: NDArray[np.int64], stops: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where the first word of each line begins, or its end if it has none."""
    indented = np.flatnonzero((text[starts] <= BLANK) & (starts < stops))
    if len(indented) == 0:
        return starts
    filled = np.append(np.flatnonzero(text > BLANK), len(text))
    heads = starts.copy()
    heads[indented] = np.minimum(filled[np.searchsorted(filled, starts[indented])], stops[indented])
    return heads


def _kinds(text: NDArray[np.uint8], heads: NDArray[np.int64]) -> NDArray[np.uint8]:
    first, second, third = text[heads], text[heads + 1], text[heads + 2]
    alone = second <= BLANK
    pair = (third <= BLANK) & ~alone
    kinds = np.full(len(heads), OTHER, np.uint8)
    kinds[(first <= BLANK) | (first == _HASH)] = NOTHING
    vertex, face = first == _V, first == _F
    kinds[vertex & alone] = VERTEX
    kinds[vertex & pair & (second == _T)] = TEXCOORD
    kinds[vertex & pair & (second == _N)] = NORMAL
    kinds[face & (alone | (pair & (second == _O)))] = FACE
    return kinds


def _blank_comments(block: Block, hashes: NDArray[np.int64]) -> None:
    """Blank the comments of lines of numbers, but keep 1.#INF and 1.#QNAN, as some libraries print numbers."""
    lines = np.searchsorted(block.starts, hashes, "right") - 1
    kinds = block.kinds[lines]
    chosen = (kinds != NOTHING) & (kinds != OTHER) & (block.text[hashes - 1] != _DOT)
    lines, first = np.unique(lines[chosen], return_index=True)
    _blank(block.text, hashes[chosen][first], block.stops[lines])


def _refuse_control(block: Block) -> None:
    """Refuse control bytes but in comments, and behind the first word of lines that are not of numbers.

    Raises:
        MeshFileError: there is one.
    """
    places = np.array([found.start() for found in CONTROL.finditer(block.text.tobytes())])
    lines, first = np.unique(np.searchsorted(block.starts, places, "right") - 1, return_index=True)
    for line, place in zip(lines.tolist(), places[first].tolist(), strict=True):
        kind, before = block.kinds[line], block.text[block.starts[line] : place].tobytes()
        if (kind == NOTHING and b"#" in before) or (kind == OTHER and len((before + b"?").split(None, 1)) > 1):
            continue
        shown = block.text[block.starts[line] : block.stops[line]].tobytes()[:_SHOWN].decode("utf-8", "replace")
        code = int(block.text[place])
        message = f"a control byte ({code:#04x}) is in it; the file is damaged, or in another encoding than UTF-8"
        raise MeshFileError(f"line {block.line_number(line)}, {shown!r}: {message}")
