"""The corners of OBJ faces, `v`, `v/vt`, `v//vn` or `v/vt/vn`, from text to arrays of indices, many at a time.

Each run of digits in the text is the first, second or third index of a corner, by what comes before it: a blank,
one slash or two. Cost: linear in the text.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh_files.text_numbers import (
    BLANK,
    TOO_LARGE,
    NotANumber,
    Runs,
    digit_runs,
    padded,
    values_of_runs,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

VERTEX, TEXCOORD, NORMAL = 0, 1, 2
_MINUS, _SLASH = b"-/"


@dataclass(frozen=True, slots=True)
class Corners:
    """Corners of faces as they are written.

    Args:
        places: (k,) int64, where each begins in the text, a sign left out.
        indices: three of (k,) int64, of vertex, texture coordinates and normal: from 1, or negative where they count
            back; 0 where a corner has none. None where no corner has one.
    """

    places: NDArray[np.int64]
    indices: tuple[NDArray[np.int64], NDArray[np.int64] | None, NDArray[np.int64] | None]


def read_corners(text: NDArray[np.uint8]) -> Corners:
    """The corners in a padded text of nothing else; slashes that nothing follows are blanked in it.

    Raises:
        NotANumber: a word is not a corner.
        ZeroIndexError: an index is 0.

    >>> from meshtide_codec.mesh_files.text_numbers import padded
    >>> [None if one is None else one.tolist() for one in read_corners(padded(b"1/2 -1/3 4")).indices]
    [[1, -1, 4], [2, 3, 0], None]
    """
    runs = digit_runs(text)
    sizes = runs.ends - runs.starts
    kinds = _kinds(text, runs, sizes)
    if kinds is None:
        _blank_last_slashes(text)
        kinds = _kinds(text, runs, sizes)
    values = values_of_runs(text, runs.starts, sizes)
    if kinds is None or (values == TOO_LARGE).any():
        raise NotANumber(_first_bad_word(text))
    indices = values.view(np.int64)
    zeros = np.flatnonzero(indices == 0)
    if len(zeros):
        raise ZeroIndexError(int(runs.starts[zeros[0]]))
    np.negative(indices, out=indices, where=runs.before == _MINUS)
    if not kinds.any():
        return Corners(runs.starts, (indices, None, None))
    return _sorted_by_kind(runs.starts, indices, kinds)


class ZeroIndexError(NotANumber):
    """An index is 0; those of OBJ begin at 1."""


def _kinds(text: NDArray[np.uint8], runs: Runs, sizes: NDArray[np.int64]) -> NDArray[np.int8] | None:
    """Which index of its corner each run of digits is; None where the text holds anything else."""
    negative = runs.before == _MINUS
    signs = int(np.count_nonzero(negative))
    begins = runs.starts - negative if signs else runs.starts
    lead = text[begins - 1] if signs else runs.before
    joined = lead == _SLASH
    inner = np.flatnonzero(joined)
    if np.count_nonzero(lead <= BLANK) + len(inner) != len(sizes):
        return None
    filled = np.count_nonzero(text > BLANK) - int(sizes.sum()) - signs
    kinds = np.zeros(len(sizes), np.int8)
    if len(inner) == 0:
        return kinds if filled == 0 else None
    double = text[begins[inner] - 2] == _SLASH
    if inner[0] == 0 or filled != len(inner) + np.count_nonzero(double):
        return None
    if (runs.ends[inner - 1] + 1 + double != begins[inner]).any():
        return None
    kinds[inner] = np.where(double, NORMAL, TEXCOORD)
    third = ~double & joined[inner - 1]
    kinds[inner[third]] = NORMAL
    before = kinds[inner - 1]
    right = np.where(third, before == TEXCOORD, before == VERTEX)
    return kinds if right.all() else None


def _sorted_by_kind(starts: NDArray[np.int64], indices: NDArray[np.int64], kinds: NDArray[np.int8]) -> Corners:
    heads = np.flatnonzero(kinds == VERTEX)
    period = int(heads[1]) if len(heads) > 1 else len(kinds)
    found: list[NDArray[np.int64] | None] = [None, None]
    if len(kinds) % period == 0 and (kinds.reshape(-1, period) == kinds[:period]).all():  # all corners are alike
        for place in range(1, period):
            found[kinds[place] - 1] = indices[place::period]
        return Corners(starts[::period], (indices[::period], found[0], found[1]))
    corner = np.cumsum(kinds == VERTEX) - 1
    for kind in (TEXCOORD, NORMAL):
        chosen = np.flatnonzero(kinds == kind)
        if len(chosen):
            table = np.zeros(len(heads), np.int64)
            table[corner[chosen]] = indices[chosen]
            found[kind - 1] = table
    return Corners(starts[heads], (indices[heads], found[0], found[1]))


def _blank_last_slashes(text: NDArray[np.uint8]) -> None:
    """Take out slashes at the end of words, as in 1// and 1/2/."""
    for _ in range(2):
        slashes = np.flatnonzero(text == _SLASH)
        text[slashes[(text[slashes + 1] <= BLANK) & (text[slashes - 1] > BLANK)]] = BLANK


def _first_bad_word(text: NDArray[np.uint8]) -> int:
    """Where the first word begins that is not a corner, found by halving the text."""
    edges = np.flatnonzero((text[1:] > BLANK) & (text[:-1] <= BLANK)) + 1
    bounds = np.append(edges, len(text))
    low, high = 0, len(edges)
    while high - low > 1:
        middle = (low + high) // 2
        part = padded(text[bounds[low] : bounds[middle]])
        runs = digit_runs(part)
        sizes = runs.ends - runs.starts
        kinds = _kinds(part, runs, sizes)
        if kinds is None or (values_of_runs(part, runs.starts, sizes) == TOO_LARGE).any():
            high = middle
        else:
            low = middle
    return int(edges[low])
