"""Decimal numbers in text to arrays, many at a time, exactly as `float` and `int` read them.

Digits are taken eight at a time: a word of eight characters becomes its value by three multiplications (D. Lemire,
"Quickly parsing eight digits"). A number of up to 15 digits is then a quotient of two numbers that a float64 holds
exactly, so one division rounds it right (W. Clinger, "How to read floating point numbers accurately"). One of up to 18
digits is divided in double the precision (T. Dekker, "A floating-point technique for extending the available
precision"). Powers of ten behind an e are taken into that quotient. Other spellings, and the few quotients that lie too
near to the middle of two floats, are left to the reader of the platform. Cost: linear.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLANK = 32
"""Characters up to the blank stand between words: tabs and line ends; other control bytes were replaced before."""

PADDING = 32
"""Blanks that stand before and after every text, so that no look beside a number leaves the array."""

MOST_DIGITS = 18
"""As many digits as 63 bits hold in any case; zeros before them do not count."""

TOO_LARGE = np.uint64((1 << 64) - 1)
"""Stands for a run of more digits."""

_BLOCK = 1 << 14  # words that are read at a time: their arrays stay in the cache
_FEW = 256  # words that are read one by one
_MANY = 4  # one word in so many signs and dots, spelled otherwise: all are read alike
_DOT, _MINUS, _PLUS, _ZERO, _SMALL_E = b".-+0e"
_TO_SMALL = np.uint8(32)  # the bit by which small letters differ
_LONGEST_POWER = 3  # digits
_LONGEST_INTEGER = 32  # digits, zeros before them among these
_WORD = 8
_EXACT = np.uint64(1 << 53)
_SPLITTER = 134217729.0  # 2^27 + 1 cuts a float64 into two halves of 26 bits
_MOST_DECIMALS = 22  # the last power of ten that a float64 holds exactly
_POWERS = np.array([float(10**k) for k in range(_MOST_DECIMALS + 1)])
_WHOLE_POWERS = np.array([10**k if k <= MOST_DIGITS else 0 for k in range(_MOST_DECIMALS + 1)], np.uint64)
_BLANKED = bytes(max(i, BLANK) for i in range(256))
_NOT_A_NUMBER = re.compile(rb"[+-]?(\d+\.#(QNAN|IND|SNAN)\d*|nan\([a-z]*\))", re.IGNORECASE)
_INFINITE = re.compile(rb"[+-]?\d+\.#INF\d*", re.IGNORECASE)


class NotANumber(ValueError):  # noqa: N818 - its readers make an error of it
    """A word that should be a number and is none; `place` is where it begins."""

    def __init__(self, place: int) -> None:
        self.place = place
        super().__init__(f"no number at {place}")


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs of digits in a text.

    Args:
        starts: (k,) int64, where each begins.
        ends: (k,) int64, where each has ended.
        before: (k,) uint8, the character before each.
    """

    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    before: NDArray[np.uint8]


def padded(text: bytes | memoryview | NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A copy of a text as bytes that may be changed, with PADDING blanks before it and at least so many after it."""
    size = len(text)
    array = np.empty(-(-(size + 2 * PADDING) // _WORD) * _WORD, np.uint8)
    array[:PADDING] = BLANK
    array[PADDING : PADDING + size] = text if isinstance(text, np.ndarray) else np.frombuffer(text, np.uint8)
    array[PADDING + size :] = BLANK
    return array


def digit_runs(text: NDArray[np.uint8]) -> Runs:
    """Find the runs of digits in a padded text."""
    digits = (text - np.uint8(_ZERO)) < 10
    edges = np.flatnonzero(digits[1:] != digits[:-1])
    edges += 1
    starts = np.ascontiguousarray(edges[0::2])
    return Runs(starts, np.ascontiguousarray(edges[1::2]), text[starts - 1])


def values_of_runs(text: NDArray[np.uint8], starts: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.uint64]:
    """The values (k,) of runs of digits in a padded text, TOO_LARGE where one has too many."""
    words = text.view("<u8")
    values = _eight_digits(words, starts, np.minimum(sizes, _WORD))
    done = _WORD
    longer = np.flatnonzero(sizes > done)
    if len(longer) == 0:
        return values
    large = longer[sizes[longer] > MOST_DIGITS]
    if len(large):  # are there zeros enough before?
        room = np.maximum(_WORD - (sizes[large] - MOST_DIGITS), 0)
        large = large[(sizes[large] > _MOST_DECIMALS) | (values[large] >= _WHOLE_POWERS[room])]
        longer = longer[sizes[longer] <= _MOST_DECIMALS]
    while len(longer):
        more = np.minimum(sizes[longer] - done, _WORD)
        values[longer] = values[longer] * _WHOLE_POWERS[more] + _eight_digits(words, starts[longer] + done, more)
        done += _WORD
        longer = longer[sizes[longer] > done]
    values[large] = TOO_LARGE
    return values


def _eight_digits(words: NDArray[np.uint64], starts: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.uint64]:
    """The values (k,) of runs of one to eight digits; `words` is the text, eight characters in each."""
    place = starts >> 3
    shift = (starts.view(np.uint64) & np.uint64(7)) << np.uint64(3)
    value: NDArray[np.uint64] = words[place] >> shift
    place += 1
    np.subtract(np.uint64(64), shift, out=shift)
    value |= words[place] << shift  # of a shift by 64 nothing is left
    value <<= np.uint64(64) - (sizes.view(np.uint64) << np.uint64(3))  # the last digit on top, zeros below the first
    for mask, factor, down in (
        (0x0F0F0F0F0F0F0F0F, 10 << 8 | 1, 8),
        (0x00FF00FF00FF00FF, 100 << 16 | 1, 16),
        (0x0000FFFF0000FFFF, 10000 << 32 | 1, 32),
    ):
        value &= np.uint64(mask)
        value *= np.uint64(factor)
        value >>= np.uint64(down)
    return value


def leading_numbers(
    text: NDArray[np.uint8], starts: NDArray[np.signedinteger], end: int, *, whole: bool = False
) -> NDArray[np.float64] | NDArray[np.int64]:
    """The numbers (k,) that words are, as far as they are any: fewer than words where one is none.

    Args:
        text: that they stand in, of any length, without padding.
        starts: where each begins; between them are blanks and nothing else. Control bytes have been replaced (see
            `encodings`).
        end: where the last one has ended.
        whole: whether they become int64 where all are whole numbers that it holds.

    >>> leading_numbers(np.frombuffer(b"1 2.5 x", np.uint8), np.array([0, 2, 6]), 7).tolist()
    [1.0, 2.5]
    """
    values: NDArray[Any] = np.empty(len(starts), np.int64 if whole else np.float64)
    for low in range(0, len(starts), _BLOCK):
        words = starts[low : low + _BLOCK]
        begin = int(words[0])
        block = padded(text[begin : int(starts[low + _BLOCK]) if low + _BLOCK < len(starts) else end])
        count = len(words)
        try:
            found = _numbers(block, whole=values.dtype.kind == "i")
        except NotANumber as error:
            count = int(np.searchsorted(words, begin + error.place - PADDING))
            block[error.place :] = BLANK
            found = _numbers(block, whole=values.dtype.kind == "i")
        if found.dtype.kind == "f" and values.dtype.kind == "i":
            values = values.astype(np.float64)
        values[low : low + count] = found
        if count < len(words):
            return values[: low + count]
    return values


def _numbers(text: NDArray[np.uint8], *, whole: bool) -> NDArray[np.float64] | NDArray[np.int64]:
    """The numbers of a padded text, as int64 if that is wanted and holds them."""
    integers = _integers(text) if whole else None
    return decimals(text)[0] if integers is None else integers


def _integers(text: NDArray[np.uint8]) -> NDArray[np.int64] | None:
    """The numbers of a padded text as int64; None where not all are like 12 and -3, or one is too large."""
    runs = _plain_runs(text)
    if runs is None or (runs.before == _DOT).any():
        return None
    values = values_of_runs(text, runs.starts, runs.ends - runs.starts)
    large = np.flatnonzero(values == TOO_LARGE)
    integers = values.view(np.int64)
    negative = runs.before == _MINUS
    np.negative(integers, out=integers, where=negative)
    for at in large.tolist():
        if runs.ends[at] - runs.starts[at] > _LONGEST_INTEGER:
            return None
        number = int(text[runs.starts[at] : runs.ends[at]].tobytes()) * (-1 if negative[at] else 1)
        if not -(1 << 63) <= number < 1 << 63:
            return None
        integers[at] = number
    return integers


def decimals(text: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The numbers (k,) of a padded text of nothing but numbers, and where each begins (at its sign or after it).

    Raises:
        NotANumber: a word is none.

    >>> decimals(padded(b"0.1 -20 3.25 1e3 .5"))[0].tolist()
    [0.1, -20.0, 3.25, 1000.0, 0.5]
    """
    plain = _plain_decimals(text) or _with_powers(text)
    if plain is None:
        return _mixed_decimals(text)
    values, places = plain
    unsure = np.flatnonzero(np.isnan(values))
    if len(unsure):
        values[unsure] = _spelled_otherwise(text, places[unsure])
    np.negative(values, out=values, where=text[places - 1] == _MINUS)
    return values, places


def _plain_runs(text: NDArray[np.uint8]) -> Runs | None:
    """The runs of digits in a text of nothing but these, signs and dots before them, and blanks; None for others."""
    runs = digit_runs(text)
    sizes = runs.ends - runs.starts
    tails = np.flatnonzero(runs.before == _DOT)
    signs = np.flatnonzero(runs.before == _MINUS)
    loose = int((runs.before <= BLANK).sum())
    # Each run is of one of three kinds, and no character is left that belongs to none.
    if loose + len(tails) + len(signs) != len(sizes):
        return None
    if np.count_nonzero(text > BLANK) != int(sizes.sum()) + len(tails) + len(signs):
        return None
    if (text[runs.starts[signs] - 2] > BLANK).any():
        return None
    return runs


def _plain_decimals(
    text: NDArray[np.uint8], marks: NDArray[np.int64] | None = None, powers: NDArray[np.int64] | int = 0
) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """Sizes of numbers without their signs, NaN for one that is not sure; None where not all are like 12 and -3.4.

    Args:
        text: padded.
        marks: the places behind numbers that powers of ten belong to.
        powers: of ten.
    """
    runs = _plain_runs(text)
    if runs is None:
        return None
    sizes = runs.ends - runs.starts
    broken = runs.before == _DOT
    tails = np.flatnonzero(broken)
    values = values_of_runs(text, runs.starts, sizes)
    if len(tails) == 0:
        after = np.zeros(len(values), np.int64)
        if marks is not None:
            after[np.searchsorted(runs.starts, marks) - 1] -= powers
        return _quotients(values, after, values == TOO_LARGE), runs.starts
    if tails[0] == 0 or broken[tails - 1].any() or (runs.ends[tails - 1] + 1 != runs.starts[tails]).any():
        return None
    heads = np.flatnonzero(~broken)
    if 2 * len(tails) == len(sizes):  # all have decimals
        after, low = sizes[1::2], values[1::2]
    else:
        after, low = np.zeros(len(sizes), np.int64), np.zeros(len(sizes), np.uint64)
        after[tails - 1], low[tails - 1] = sizes[tails], values[tails]
        after, low = after[heads], low[heads]
    whole = values[heads]
    large = (sizes[heads] + after > MOST_DIGITS) & (whole > 0)
    large |= (low == TOO_LARGE) | (whole == TOO_LARGE)
    after[large] = 0
    whole = whole * _WHOLE_POWERS[after] + low
    places = runs.starts[heads]
    if marks is not None:
        after[np.searchsorted(places, marks) - 1] -= powers
    return _quotients(whole, after, large), places


def _with_powers(text: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """The same for a text in which some numbers are like 1e5 and -1.25E-07."""
    marks = np.flatnonzero((text | _TO_SMALL) == _SMALL_E)
    if len(marks) == 0:
        return None
    sign = text[marks + 1]
    begins = marks + 1 + ((sign == _MINUS) | (sign == _PLUS))
    powers, ends = np.zeros(len(marks), np.int64), begins.copy()
    for step in range(_LONGEST_POWER):
        digit = text[begins + step] - np.uint8(_ZERO)
        more = (ends == begins + step) & (digit < 10)
        powers = np.where(more, 10 * powers + digit, powers)
        ends += more
    if (ends == begins).any() or (text[ends] > BLANK).any() or (text[marks - 1] - np.uint8(_ZERO) >= 10).any():
        return None
    plain = text.copy()
    for step in range(_LONGEST_POWER + 2):  # with the e and the sign
        places = marks + step
        plain[places[places < ends]] = BLANK
    return _plain_decimals(plain, marks, np.where(sign == _MINUS, -powers, powers))


def _quotients(whole: NDArray[np.uint64], after: NDArray[np.int64], unknown: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The numbers whole / 10^after (k,), rounded right; NaN where that is not sure, and where whole is not known."""
    upward = after < 0
    if upward.any() or after.max(initial=0) > _MOST_DECIMALS:
        unknown = unknown | (after > _MOST_DECIMALS) | (after < -_MOST_DECIMALS) | upward & (whole > _EXACT)
        after = np.where(unknown, 0, after)
        upward &= ~unknown
    whole[unknown] = 0
    powers = _POWERS[np.abs(after)]
    upper = whole.astype(np.float64)
    quotient: NDArray[np.float64] = upper / powers
    np.multiply(upper, powers, out=quotient, where=upward)
    quotient[unknown] = np.nan
    large = np.flatnonzero(whole > _EXACT)
    if len(large) == 0:
        return quotient
    upper, powers, first = upper[large], powers[large], quotient[large]
    lower = (whole[large] - upper.astype(np.uint64)).view(np.int64).astype(np.float64)
    product, error = _product(first, powers)
    second = (((upper - product) - error) + lower) / powers
    rounded = first + second
    rest = second - (rounded - first)
    rounded[rounded + rest * (1 + 1e-9) != rounded] = np.nan
    quotient[large] = rounded
    return quotient


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rounded product and what rounding took away, exactly."""
    a_high, b_high = a * _SPLITTER, b * _SPLITTER
    a_high, b_high = a_high - (a_high - a), b_high - (b_high - b)
    a_low, b_low = a - a_high, b - b_high
    product = a * b
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _mixed_decimals(text: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Like `decimals`, where some words are spelled otherwise: those are read by themselves, the rest as above."""
    blank = text <= BLANK
    digit = (text - np.uint8(_ZERO)) < 10
    seen = np.flatnonzero(~(blank | digit))
    gaps = np.flatnonzero(blank)
    character, followed = text[seen], digit[seen + 1]
    dot = (character == _DOT) & digit[seen - 1] & followed
    minus = (character == _MINUS) & blank[seen - 1] & followed
    odd = np.searchsorted(gaps, seen[~(dot | minus)])  # a word is named by the gap that ends it
    dotted = np.searchsorted(gaps, seen[dot])
    odd = np.unique(np.concatenate([odd, dotted[1:][dotted[1:] == dotted[:-1]]]))
    if _MANY * len(odd) > len(seen):
        edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
        return _spelled_otherwise(text, edges[0::2]), edges[0::2]
    starts, ends = gaps[odd - 1] + 1, gaps[odd]
    others = np.where(_spans(len(text), starts, ends), np.uint8(BLANK), text)
    others[starts] = _ZERO
    values, places = decimals(others)
    values[np.searchsorted(places, starts)] = _spelled_otherwise(text, starts)
    return values, places


def _spans(size: int, starts: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of `size` places lie in one of the spans, which do not overlap."""
    change = np.zeros(size, np.int8)
    change[starts] = 1
    change[ends] = -1
    return np.cumsum(change, dtype=np.int8).view(np.bool_)


def _spelled_otherwise(text: NDArray[np.uint8], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The numbers of the words that begin at some places: where they are many, all at once."""
    if len(starts) > _FEW:
        gaps = np.flatnonzero(text <= BLANK)
        ends = gaps[np.searchsorted(gaps, starts)]
        alone = np.where(_spans(len(text), starts, ends), text, np.uint8(BLANK))
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # how numpy reports a word that is not a number
            try:
                values = np.fromstring(alone.tobytes(), np.float64, sep=" ")
            except (DeprecationWarning, ValueError):
                values = np.zeros(0)
        if len(values) == len(starts):
            return values
    return np.array([_float(text, place) for place in starts.tolist()], np.float64)


def _float(text: NDArray[np.uint8], place: int) -> float:
    word = _word(text, place)
    try:
        if b"_" not in word:
            return float(word)
    except ValueError:
        pass
    if _NOT_A_NUMBER.fullmatch(word):
        return float("nan")
    if _INFINITE.fullmatch(word):
        return float("-inf" if word.startswith(b"-") else "inf")
    raise NotANumber(place)


def _word(text: NDArray[np.uint8], place: int) -> bytes:
    """The word that begins at a place of a padded text."""
    reach = PADDING
    while (word := text[place : place + reach].tobytes().translate(_BLANKED)).find(b" ") < 0:
        reach *= 2
    return word.split(b" ", 1)[0]
