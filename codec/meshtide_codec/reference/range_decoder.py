"""The range decoder: binary decisions of known probability from a payload's bytes (docs/format.md, section 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import PacketError

if TYPE_CHECKING:
    from typing import Self

SMALLEST_PROBABILITY = 48
LARGEST_PROBABILITY = 65488
EVEN = 1 << 15


class RangeDecoder:
    """Reads decisions from `payload`; bytes past its end count as zero.

    In a with statement the whole payload must have been consumed at its end.

    >>> RangeDecoder(bytes([77])).raw_bits(8)
    178
    """

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._position = 4
        self._range = 0xFFFFFFFF
        self._code = int.from_bytes(payload[:4].ljust(4, b"\0"), "big")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, traceback: object) -> None:
        if kind is None:
            self.finish()

    def bit(self, probability: int) -> int:
        """A decision whose chance to be a one is `probability` / 65536."""
        probability = min(max(probability, SMALLEST_PROBABILITY), LARGEST_PROBABILITY)
        bound = (self._range >> 16) * probability
        if self._code < bound:
            decision = 1
            self._range = bound
        else:
            decision = 0
            self._code -= bound
            self._range -= bound
        while self._range < 1 << 24:
            byte = self._payload[self._position] if self._position < len(self._payload) else 0
            self._position += 1
            self._range <<= 8
            self._code = (self._code << 8 | byte) & 0xFFFFFFFF
        return decision

    def raw_bits(self, count: int) -> int:
        """`count` decisions at even chances as an integer, highest bit first."""
        value = 0
        for _ in range(count):
            value = 2 * value + self.bit(EVEN)
        return value

    def finish(self) -> None:
        """Raise PacketError unless the whole payload has been consumed."""
        if self._position < len(self._payload):
            raise PacketError(
                f"{len(self._payload) - self._position} bytes follow the last decision; the stream is damaged",
                offset=self._position,
            )
