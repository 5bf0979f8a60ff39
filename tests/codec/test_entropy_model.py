"""Adaptive contexts and integers: exact bytes, round trips, and damaged streams that cannot do harm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy.codec import encoded, fully_read, opened
from meshtide_codec.entropy.model_kernels import (
    ADAPTATION_RATES,
    COUNT_LIMIT,
    EVEN_CHANCE,
    MAXIMUM_BITS,
    OUT_OF_RANGE,
    SIGNED_CONTEXTS,
    UNSIGNED_CONTEXTS,
    code_adaptive_bit,
    code_signed,
    code_unsigned,
    new_contexts,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

LARGEST_UNSIGNED = 2**MAXIMUM_BITS - 2
LARGEST_SIGNED = 2**31 - 1


@kernel
def code_adaptive_bits(coder: Coder, buffer: Buffer, contexts: Contexts, bits: NDArray[np.int64]) -> None:
    for place in range(len(bits)):
        bits[place] = code_adaptive_bit(coder, buffer, contexts, 0, bits[place])


def written(code: Callable[..., int], values: list[int], context_count: int) -> bytes:
    def write(coder: Coder, buffer: Buffer) -> None:
        contexts = new_contexts(context_count)
        for value in values:
            code(coder, buffer, contexts, value)

    return encoded(write)


def read(payload: bytes, code: Callable[..., int], count: int, context_count: int) -> list[int]:
    coder, buffer = opened(payload)
    contexts = new_contexts(context_count)
    values = [int(code(coder, buffer, contexts, 0)) for _ in range(count)]
    assert fully_read(coder, payload)
    return values


def unsigned(coder: Coder, buffer: Buffer, contexts: Contexts, value: int) -> int:
    return code_unsigned(coder, buffer, contexts, 0, value)


def signed(coder: Coder, buffer: Buffer, contexts: Contexts, value: int) -> int:
    return code_signed(coder, buffer, contexts, 0, value)


def test_fresh_contexts_are_even() -> None:
    assert new_contexts(3).tolist() == [EVEN_CHANCE] * 3
    assert EVEN_CHANCE >> 8 == 1 << 15
    assert ADAPTATION_RATES[[0, 1, COUNT_LIMIT]].tolist() == [40960, 25206, 325]


def test_a_context_learns_fast_then_slowly() -> None:
    contexts = new_contexts(1)
    history = []

    def write(coder: Coder, buffer: Buffer) -> None:
        contexts[:] = new_contexts(1)
        for _ in range(300):
            code_adaptive_bits(coder, buffer, contexts, np.ones(1, np.int64))
            history.append(int(contexts[0]) >> 8)

    encoded(write)
    assert history[:3] == [53247, 57973, 60073]
    assert contexts[0] & 255 == COUNT_LIMIT
    assert history[-1] > 65000


def test_skewed_bits_cost_about_their_entropy() -> None:
    bits = (np.random.default_rng(5).random(20000) < 0.02).astype(np.int64)

    def write(coder: Coder, buffer: Buffer) -> None:
        code_adaptive_bits(coder, buffer, new_contexts(1), bits.copy())

    payload = encoded(write)
    share = bits.mean()
    entropy = -(share * np.log2(share) + (1 - share) * np.log2(1 - share)) * len(bits) / 8
    assert entropy < len(payload) < 1.04 * entropy
    coder, buffer = opened(payload)
    decoded = np.zeros_like(bits)
    code_adaptive_bits(coder, buffer, new_contexts(1), decoded)
    np.testing.assert_array_equal(decoded, bits)


EXACT_BYTES = {
    "unsigned": (unsigned, [0, 1, 2, 3, 100, LARGEST_UNSIGNED], UNSIGNED_CONTEXTS, "9296dcad2400000838"),
    "signed": (
        signed,
        [0, -1, 1, -100, LARGEST_SIGNED, -LARGEST_SIGNED],
        SIGNED_CONTEXTS,
        "935012f25300012effffff92aa394481c0",
    ),
}


@pytest.mark.parametrize(("code", "values", "contexts", "expected"), EXACT_BYTES.values(), ids=EXACT_BYTES)
def test_exact_bytes(code: Callable[..., int], values: list[int], contexts: int, expected: str) -> None:
    payload = written(code, values, contexts)
    assert read(payload, code, len(values), contexts) == values
    assert payload.hex() == expected


@given(st.lists(st.one_of(st.integers(0, 20), st.integers(0, LARGEST_UNSIGNED)), max_size=60))
def test_unsigned_round_trip(values: list[int]) -> None:
    payload = written(unsigned, values, UNSIGNED_CONTEXTS)
    assert read(payload, unsigned, len(values), UNSIGNED_CONTEXTS) == values


@given(st.lists(st.one_of(st.integers(-20, 20), st.integers(-LARGEST_SIGNED, LARGEST_SIGNED)), max_size=60))
def test_signed_round_trip(values: list[int]) -> None:
    payload = written(signed, values, SIGNED_CONTEXTS)
    assert read(payload, signed, len(values), SIGNED_CONTEXTS) == values


@given(st.binary(max_size=60))
def test_damaged_integers_stay_in_range(payload: bytes) -> None:
    coder, buffer = opened(payload)
    contexts = new_contexts(SIGNED_CONTEXTS)
    for _ in range(40):
        assert OUT_OF_RANGE <= code_unsigned(coder, buffer, contexts, 0, 0) <= LARGEST_UNSIGNED
        assert -(1 << 31) <= code_signed(coder, buffer, contexts, 0, 0) <= LARGEST_SIGNED


def test_a_length_that_no_encoder_writes_is_reported() -> None:
    """A decoder that reads only zero bytes reads only ones: the unary length never ends."""
    coder, buffer = opened(b"")
    assert code_unsigned(coder, buffer, new_contexts(UNSIGNED_CONTEXTS), 0, 0) == OUT_OF_RANGE
    coder, buffer = opened(b"")
    assert code_signed(coder, buffer, new_contexts(SIGNED_CONTEXTS), 0, 0) == -(1 << 31)
