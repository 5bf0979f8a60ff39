"""Deep mixing: what it learns, that both sides stay in step, and that nothing leaves its range."""

from __future__ import annotations

import zlib

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compilation import kernel
from meshtide_codec.entropy import deep_mixing_kernels as deep
from meshtide_codec.entropy.codec import encoded, fully_read, opened
from meshtide_codec.entropy.model_kernels import new_contexts
from meshtide_codec.entropy.range_coder_kernels import PROBABILITY_MAXIMUM, PROBABILITY_MINIMUM
from meshtide_codec.reference.deep_mixing import DeepNeurons
from meshtide_codec.reference.models import Contexts
from meshtide_codec.reference.range_decoder import RangeDecoder

Integers = npt.NDArray[np.int64]
Narrow = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]
Mixer = tuple[Narrow, Narrow, Narrow, Narrow]

CONTEXTS, NEURONS, CHOICES, FINALS, CORRECTIONS, RATE = 16, 6, 2, 3, 4, 17
HEARD, NUMBERS = 3, 2
INPUTS = deep.HEARD * HEARD + NUMBERS


def new_mixer() -> Mixer:
    return (
        new_contexts(2 * CONTEXTS),
        deep.new_deep_weights(NEURONS, INPUTS, 2 * HEARD, 1.4),
        deep.new_deep_weights(FINALS, CHOICES, CHOICES, 1.0),
        deep.new_corrections(CORRECTIONS),
    )


@kernel
def code_sequence(
    coder: Integers,
    buffer: Bytes,
    mixer: Mixer,
    places: Integers,
    signs: Integers,
    numbers: Narrow,
    choices: Integers,
    bits: Integers,
) -> None:
    """Row i of each array belongs to decision i; choices are neurons, then the final one and the correction."""
    inputs = np.zeros(INPUTS, np.int32)
    outputs = np.zeros(CHOICES, np.int32)
    for row in range(len(bits)):
        inputs[deep.HEARD * HEARD :] = numbers[row]
        chosen, final, correction = choices[row, :CHOICES], choices[row, CHOICES], choices[row, CHOICES + 1]
        bits[row] = deep.code_deep_bit(
            coder,
            buffer,
            mixer,
            chosen,
            final,
            correction,
            places[row],
            signs[row],
            inputs,
            outputs,
            RATE,
            bits[row],
        )


class Decisions:
    """A random sequence of decisions whose bits follow, mostly, the first context and the first number."""

    def __init__(self, seed: int, length: int, surprise: float = 0.1) -> None:
        generator = np.random.default_rng(seed)
        self.places = generator.integers(0, CONTEXTS, (length, HEARD))
        self.signs = generator.choice(np.array([-1, 1]), (length, HEARD))
        self.numbers = generator.integers(-deep.NUMBER_LIMIT, deep.NUMBER_LIMIT + 1, (length, NUMBERS)).astype(np.int32)
        self.choices = np.column_stack(
            [
                generator.integers(0, NEURONS, (length, CHOICES)),
                generator.integers(0, FINALS, length),
                generator.integers(0, CORRECTIONS, length),
            ]
        )
        expected = (self.places[:, 0] % 2 == 0) == (self.signs[:, 0] > 0)
        surprised = generator.random(length) < surprise
        self.bits = (expected ^ surprised).astype(np.int64)

    def encode(self, mixer: Mixer) -> bytes:
        start = [array.copy() for array in mixer]

        def write(coder: Integers, buffer: Bytes) -> None:
            for array, before in zip(mixer, start, strict=True):
                array[:] = before
            code_sequence(coder, buffer, mixer, *self.rows, self.bits.copy())

        return encoded(write)

    @property
    def rows(self) -> tuple[Integers, Integers, Narrow, Integers]:
        return self.places, self.signs, self.numbers, self.choices


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.floats(0.0, 0.5))
def test_a_decoder_reads_what_was_written_and_learns_the_same(seed: int, length: int, surprise: float) -> None:
    decisions = Decisions(seed, length, surprise)
    writing, reading = new_mixer(), new_mixer()
    payload = decisions.encode(writing)
    coder, buffer = opened(payload)
    found = np.zeros(length, np.int64)
    code_sequence(coder, buffer, reading, *decisions.rows, found)
    assert np.array_equal(found, decisions.bits)
    assert fully_read(coder, payload)
    assert all(np.array_equal(one, other) for one, other in zip(writing, reading, strict=True))


def test_it_learns_whom_to_believe() -> None:
    fair = len(Decisions(1, 4000, 0.5).encode(new_mixer()))
    told = len(Decisions(1, 4000, 0.02).encode(new_mixer()))
    assert fair > 4000 // 8
    assert told < 0.35 * fair


def test_numbers_are_believed_too() -> None:
    decisions = Decisions(2, 4000, 0.5)
    decisions.bits = (decisions.numbers[:, 0] > 0).astype(np.int64)
    assert len(decisions.encode(new_mixer())) < 0.4 * 4000 / 8


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.5))
def test_nothing_leaves_its_range(seed: int, surprise: float) -> None:
    decisions = Decisions(seed, 3000, surprise)
    mixer = new_mixer()
    decisions.encode(mixer)
    contexts, weights, final_weights, corrections = mixer
    assert ((contexts >> 8) >= 0).all()
    assert ((contexts >> 8) < 65536).all()
    assert ((contexts[:CONTEXTS] & 255) <= deep.SLOW_LIMIT).all()
    assert ((contexts[CONTEXTS:] & 255) <= deep.FAST_LIMIT).all()
    assert (np.abs(weights) <= deep.WEIGHT_LIMIT).all()
    assert (np.abs(final_weights) <= deep.WEIGHT_LIMIT).all()
    assert (corrections >> 6 >= 0).all()
    assert (corrections >> 6 < 65536).all()


def test_new_corrections_repeat_the_mixed_probability() -> None:
    corrections = deep.new_corrections(3).reshape(3, deep.CORRECTION_STEPS) >> 6
    assert (corrections == corrections[0]).all()
    assert (np.diff(corrections[0]) >= 0).all()
    assert corrections[0, 0] == PROBABILITY_MINIMUM
    assert corrections[0, -1] == PROBABILITY_MAXIMUM


@pytest.mark.parametrize("seed", range(4))
def test_the_reference_decoder_agrees(seed: int) -> None:
    decisions = Decisions(seed, 400)
    contexts, weights, final_weights, corrections = new_mixer()
    with RangeDecoder(decisions.encode(new_mixer())) as decoder:
        neurons = DeepNeurons(
            Contexts((contexts >> 8).tolist(), (contexts & 255).tolist()),
            weights.tolist(),
            final_weights.tolist(),
            corrections.tolist(),
            INPUTS,
            RATE,
        )
        found = []
        for places, signs, numbers, choices in zip(*(rows.tolist() for rows in decisions.rows), strict=True):
            *chosen, final, correction = choices
            heard = list(zip(places, signs, strict=True))
            found.append(neurons.bit(decoder, chosen, final, correction, heard, numbers))
    assert found == decisions.bits.tolist()


def test_golden_bytes() -> None:
    """A fixed sequence never takes other bytes within a format version, on any machine."""
    payload = Decisions(7, 500).encode(new_mixer())
    assert (len(payload), zlib.crc32(payload)) == (53, 1050949168)
