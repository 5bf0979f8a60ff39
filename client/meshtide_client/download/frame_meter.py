"""How much of messages has come over a websocket, also of frames that are not whole yet.

Pings, pongs and frames without content keep a connection busy and bring nothing; so only the content of frames that
carry messages is counted. Frames are those of RFC 6455, section 5.2.
"""

from __future__ import annotations

_HEAD_END = b"\r\n\r\n"
_CONTROL = 0x08
"""Bit of the opcodes that carry no message."""
_MASKED = 0x80
_MASK_BYTES = 4
_LENGTHS = {126: 2, 127: 8}
"""Bytes of a length that does not fit into a frame's second byte."""


class FrameMeter:
    r"""Is fed what arrives, from the answer to the handshake on, in any pieces.

    >>> meter = FrameMeter()
    >>> meter.feed(b"HTTP/1.1 101 Switching Protocols\r\n\r\n" + b"\x89\x04ping" + b"\x82\x05he")
    >>> meter.message_bytes
    2
    """

    def __init__(self) -> None:
        self.message_bytes = 0
        """Bytes of messages so far."""
        self._head = bytearray()
        """The answer to the handshake, as far as its end is looked for in it; then the head of a frame."""
        self._greeted = False
        self._left = 0
        self._counts = False

    def feed(self, data: bytes) -> None:
        """Count what is in the next bytes."""
        place = 0 if self._greeted else self._answer_end(data)
        while place < len(data):
            if self._left:
                size = min(self._left, len(data) - place)
                self._left -= size
                self.message_bytes += size * self._counts
                place += size
                continue
            self._head.append(data[place])
            place += 1
            if len(self._head) >= 2 and len(self._head) == self._head_size():
                self._begin()

    def _answer_end(self, data: bytes) -> int:
        """Where frames begin in `data`; its length if they do not yet."""
        known = len(self._head)
        self._head += data
        end = self._head.find(_HEAD_END)
        if end < 0:
            del self._head[: 1 - len(_HEAD_END)]
            return len(data)
        self._greeted = True
        self._head.clear()
        return end + len(_HEAD_END) - known

    def _head_size(self) -> int:
        second = self._head[1]
        return 2 + _LENGTHS.get(second & ~_MASKED, 0) + (_MASK_BYTES if second & _MASKED else 0)

    def _begin(self) -> None:
        """The head of a frame is whole."""
        length = self._head[1] & ~_MASKED
        extended = _LENGTHS.get(length, 0)
        self._left = int.from_bytes(self._head[2 : 2 + extended], "big") if extended else length
        self._counts = not self._head[0] & _CONTROL
        self._head.clear()
