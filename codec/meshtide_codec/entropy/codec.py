"""What surrounds a kernel that writes or reads one payload: buffers that grow, endings that are checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from meshtide_codec.entropy import range_coder_kernels as range_coder

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

Result = TypeVar("Result")

SMALLEST_BUFFER = 1024


class PayloadWriter:
    """One range-coded payload that several coders write in turn.

    >>> from meshtide_codec.entropy.range_coder_kernels import code_raw_bits
    >>> writer = PayloadWriter()
    >>> for value in (77, 5):
    ...     _ = writer.write(lambda coder, buffer: code_raw_bits(coder, buffer, 8, value))
    >>> reader = PayloadReader(writer.payload())
    >>> [int(code_raw_bits(reader.coder, reader.buffer, 8, 0)) for _ in range(2)], reader.finished
    ([77, 5], True)
    """

    def __init__(self) -> None:
        self._coder = range_coder.new_encoder()
        self._buffer = np.zeros(SMALLEST_BUFFER, np.uint8)

    def write(self, write: Callable[[Coder, Buffer], Result], expected_bytes: int = 0) -> Result:
        """Let `write(coder, buffer)` go on with the payload; it is repeated with a larger buffer when one overflows.

        `write` must start from the same state each time. Returns what it returned.
        """
        before = self.mark()
        self._grow(expected_bytes - len(self._buffer) + int(before[range_coder.POSITION]))
        while True:
            result = write(self._coder, self._buffer)
            missing = int(self._coder[range_coder.OVERFLOW])
            if missing == 0:
                return result
            self.go_back(before)
            self._grow(missing + SMALLEST_BUFFER)

    def mark(self) -> Coder:
        """Where the payload stands, for `go_back`."""
        return self._coder.copy()

    def go_back(self, mark: Coder) -> None:
        """Forget what was written since `mark`."""
        self._coder[:] = mark

    @property
    def size(self) -> int:
        """Bytes so far, but for those that a decoder needs to tell the last decisions."""
        return int(self._coder[range_coder.POSITION] + self._coder[range_coder.PENDING])

    def payload(self) -> bytes:
        """All that was written. Zero bytes at the end are left out: a decoder reads zeros there."""
        self.write(range_coder.flush)
        return self._buffer[1 : self._coder[range_coder.POSITION]].tobytes().rstrip(b"\0")

    def _grow(self, size: int) -> None:
        if size > 0:
            self._buffer = np.concatenate([self._buffer, np.zeros(size, np.uint8)])


class PayloadReader:
    """One range-coded payload that several decoders read in turn, as they were written.

    Args:
        payload: what `PayloadWriter.payload` returned, or any bytes.

    Attributes:
        coder: of all of them.
        buffer: the payload as kernels want it.
    """

    def __init__(self, payload: bytes | memoryview) -> None:
        self.coder, self.buffer = opened(payload)

    @property
    def finished(self) -> bool:
        """Whether decoders that have finished stand where the payload ends; it is empty if they have read nothing."""
        if self.coder[range_coder.RANGE] == range_coder.MASK:  # as at the start: no decision leaves it there
            return len(self.buffer) == 0
        return fully_read(self.coder, self.buffer)

    @property
    def offset(self) -> int:
        """Bytes of the payload that have been looked at."""
        return min(int(self.coder[range_coder.POSITION]), len(self.buffer))


def encoded(write: Callable[[Coder, Buffer], object], expected_bytes: int = SMALLEST_BUFFER) -> bytes:
    """The bytes that `write(coder, buffer)` produces; it is repeated with a larger buffer when one overflows.

    `write` must start from the same state each time.

    >>> from meshtide_codec.entropy.range_coder_kernels import code_raw_bits
    >>> payload = encoded(lambda coder, buffer: code_raw_bits(coder, buffer, 8, 77))
    >>> coder, buffer = opened(payload)
    >>> int(code_raw_bits(coder, buffer, 8, 0))
    77
    """
    writer = PayloadWriter()
    writer.write(write, expected_bytes)
    return writer.payload()


def opened(payload: bytes | memoryview) -> tuple[Coder, NDArray[np.uint8]]:
    """Coder and buffer to decode `payload` with, as `encoded` wrote it."""
    buffer = np.frombuffer(payload, np.uint8).copy()  # kernels want a writable array
    return range_coder.new_decoder(buffer), buffer


def fully_read(coder: Coder, payload: bytes | memoryview | Buffer) -> bool:
    """Whether a decoder that has finished stands where the encoder's payload ends.

    An encoder flushes enough bytes to cover the decoder's look-ahead, less the zeros that were dropped, so a decoder
    never stops before the last byte of a payload.
    """
    return int(coder[range_coder.POSITION]) >= len(payload)
