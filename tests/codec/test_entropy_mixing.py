"""Logistic mixing: its tables, and coding with it."""

from __future__ import annotations

import math
import zlib

import numpy as np
import numpy.typing as npt
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy import mixing_kernels as mixing
from meshtide_codec.entropy.codec import encoded, fully_read, opened
from meshtide_codec.entropy.mixing_kernels import INPUTS
from meshtide_codec.entropy.model_kernels import new_contexts

Integers = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Contexts = npt.NDArray[np.int32]

CONTEXTS = 64
STRETCH_CHECKSUM = 3470203142
SQUASH_CHECKSUM = 611315186


@kernel
def code_sequence(
    coder: Integers,
    buffer: Bytes,
    contexts: Contexts,
    weights: Contexts,
    places: Integers,
    signs: Integers,
    bits: Integers,
) -> None:
    for position in range(len(bits)):
        place, sign, bit = places[position], signs[position], bits[position]
        bits[position] = mixing.code_mixed_bit(coder, buffer, contexts, weights, 0, place, sign, 16, 200, bit)


def round_trip(places: Integers, signs: Integers, bits: Integers) -> tuple[bytes, Integers, Contexts]:
    def write(coder: Integers, buffer: Bytes) -> None:
        code_sequence(coder, buffer, new_contexts(CONTEXTS), mixing.new_weights(1, 1.0), places, signs, bits.copy())

    payload = encoded(write)
    coder, buffer = opened(payload)
    decoded = np.zeros_like(bits)
    contexts, weights = new_contexts(CONTEXTS), mixing.new_weights(1, 1.0)
    code_sequence(coder, buffer, contexts, weights, places, signs, decoded)
    assert fully_read(coder, payload)
    return payload, decoded, weights


def test_tables_are_these_integers_and_no_others() -> None:
    assert zlib.crc32(mixing.STRETCH.astype("<i4").tobytes()) == STRETCH_CHECKSUM
    assert zlib.crc32(mixing.SQUASH.astype("<i4").tobytes()) == SQUASH_CHECKSUM


def test_tables_follow_the_logistic_function() -> None:
    for index in range(0, 4096, 7):
        probability = (index + 0.5) / 4096
        exact = 256 * math.log(probability / (1 - probability))
        assert abs(mixing.STRETCH[index] - max(-2047, min(2047, exact))) <= 0.5 + 1e-9
        squashed = 65536 / (1 + math.exp(-(index - 2048) / 256))
        assert abs(mixing.SQUASH[index] - max(48, min(65488, squashed))) <= 1


def test_squash_is_monotone_and_stretch_antisymmetric() -> None:
    assert (np.diff(mixing.SQUASH) >= 0).all()
    assert (-mixing.STRETCH[::-1] == mixing.STRETCH).all()


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 400), st.floats(0.01, 0.99))
def test_round_trip(seed: int, length: int, chance: float) -> None:
    generator = np.random.default_rng(seed)
    bits = (generator.random(length) < chance).astype(np.int64)
    places = generator.integers(0, CONTEXTS, (length, INPUTS))
    signs = generator.choice([-1, 1], (length, INPUTS))
    _, decoded, _ = round_trip(places, signs, bits)
    assert (decoded == bits).all()


def test_mixing_trusts_the_context_that_knows() -> None:
    generator = np.random.default_rng(1)
    bits = generator.integers(0, 2, 4000)
    places = np.stack([bits, *(2 + generator.integers(0, 8, (5, 4000)))], axis=1)
    payload, decoded, weights = round_trip(places, np.ones_like(places), bits)
    assert (decoded == bits).all()
    assert len(payload) < 4000 / 8 / 10
    assert weights[0] > 2 * np.abs(weights[1:]).max()


def test_signs_share_mirrored_statistics() -> None:
    generator = np.random.default_rng(2)
    signs = generator.choice([-1, 1], (2000, INPUTS))
    signs[:, 1:] = signs[:, :1]
    bits = (signs[:, 0] > 0).astype(np.int64)
    places = np.zeros((2000, INPUTS), np.int64)
    payload, decoded, _ = round_trip(places, signs, bits)
    assert (decoded == bits).all()
    assert len(payload) < 40


def test_weights_stay_within_their_limit() -> None:
    bits = np.ones(60000, np.int64)
    places = np.arange(INPUTS)[None].repeat(len(bits), 0)
    _, _, weights = round_trip(places, np.ones_like(places), bits)
    assert (np.abs(weights) <= mixing.WEIGHT_LIMIT).all()
