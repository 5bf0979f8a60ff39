r"""Bytes of a text file as plain text, whatever Unicode encoding they are in; and the bytes that no text has.

Text in UTF-16 or UTF-32 is known by its byte order mark or, without one, by its zero bytes: mesh files are mostly
ASCII, of which UTF-16 leaves every second byte zero and UTF-32 three of four. Marks: The Unicode Standard, section
23.8. Other text stays as it is: UTF-8, or a code page of 8 bits. Control bytes but \t \n \v \f \r have no place in a
number or statement: readers see a question mark there, which is part of no number, or refuse the line.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe\0\0", "utf-32-le"),  # begins like UTF-16
    (b"\0\0\xfe\xff", "utf-32-be"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
_ZEROS = {
    (False, True, True, True): "utf-32-le",
    (True, True, True, False): "utf-32-be",
    (False, True, False, True): "utf-16-le",
    (True, False, True, False): "utf-16-be",
}
"""Which bytes of four are zero in most of a text, and in its first character."""
_LOOKED_AT = 1 << 12
_FIRST_BLANK, _LAST_BREAK, _FIRST_VISIBLE = 9, 13, 32
_OLD_END = re.compile(rb"\x1a[\x1a\0]*\Z")
_UNSEEN = bytes(i if i >= _FIRST_VISIBLE or _FIRST_BLANK <= i <= _LAST_BREAK else ord("?") for i in range(256))
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
"""A byte that no text has."""


def wide_encoding(data: bytes | memoryview) -> str:
    r"""Which of UTF-16 and UTF-32 bytes are in, such as utf-16-le; empty if in neither.

    >>> wide_encoding("OFF 3".encode("utf-32-be")), wide_encoding(b"OFF 3")
    ('utf-32-be', '')
    """
    head = bytes(data[:_LOOKED_AT])
    mark = _mark(head)
    if mark is not None:
        return "" if mark[1] == "utf-8" else mark[1]
    if b"\0" not in head[:4]:
        return ""
    quarters = np.frombuffer(head, np.uint8, len(head) // 4 * 4).reshape(-1, 4) == 0
    if len(quarters) == 0:
        return ""
    most = tuple((2 * np.count_nonzero(quarters, axis=0) > len(quarters)).tolist())
    found = _ZEROS.get(most, "")
    unit = 2 if found.startswith("utf-16") else 4
    return found if quarters[0, :unit].tolist() == list(most[:unit]) else ""


def decoded(data: bytes) -> bytes:
    r"""A text without its byte order mark; one in UTF-16 or UTF-32 becomes UTF-8, all others stay as they are.

    >>> decoded("v 0 0 0".encode("utf-16"))
    b'v 0 0 0'
    """
    encoding = wide_encoding(data)
    if encoding:
        data = data.decode(encoding, "replace").encode("utf-8", "replace")
    return data.removeprefix(_MARKS[0][0])


def plain_text(data: bytes) -> bytes:
    r"""The same, its lines ended by line feeds, without the control-Z that old systems put behind a text.

    >>> plain_text(b"\xef\xbb\xbfOFF\r3 1 0\r\n\x1a")
    b'OFF\n3 1 0\n'
    """
    data = decoded(data)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if data[-1:] in b"\x1a\0":
        data = _OLD_END.sub(b"", data)
    return data


def has_control(text: NDArray[np.uint8]) -> bool:
    """Whether a control byte stands in a text; at some gigabytes a second."""
    return bool((text < _FIRST_BLANK).any()) or bool(
        (text - np.uint8(_LAST_BREAK + 1) < _FIRST_VISIBLE - _LAST_BREAK - 1).any()
    )


def without_control(text: bytes) -> bytes:
    r"""The text with a question mark for each control byte, so that no such byte ends or begins a word.

    >>> without_control(b"1\x000")
    b'1?0'
    """
    return text.translate(_UNSEEN) if has_control(np.frombuffer(text, np.uint8)) else text


def refuse_control(text: bytes, end: int) -> None:
    """Refuse a control byte before `end` in a text whose lines end in line feeds.

    Raises:
        MeshFileError: there is one.
    """
    found = CONTROL.search(text, 0, end) if has_control(np.frombuffer(text, np.uint8)) else None
    if found is not None:
        line = text.count(b"\n", 0, found.start()) + 1
        raise MeshFileError(f"line {line}: a control byte ({found.group()[0]:#04x}) is in it; the file is damaged")


def _mark(head: bytes) -> tuple[bytes, str] | None:
    return next((mark for mark in _MARKS if head.startswith(mark[0])), None)
