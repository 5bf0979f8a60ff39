"""What surrounds a kernel that writes or reads one payload: buffers that grow, endings that are checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.entropy import range_coder_kernels as range_coder

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

SMALLEST_BUFFER = 1024


def encoded(write: Callable[[Coder, Buffer], object], expected_bytes: int = SMALLEST_BUFFER) -> bytes:
    """The bytes that `write(coder, buffer)` produces; it is repeated with a larger buffer when one overflows.

    `write` must start from the same state each time. Trailing zero bytes are dropped: a decoder reads zeros there.

    >>> import numpy as np
    >>> from meshtide_codec.entropy.range_coder_kernels import code_raw_bits
    >>> payload = encoded(lambda coder, buffer: code_raw_bits(coder, buffer, 8, 77))
    >>> coder, buffer = opened(payload)
    >>> int(code_raw_bits(coder, buffer, 8, 0))
    77
    """
    size = max(SMALLEST_BUFFER, expected_bytes)
    while True:
        coder = range_coder.new_encoder()
        buffer = np.zeros(size, np.uint8)
        write(coder, buffer)
        range_coder.flush(coder, buffer)
        if coder[range_coder.OVERFLOW] == 0:
            return buffer[1 : coder[range_coder.POSITION]].tobytes().rstrip(b"\0")
        size += int(coder[range_coder.OVERFLOW]) + SMALLEST_BUFFER


def opened(payload: bytes | memoryview) -> tuple[Coder, NDArray[np.uint8]]:
    """Coder and buffer to decode `payload` with, as `encoded` wrote it."""
    buffer = np.frombuffer(payload, np.uint8).copy()  # kernels want a writable array
    return range_coder.new_decoder(buffer), buffer


def fully_read(coder: Coder, payload: bytes | memoryview) -> bool:
    """Whether a decoder that has finished stands where the encoder's payload ends.

    An encoder flushes enough bytes to cover the decoder's look-ahead, less the zeros that were dropped, so a decoder
    never stops before the last byte of a payload.
    """
    return int(coder[range_coder.POSITION]) >= len(payload)
