"""Where an HTTP/1.1 request ends (RFC 9112): its head, counted and bounded, and how long its body is. No sockets.

It is stricter than the standard asks a server to be: a head in which two readers could see two different ends, such as
one with bare line feeds, two lengths, or a length beside chunks, is refused, so that whoever reads it after this sees
the same requests.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from http import HTTPStatus

from meshtide_codec.errors import MeshtideError

END = b"\r\n\r\n"
LONGEST_CHUNK_LINE = 1024
"""Bytes of the line before a chunk, which gives its length."""
_LENGTH_LINES = re.compile(rb"\r\n(content-length|transfer-encoding):[ \t]*([^\r\n]*?)[ \t]*(?=\r\n)")
_LENGTH = re.compile(rb"[0-9]{1,18}")
_HOST_LINES = re.compile(rb"\r\nhost:[ \t]*([^\r\n]*?)[ \t]*(?=\r\n)", re.IGNORECASE)
_HOST = re.compile(rb"(?:\[[0-9A-Za-z:.]+\]|[0-9A-Za-z\-._~%!$&'()*+,;=]*)(?::[0-9]*)?")
_CHUNK_LINE = re.compile(rb"([0-9A-Fa-f]{1,15})(?:;[^\r\n]*)?")


class RequestError(MeshtideError):
    """A request that is not handed on.

    Args:
        status: of the answer.
        code: for programs.
        message: for people.
    """

    def __init__(self, status: HTTPStatus, code: str, message: str) -> None:
        super().__init__(message)
        self.status = status
        self.code = code


class Body(Enum):
    """What follows a head, unless it is a number of bytes."""

    CHUNKS = "chunks"


@dataclass(frozen=True, slots=True)
class HeadLimits:
    """How large the head of a request may be.

    Args:
        line: bytes of its first line: method, address, version.
        size: bytes of all of it.
        headers: how many there are.
    """

    line: int
    size: int
    headers: int

    def check_line(self, beginning: bytes | bytearray) -> None:
        """Refuse what begins with too long a line.

        Raises:
            RequestError: 414.
        """
        if len(beginning) > self.line + 1 and beginning.find(b"\r\n", 0, self.line + 2) < 0:
            message = f"the first line of the request is longer than {self.line} bytes; ask for less at once"
            raise RequestError(HTTPStatus.REQUEST_URI_TOO_LONG, "address-too-long", message)

    def check_size(self, size: int) -> None:
        """Refuse a head of which `size` bytes have come, if these are too many.

        Raises:
            RequestError: 431.
        """
        if size > self.size:
            self._refuse(f"the headers of the request are longer than {self.size} bytes; send less")

    def check_count(self, count: int) -> None:
        """Refuse too many headers.

        Raises:
            RequestError: 431.
        """
        if count > self.headers:
            self._refuse(f"the request has {count} headers, more than {self.headers}; send fewer")

    def _refuse(self, message: str) -> None:
        raise RequestError(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "headers-too-large", message)


def body_of(head: bytes) -> int | Body:
    r"""What follows a whole head: so many bytes, or chunks.

    Raises:
        RequestError: 400, two readers could find two different answers.

    >>> body_of(b"GET / HTTP/1.1\r\nHost: h\r\n\r\n"), body_of(b"PUT /a HTTP/1.1\r\nContent-Length: 12\r\n\r\n")
    (0, 12)
    """
    lines = head.count(b"\r\n")
    if head.count(b"\n") != lines or head.count(b"\r") != lines:
        raise _malformed("it holds a line feed or a carriage return that ends no line")
    if b"\r\n " in head or b"\r\n\t" in head:
        raise _malformed("a header is continued on a second line")
    lowered = head.lower()
    if b"\ncontent-length:" not in lowered and b"\ntransfer-encoding:" not in lowered:
        return 0
    found = _LENGTH_LINES.findall(lowered)
    if len(found) > 1:
        raise _malformed("it gives the length of its body more than once")
    name, value = found[0]
    request, _, _ = head.partition(b"\r\n")
    if request.startswith(b"CONNECT "):
        raise _malformed("CONNECT has no body")
    if name == b"content-length":
        if not _LENGTH.fullmatch(value):
            raise _malformed("its Content-Length is not a number")
        return int(value)
    if value != b"chunked" or not request.endswith(b" HTTP/1.1"):
        raise _malformed("its Transfer-Encoding is not chunked, the only one that is known here")
    return Body.CHUNKS


def check_host(head: bytes) -> None:
    r"""Refuse a whole head that does not name the host that it asks, as section 3.2 demands of HTTP/1.1.

    Raises:
        RequestError: 400.

    >>> check_host(b"GET / HTTP/1.1\r\nHost: [::1]:8000\r\n\r\n")
    >>> check_host(b"GET / HTTP/1.0\r\n\r\n")
    """
    found = _HOST_LINES.findall(head)
    if not found and not head.partition(b"\r\n")[0].endswith(b" HTTP/1.1"):
        return
    if len(found) != 1:
        raise _malformed(f"it has {len(found)} Host headers; send one")
    if not _HOST.fullmatch(found[0]):
        raise _malformed("its Host is not the name of one, with or without a port")


def chunk_size(line: bytes) -> int:
    """Length of a chunk, by the line before it, without its end; 0 for the last one.

    Raises:
        RequestError: 400.

    >>> chunk_size(b"1f"), chunk_size(b"0;note=1")
    (31, 0)
    """
    found = _CHUNK_LINE.fullmatch(line)
    if found is None:
        raise _malformed("a chunk of its body has no length")
    return int(found[1], 16)


def _malformed(what: str) -> RequestError:
    return RequestError(HTTPStatus.BAD_REQUEST, "bad-request", f"the request is malformed: {what}")
