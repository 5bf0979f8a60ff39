"""Undoing the compression of a body on its way: what a proxy may add although it was declined.

Codings are those of RFC 9110, section 8.4.1: gzip (RFC 1952) and deflate (RFC 1950; some send RFC 1951 without its
frame). What is expanded comes in pieces of bounded size, so that a small body never takes much memory at once.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

from meshtide_codec.errors import ProtocolError, TransferError
from meshtide_codec.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

PIECE = 1 << 16
"""Bytes of the longest piece that comes out."""
ACCEPTED = "gzip, deflate"
"""What may be asked for, as Accept-Encoding has it."""
_GZIP = 16 + zlib.MAX_WBITS
_TELLING_BYTES = 2
"""Bytes that distinguish a framed deflate body from one without a frame."""
_LONGEST_NAME = 40


class ContentDecoder:
    """Expands one body.

    Args:
        coding: the answer's Content-Encoding, or empty.
        shown: what the body is of, for messages.

    Raises:
        ProtocolError: there is no such coding here, or there are several, one around the other.

    >>> b"".join(ContentDecoder("deflate", "a list").feed(zlib.compress(b"abc")))
    b'abc'
    """

    def __init__(self, coding: str, shown: str) -> None:
        name = coding.strip().lower()
        if name not in {"", "identity", "gzip", "x-gzip", "deflate"}:
            what = printable(name, _LONGEST_NAME)
            raise ProtocolError(f"{shown} comes compressed on the way ({what}), though that was declined")
        self.plain = name in {"", "identity"}
        self._shown = shown
        self._is_gzip = name.endswith("gzip")
        self._zlib = zlib.decompressobj(_GZIP if self._is_gzip else zlib.MAX_WBITS)
        self._fed = 0
        self._first = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The next bytes, expanded, in pieces of at most PIECE bytes (unless nothing is compressed).

        Raises:
            TransferError: they are damaged.
        """
        if self.plain:
            yield data
            return
        if not self._fed:
            data = self._first + data
            self._first = b"" if len(data) >= _TELLING_BYTES else data
            data = b"" if self._first else data
        try:
            while data:
                piece = self._expand(data)
                self._fed += len(data)
                data = self._zlib.unconsumed_tail
                if piece:
                    yield piece
                while len(piece) == PIECE and not data and not self._zlib.eof:  # more may wait inside
                    piece = self._zlib.decompress(b"", PIECE)
                    yield piece
                if self._zlib.eof and (data := self._zlib.unused_data):
                    if not self._is_gzip:
                        raise zlib.error("bytes follow its end")
                    self._zlib = zlib.decompressobj(_GZIP)  # the next member
        except zlib.error as error:
            raise TransferError(f"{self._shown} arrived damaged inside of its compression") from error

    def end(self) -> None:
        """Take note that no more bytes come.

        Raises:
            TransferError: they should.
        """
        if not self.plain and (self._first or (self._fed and not self._zlib.eof)):
            raise TransferError(f"{self._shown} ended inside of its compression")

    def _expand(self, data: bytes) -> bytes:
        try:
            return self._zlib.decompress(data, PIECE)
        except zlib.error:
            if self._is_gzip or self._fed:
                raise
            self._zlib = zlib.decompressobj(-zlib.MAX_WBITS)
            return self._zlib.decompress(data, PIECE)


def read_body(pieces: Iterable[bytes], coding: str, shown: str, largest: int) -> bytes:
    """A whole body of at most `largest` bytes after its expansion.

    Raises:
        ProtocolError: it is larger, or its coding is unknown.
        TransferError: it is damaged.
    """
    decoder = ContentDecoder(coding, shown)
    body = bytearray()
    for data in pieces:
        for piece in decoder.feed(data):
            body += piece
            if len(body) > largest:
                raise ProtocolError(f"{shown} answers with more than {largest} bytes; check the address")
    decoder.end()
    return bytes(body)
