"""Binary range coder with carry propagation, the arithmetic coder under every packet.

A range of 32 bits is split in proportion to a 16-bit probability: bound = (range >> 16) * probability, as in
LZMA (I. Pavlov) after G. N. N. Martin, "Range encoding: an algorithm for removing redundancy from a digitised
message", 1979. Integers only, so every machine writes and reads the same bytes. Cost: O(1) per decision.

The coder's state is an int64 array with the fields named below; the bytes live beside it in a uint8 array.
An encoder that runs out of buffer sets OVERFLOW and stops writing (the caller repeats with a larger buffer); a
decoder that runs past the end reads zeros, since an encoder leaves out the zeros at the end of its bytes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import inlined_kernel, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Coder = NDArray[np.int64]
    Buffer = NDArray[np.uint8]

LOW = 0  # encoder: lower end of the range, up to 33 bits
RANGE = 1  # width of the range, 2^24 <= width < 2^32 between decisions
CACHE = 2  # encoder: last byte that a carry may still change
PENDING = 3  # encoder: bytes held back (the cached one and the 255s after it)
POSITION = 4  # next byte to write or to read
CODE = 5  # decoder: position of the code word inside the range
DECODING = 6  # 1 when the state belongs to a decoder
OVERFLOW = 7  # encoder: bytes that did not fit the buffer
STATE_SIZE = 8

TOP = 1 << 24
MASK = 0xFFFFFFFF
FLUSH_BYTES = 5
CODE_BYTES = 4

PROBABILITY_BITS = 16
PROBABILITY_MINIMUM = 48
PROBABILITY_MAXIMUM = 65488


def new_encoder() -> Coder:
    """State of an encoder that has written nothing."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[RANGE] = MASK
    state[PENDING] = 1
    return state


def new_decoder(payload: Buffer) -> Coder:
    """State of a decoder at the start of `payload` (uint8)."""
    state = np.zeros(STATE_SIZE, np.int64)
    state[RANGE] = MASK
    state[DECODING] = 1
    _start_decoder(state, payload)
    return state


@kernel
def _start_decoder(state: Coder, payload: Buffer) -> None:
    for _ in range(CODE_BYTES):
        state[CODE] = ((state[CODE] << 8) | _next_byte(state, payload)) & MASK


@inlined_kernel
def _next_byte(state: Coder, payload: Buffer) -> Integer:
    position = state[POSITION]
    state[POSITION] = position + 1
    if position < len(payload):
        return np.int64(payload[position])
    return np.int64(0)


@kernel
def _emit(state: Coder, buffer: Buffer, byte: Integer) -> None:
    if state[POSITION] < len(buffer):
        buffer[state[POSITION]] = byte & 255
        state[POSITION] += 1
    else:
        state[OVERFLOW] += 1


@kernel
def _shift_low(state: Coder, buffer: Buffer) -> None:
    """Move the top byte of LOW out, holding back bytes that a later carry may still change."""
    low = state[LOW]
    if low < 0xFF000000 or low > MASK:
        carry = low >> 32
        byte = state[CACHE]
        for _ in range(state[PENDING]):
            _emit(state, buffer, byte + carry)
            byte = 255
        state[PENDING] = 0
        state[CACHE] = (low >> 24) & 255
    state[PENDING] += 1
    state[LOW] = (low & 0x00FFFFFF) << 8


@inlined_kernel
def code_bit(state: Coder, buffer: Buffer, probability: Integer, bit: Integer) -> Integer:
    """Code one decision whose chance of being 1 is probability / 65536 (clamped away from 0 and 1).

    Returns the decision: the one given when encoding, the one read when decoding.
    """
    if probability < PROBABILITY_MINIMUM:
        probability = PROBABILITY_MINIMUM
    elif probability > PROBABILITY_MAXIMUM:
        probability = PROBABILITY_MAXIMUM
    width = state[RANGE]
    bound = (width >> PROBABILITY_BITS) * probability
    if state[DECODING]:
        code = state[CODE]
        if code < bound:
            bit = 1
            width = bound
        else:
            bit = 0
            code -= bound
            width -= bound
        while width < TOP:
            width <<= 8
            code = ((code << 8) | _next_byte(state, buffer)) & MASK
        state[CODE] = code
        state[RANGE] = width
        return bit
    if bit:
        width = bound
    else:
        state[LOW] += bound
        width -= bound
    while width < TOP:
        width <<= 8
        _shift_low(state, buffer)
    state[RANGE] = width
    return bit


@kernel
def code_raw_bits(state: Coder, buffer: Buffer, bits: Integer, value: Integer) -> Integer:
    """Code the lowest `bits` bits of `value`, highest first, each as an even chance."""
    result = 0
    for place in range(bits - 1, -1, -1):
        result = (result << 1) | code_bit(state, buffer, 1 << 15, (value >> place) & 1)
    return result


@kernel
def flush(state: Coder, buffer: Buffer) -> None:
    """Write what the encoder still holds: `buffer[1:state[POSITION]]` is complete (the first byte is always zero).

    Any number inside the range will do; the one that ends in most zeros is taken, since zeros at the end are left out.
    """
    low = state[LOW]
    end = low + state[RANGE]
    for zeros in range(32, -1, -1):
        roundest = ((low + (1 << zeros) - 1) >> zeros) << zeros
        if roundest < end:
            state[LOW] = roundest
            break
    for _ in range(FLUSH_BYTES):
        _shift_low(state, buffer)
