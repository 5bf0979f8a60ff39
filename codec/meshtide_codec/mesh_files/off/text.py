"""OFF in text form: a stream of words, in which line ends matter only where colours leave a row's length open.

How the rows are found:

1. *Vertices.* Where each vertex has a line of its own, all of one length, that length shows whether a colour of three
   or four values stands on it, announced by the keyword or not (many programs write colours into plain OFF files).
   Otherwise the vertices are words, as many as the keyword says; an announced colour has four of them, or three
   where the faces make no sense after four.
2. *Faces.* Where they begin with a line, a colour ends with its line: what follows the last corner on the corner's
   line is the face's colour, if all faces are complete then and each has 0, 1, 3 or 4 such words. Otherwise nothing
   is a colour and each face follows the last corner of the one before it, wherever lines end, to the last word. If
   that fails too and each face has a line, what follows its corners is left out, and reported.
3. The number of edges, which has no use, may be missing where the counts stand on a line of their own.

The first way that gives as many faces as declared, with all corners in range, is taken; if none does, the error is
that of the first. What follows the last face is left out, and reported.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import refuse_control
from meshtide_codec.mesh_files.off.rows import OffRows, check_corners, check_triangles, pieces
from meshtide_codec.mesh_files.words import Words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.off.rows import OffKeyword

_COUNTS = re.compile(rb"\s*\+?(\d{1,18})(?!\S)(\s+)\+?(\d{1,18})(?!\S)([^\S\n]+\S+)?([^\S\n]*\n)?")
_DIMENSION = re.compile(rb"\s*(\d{1,9})(?!\S)")
_COLOR_SIZES = (0, 1, 3, 4)


def read_text_rows(text: bytes, offset: int, keyword: OffKeyword, limits: FileLimits) -> OffRows:
    """The rows of an OFF file.

    Args:
        text: of the file, without comments, its lines ended by line feeds.
        offset: of the first byte behind the keyword.
        keyword: of the file.
        limits: what it may claim.

    Raises:
        MeshFileError: it holds less than it declares, or something else than numbers, or claims too much.
    """
    if keyword.dimension:
        dimension = _DIMENSION.match(text, offset)
        if dimension is None:
            raise MeshFileError("the keyword announces the dimension of the space, but no number follows it")
        check_dimension(int(dimension[1]))
        offset = dimension.end()
    counts = _COUNTS.match(text, offset)
    if counts is None:
        line = text.count(b"\n", 0, offset) + 1
        raise MeshFileError(f"line {line} or the next: the OFF file does not say how many vertices and faces it has")
    refuse_control(text, counts.end())
    vertices, faces = int(counts[1]), int(counts[3])
    limits.check_counts(vertices, faces)
    own_line = b"\n" not in counts[2] and counts[5] is not None and counts[4] is None
    words = Words(text, counts.end())
    first_error: MeshFileError | None = None
    for skipped in _edge_words(words, with_edges=counts[4] is not None, own_line=own_line):
        for width, lines in _widths(words, skipped, vertices, keyword):
            try:
                rows = _rows(words, skipped, (vertices, faces), (width, lines), keyword, limits)
            except MeshFileError as error:
                first_error = first_error or error
                continue
            if not text.endswith(b"\n"):
                note = "its last line has no end: if the file was cut off there, its last row may be wrong"
                return replace(rows, notes=(*rows.notes, note))
            return rows
    refuse_control(text, len(text))
    _refuse_short_rows(words, vertices, faces, keyword)
    raise first_error or MeshFileError("the OFF file ends behind its counts")


def _refuse_short_rows(words: Words, vertices: int, faces: int, keyword: OffKeyword) -> None:
    """Name the first vertex that has too few values, in a file that cannot be read and has a line for each row.

    Raises:
        MeshFileError: there is one.
    """
    lines = words.first[-(vertices + faces) :]
    short = np.flatnonzero(np.diff(lines, append=words.count)[:vertices] < keyword.width)
    if len(words.first) - len(lines) <= 1 and len(lines) == vertices + faces and len(short):
        line = words.line(int(lines[short[0]]))
        raise MeshFileError(f"line {line}: vertex {short[0]} of the OFF file has fewer than {keyword.width} numbers")


def check_dimension(dimension: int) -> None:
    """Refuse spaces of other dimensions than three.

    Raises:
        MeshFileError: it is one.
    """
    if dimension != 3:
        raise MeshFileError(f"its points have {dimension} dimensions (nOFF); only those of 3 can be read")


def _edge_words(words: Words, *, with_edges: bool, own_line: bool) -> tuple[int, ...]:
    """How many words behind the two counts are the number of edges: which to try, in this order."""
    if with_edges:
        return (0,)
    alone = len(words.first) > 1 and int(words.first[1]) == 1
    return (0, 1) if own_line and not alone else (1,)


def _widths(words: Words, skipped: int, vertices: int, keyword: OffKeyword) -> Iterator[tuple[int, bool]]:
    """How many words a vertex may have, and whether its line ends behind them; the likeliest first."""
    plain = keyword.width
    lines = words.first[words.first >= skipped][: vertices + 1]
    if len(lines) >= vertices > 0 and int(lines[0]) == skipped:
        ends = lines if len(lines) > vertices else np.append(lines, words.count)
        lengths = np.diff(ends)
        if len(lengths) and lengths.min() >= plain:
            yield (int(lengths[0]) if (lengths == lengths[0]).all() else plain), True
    if keyword.color:
        yield plain + 4, False
        yield plain + 3, False
    else:
        yield plain, False


def _rows(
    words: Words,
    skipped: int,
    declared: tuple[int, int],
    layout: tuple[int, bool],
    keyword: OffKeyword,
    limits: FileLimits,
) -> OffRows:
    vertices, faces = declared
    width, lines = layout
    notes: list[str] = []
    first = words.first[words.first >= skipped]
    if lines:
        behind = int(first[vertices]) if len(first) > vertices else words.count
        uniform = behind - skipped == vertices * width
    else:
        behind, uniform = skipped + vertices * width, True
    if behind + faces > words.count:
        held = words.count - skipped
        message = f"it declares {vertices} vertices and {faces} faces, but only {held} numbers follow"
        raise MeshFileError(f"the OFF file is cut short: {message}")
    table = words.numbers(skipped, behind)
    if not uniform:
        table = table[(first[:vertices, None] - skipped) + np.arange(width)]
        notes.append(
            f"lines of vertices have more than the {width} words that the keyword announces: the rest is left out"
        )
    table = table.reshape(vertices, width)
    colors = width - keyword.width
    if colors not in {0, 3, 4}:
        place = 3 + keyword.homogeneous + 3 * keyword.normal
        table = np.delete(table, np.s_[place : place + colors], axis=1)
        notes.append(f"each vertex has {colors} values that are not a colour: left out")
        colors = 0
    counts, corners, color_counts, color_values = _faces(words, behind, faces, vertices, limits, notes)
    return OffRows(table, colors, counts, corners, color_counts, color_values, tuple(notes))


def _faces(
    words: Words, start: int, faces: int, vertices: int, limits: FileLimits, notes: list[str]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Corners of each face, all corners, values of each face's colour, all of these."""
    values = words.leading(start, words.count)
    stop = start + len(values)  # what is not a number may stand behind the last face
    breaks = words.first[(words.first > start) & (words.first < stop)].astype(np.int64) - start
    lines = np.concatenate([np.zeros(min(1, len(values)), np.int64), breaks])

    def place(face: int) -> str:
        return f"line {words.line(start + int(begins[face]))}: "

    error: MeshFileError | None = None
    ways: tuple[Callable[[_Values, NDArray[np.int64], int], _Layout], ...] = (_by_words,)
    if start in words.first or faces == 0:
        ways = (_by_lines, _by_line_ends, _by_words, _by_longer_lines)
    for way in ways:
        try:
            begins, counts, color_counts = way(values, lines, faces)
            check_triangles(counts, limits)
            corners = _whole(_corners(values, begins, counts))
            check_corners(counts, corners, vertices, place)
            break
        except _OtherwiseError:
            continue
        except MeshFileError as wrong:
            error = error or wrong
    else:
        if stop < words.count:
            words.refuse(stop)
        raise error or MeshFileError("the faces of the OFF file are not understood")
    end = int(begins[-1] + 1 + counts[-1] + color_counts[-1]) if faces else 0
    kept = np.isin(color_counts, _COLOR_SIZES)
    if not kept.all():
        notes.append(f"{int((~kept).sum())} faces have something behind their corners that is not a colour: left out")
        color_counts = np.where(kept, color_counts, 0)
    colors = values[pieces(begins + 1 + counts, color_counts)].astype(np.float64)
    if start + end < words.count:
        notes.append(f"{words.count - start - end} words follow the last face: left out")
    return counts, corners, color_counts, colors


def _corners(values: _Values, begins: NDArray[np.int64], counts: NDArray[np.int64]) -> _Values:
    """The corners of faces; those of rows of one length are taken at once, in less memory."""
    size = int(counts[0]) + 1 if len(counts) else 1
    if (counts == size - 1).all() and (begins == np.arange(len(counts)) * size).all():
        return values[: len(counts) * size].reshape(-1, size)[:, 1:].reshape(-1)
    return values[pieces(begins + 1, counts)]


class _OtherwiseError(Exception):
    """The words are not set in this way."""


_Values = NDArray[np.float64] | NDArray[np.int64]
_Layout = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
"""Of each face where its row begins, how many corners it has, and how many words follow these."""


def _by_lines(values: _Values, lines: NDArray[np.int64], faces: int) -> _Layout:
    """Each face has a line, with a colour or none."""
    begins, counts, rest = _by_longer_lines(values, lines, faces)
    if not np.isin(rest, _COLOR_SIZES).all():
        raise _OtherwiseError
    return begins, counts, rest


def _by_longer_lines(values: _Values, lines: NDArray[np.int64], faces: int) -> _Layout:
    """Each face has a line, with anything behind its corners."""
    if len(lines) < faces:
        raise _OtherwiseError
    begins, ends = lines[:faces], np.append(lines, len(values))[1 : faces + 1]
    counts = _whole(values[begins])
    rest = ends - begins - 1 - counts
    short = np.flatnonzero((rest < 0) | (counts < 1))
    if len(short) and len(lines) == faces:
        raise MeshFileError(f"face {short[0]} of the OFF file has fewer corners than it announces, or none")
    if len(short):
        raise _OtherwiseError
    return begins, counts, rest


def _by_line_ends(values: _Values, lines: NDArray[np.int64], faces: int) -> _Layout:
    """Corners may stand on several lines; the last one's line ends with the colour."""
    ends = [*lines.tolist(), len(values)]
    rows = np.zeros((faces, 3), np.int64)
    begin = 0
    for face in range(faces):
        count = _count(values, begin)
        if count is None:
            raise _OtherwiseError
        behind = begin + 1 + count
        end = ends[bisect_right(ends, behind - 1)]
        if end - behind not in _COLOR_SIZES:
            raise _OtherwiseError
        rows[face] = begin, count, end - behind
        begin = end
    return rows[:, 0], rows[:, 1], rows[:, 2]


def _by_words(values: _Values, _lines: NDArray[np.int64], faces: int) -> _Layout:
    """Each face follows the last corner of the one before it."""
    none = np.zeros(faces, np.int64)
    first = (_count(values, 0) or 0) + 1
    if len(values) == first * faces and (values[: first * faces : first] == first - 1).all():
        return np.arange(faces) * first, none + (first - 1), none
    rows = np.zeros((faces, 2), np.int64)
    begin = 0
    for face in range(faces):
        count = _count(values, begin)
        if count is None:
            raise MeshFileError(f"the OFF file is cut short: {faces} faces are declared, face {face} is not complete")
        rows[face] = begin, count
        begin += 1 + count
    if begin < len(values):
        raise MeshFileError(f"{len(values) - begin} numbers follow the last face of the OFF file, on its line")
    return rows[:, 0], rows[:, 1], none


def _count(values: _Values, place: int) -> int | None:
    """The number of corners that stands there, if it is one and as many values follow."""
    if place >= len(values) or not 1 <= values[place] < len(values) - place or values[place] % 1:
        return None
    return int(values[place])


def _whole(values: _Values) -> NDArray[np.int64]:
    if values.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero(~(np.abs(values) < 1 << 53) | (values % 1 != 0))
        if len(bad):
            raise MeshFileError(
                f"a face of the OFF file has {values[bad[0]]} for a corner, which is not a whole number"
            )
    return values.astype(np.int64)
