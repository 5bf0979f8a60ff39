"""Conditional and range requests on a file that has a strong entity tag (RFC 9110, sections 13 and 14).

One range is served; a request for several, or one that is malformed, is answered with the whole file, as the RFC
allows. `plan` turns a request's headers into what to answer, without doing it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

_ONE_RANGE = re.compile(r"bytes=\s*(?:([0-9]+)-([0-9]*)|-([0-9]+))\s*", re.ASCII | re.IGNORECASE)
_TAGS = re.compile(r'(?:W/)?"[^"]*"')
LONGEST_NUMBER = 19
"""Digits of a byte position; more of them are past the end of every file."""


@dataclass(frozen=True, slots=True)
class RangeAnswer:
    """What to answer.

    Args:
        status: 200, 206, 304, 412 or 416.
        start: first byte to send.
        end: one past the last byte to send.
    """

    status: HTTPStatus
    start: int
    end: int


def plan(method: str, headers: Mapping[str, str], etag: str, size: int) -> RangeAnswer:
    """What to answer to a request for a file of `size` bytes with the strong entity tag `etag`.

    Args:
        method: GET or HEAD; only GET knows ranges.
        headers: of the request, under lower-case names.
        etag: with its quotes.
        size: of the file, in bytes.

    >>> plan("GET", {"range": "bytes=-10"}, '"a"', 100)
    RangeAnswer(status=<HTTPStatus.PARTIAL_CONTENT: 206>, start=90, end=100)
    """
    wanted = headers.get("if-match")
    if wanted is not None and wanted.strip() != "*" and etag not in _TAGS.findall(wanted):
        return RangeAnswer(HTTPStatus.PRECONDITION_FAILED, 0, 0)
    held = headers.get("if-none-match")
    if held is not None and (held.strip() == "*" or etag in [tag.removeprefix("W/") for tag in _TAGS.findall(held)]):
        return RangeAnswer(HTTPStatus.NOT_MODIFIED, 0, 0)
    whole = RangeAnswer(HTTPStatus.OK, 0, size)
    text = headers.get("range")
    if method != "GET" or text is None or headers.get("if-range", etag).strip() != etag:
        return whole
    match = _ONE_RANGE.fullmatch(text)
    if match is None:
        return whole
    first, last, suffix = match.groups()
    if suffix is not None:
        start, end = max(size - _position(suffix), 0), size
    elif last and _position(last) < _position(first):
        return whole  # RFC 9110, 14.1.1: such a range is invalid, not unsatisfiable
    else:
        start, end = _position(first), min(_position(last) + 1, size) if last else size
    if start >= end:
        return RangeAnswer(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, 0, 0)
    return RangeAnswer(HTTPStatus.PARTIAL_CONTENT, start, end)


def _position(digits: str) -> int:
    significant = digits.lstrip("0") or "0"
    return int(significant) if len(significant) <= LONGEST_NUMBER else 10**LONGEST_NUMBER
