"""The range coder writes exactly these bytes, and reads back whatever it wrote."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy.codec import encoded, fully_read, opened
from meshtide_codec.entropy.range_coder_kernels import (
    OVERFLOW,
    POSITION,
    code_bit,
    code_raw_bits,
    flush,
    new_decoder,
    new_encoder,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


@kernel
def code_bits(coder: Coder, buffer: Buffer, probabilities: NDArray[np.int64], bits: NDArray[np.int64]) -> None:
    for place in range(len(bits)):
        bits[place] = code_bit(coder, buffer, probabilities[place], bits[place])


def written(bits: list[int], probabilities: list[int]) -> bytes:
    def write(coder: Coder, buffer: Buffer) -> None:
        code_bits(coder, buffer, np.array(probabilities, np.int64), np.array(bits, np.int64))

    return encoded(write)


def read(payload: bytes, probabilities: list[int]) -> list[int]:
    coder, buffer = opened(payload)
    bits = np.zeros(len(probabilities), np.int64)
    code_bits(coder, buffer, np.array(probabilities, np.int64), bits)
    assert fully_read(coder, payload)
    return bits.tolist()  # type: ignore[no-any-return]


def plainly_written(bits: list[int], probabilities: list[int]) -> bytes:
    """The same coder over one integer of any length: no carries to propagate, no bytes to hold back."""
    low, width, length = 0, 0xFFFFFFFF, 32
    for bit, probability in zip(bits, probabilities, strict=True):
        bound = (width >> 16) * min(max(probability, 48), 65488)
        if bit:
            width = bound
        else:
            low += bound
            width -= bound
        while width < 1 << 24:
            low <<= 8
            width <<= 8
            length += 8
    zeros = next(zeros for zeros in range(32, -1, -1) if -(-low >> zeros) << zeros < low + width)
    return (-(-low >> zeros) << zeros).to_bytes(length // 8, "big").rstrip(b"\0")


def test_exact_bytes_of_even_chances() -> None:
    assert written([0, 1, 0, 1, 1, 0, 0, 1], [1 << 15] * 8).hex() == "a6"


def test_exact_bytes_of_skewed_chances() -> None:
    assert written([1, 1, 0, 1, 0, 0, 1, 1] * 4, [50000, 65488, 48, 30000] * 8).hex() == "596614b17a741c40ffa74dd6a0"


def test_ones_only_take_no_bytes() -> None:
    assert written([1] * 50, [40000] * 50) == b""


def test_exact_bytes_of_raw_bits() -> None:
    payload = encoded(lambda coder, buffer: code_raw_bits(coder, buffer, 24, 0x123456) and None)
    coder, buffer = opened(payload)
    assert code_raw_bits(coder, buffer, 24, 0) == 0x123456
    assert payload.hex() == "edcb29"


def test_carries_run_through_bytes_of_ones() -> None:
    """A long run of near-certain ones followed by a zero makes the carry travel."""
    bits = [0] * 40 + [1] * 300 + [0] * 5
    probabilities = [60] * 40 + [65000] * 300 + [65400] * 5
    payload = written(bits, probabilities)
    assert payload == plainly_written(bits, probabilities)
    assert read(payload, probabilities) == bits


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(-5, 65540)), max_size=300))
def test_any_decisions_round_trip(decisions: list[tuple[int, int]]) -> None:
    """Probabilities out of range are clamped, the same way on both sides."""
    bits = [bit for bit, _ in decisions]
    probabilities = [probability for _, probability in decisions]
    payload = written(bits, probabilities)
    assert payload == plainly_written(bits, probabilities)
    assert read(payload, probabilities) == bits


def test_a_small_buffer_overflows_without_damage_and_is_repeated() -> None:
    coder = new_encoder()
    buffer = np.zeros(4, np.uint8)
    random = np.random.default_rng(0)
    bits = random.integers(0, 2, 20000)
    code_bits(coder, buffer, np.full(20000, 1 << 15), bits.copy())
    flush(coder, buffer)
    assert coder[POSITION] == 4
    assert coder[OVERFLOW] == 20000 // 8 + 4 - 4
    payload = written(bits.tolist(), [1 << 15] * 20000)
    assert len(payload) in range(2495, 2506)
    assert read(payload, [1 << 15] * 20000) == bits.tolist()


@given(st.binary(max_size=40))
def test_a_decoder_reads_any_bytes_and_zeros_after_them(payload: bytes) -> None:
    buffer = np.frombuffer(payload, np.uint8).copy()
    coder = new_decoder(buffer)
    bits = np.zeros(400, np.int64)
    code_bits(coder, buffer, np.full(400, 1 << 15), bits)
    assert set(bits.tolist()) <= {0, 1}
    assert coder[POSITION] >= len(payload)
