"""Decisions from bytes: range coder, contexts, mixed decisions, trained states (docs/format.md, section 2).

An encoder keeps `low` beside the range and resolves carries; it ends with the number of its range that has the most
zero bits at its end, and leaves out the first byte and all zero bytes behind the last other one. Everything that
learns does so from what was decided, so both sides stay the same.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.errors import PacketError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

LEAST_PROBABILITY, GREATEST_PROBABILITY = 48, 65488  # of a one, out of 65536
EVEN = 1 << 15
FIRST_RATE, SLOW_FLOOR, FAST_FLOOR = 32767, 325, 4819  # of contexts, out of 65536
UNSIGNED_CONTEXTS, SIGNED_CONTEXTS = 131, 132
LONGEST = 32  # ones before the zero that no encoder writes
LARGEST_STRETCH = 2047
DECAY = 0xFF801FFAAB554445B04105B043E8F48D  # exp(-1 / 512) 2^128


def clamp(value: int, low: int, high: int) -> int:
    """The nearest number from `low` to `high`."""
    return low if value < low else min(value, high)


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
            raise PacketError("bytes are left over at the end", offset=self._position)


def learned(probability: int, rate: int, bit: int) -> int:
    """A probability one step nearer to the decision; both directions round towards where it comes from."""
    if bit:
        distance = 65535 - probability
        return 65535 - (distance - (distance * rate >> 16))
    return probability - (probability * rate >> 16)


class ContextState(NamedTuple):
    """One context: two probabilities of a one that learn at two speeds, and their rates."""

    slow: int
    fast: int
    slow_rate: int
    fast_rate: int


class Contexts:
    """A row of contexts: two probabilities of a one that learn at two speeds, and their rates."""

    def __init__(self, count: int = 0) -> None:
        self.slow = [EVEN] * count
        self.fast = [EVEN] * count
        self.slow_rate = [FIRST_RATE] * count
        self.fast_rate = [FIRST_RATE] * count

    def copy(self) -> Contexts:
        """The same contexts, which learn apart."""
        made = Contexts()
        made.slow, made.fast = self.slow.copy(), self.fast.copy()
        made.slow_rate, made.fast_rate = self.slow_rate.copy(), self.fast_rate.copy()
        return made

    def bit(self, decoder: RangeDecoder, place: int) -> int:
        """A decision by the context at `place`: the mean of its two probabilities."""
        state = self.state(place)
        bit = decoder.bit(clamp((state.slow + state.fast) >> 1, LEAST_PROBABILITY, GREATEST_PROBABILITY))
        self.learn(place, state, bit)
        return bit

    def state(self, place: int) -> ContextState:
        """What the context at `place` is now."""
        return ContextState(self.slow[place], self.fast[place], self.slow_rate[place], self.fast_rate[place])

    def learn(self, place: int, state: ContextState, bit: int) -> None:
        """The context at `place` becomes what one that was `state` is after a bit."""
        self.slow[place] = learned(state.slow, state.slow_rate, bit)
        self.fast[place] = learned(state.fast, state.fast_rate, bit)
        self.slow_rate[place] = next_rate(state.slow_rate, SLOW_FLOOR)
        self.fast_rate[place] = next_rate(state.fast_rate, FAST_FLOOR)

    def unsigned(self, decoder: RangeDecoder, base: int) -> int:
        """An unsigned integer with the 131 contexts from `base` on."""
        length = 0
        while self.bit(decoder, base + length):
            length += 1
            if length == LONGEST:
                raise PacketError("a number of more than 32 bits")
        successor = 1
        tree = base + LONGEST + 3 * length
        for place in range(length):
            if place == 0:
                bit = self.bit(decoder, tree)
            elif place == 1:
                bit = self.bit(decoder, tree + 1 + (successor & 1))
            else:
                bit = decoder.raw_bits(1)
            successor = 2 * successor + bit
        return successor - 1

    def signed(self, decoder: RangeDecoder, base: int) -> int:
        """A signed integer with the 132 contexts from `base` on."""
        magnitude = self.unsigned(decoder, base)
        if magnitude >= 1 << 31:
            raise PacketError("a number of more than 31 bits")
        if magnitude and self.bit(decoder, base + UNSIGNED_CONTEXTS):
            return -magnitude
        return magnitude


def next_rate(rate: int, floor: int) -> int:
    """The rate after one more decision."""
    return max(rate - (rate * rate >> 16), floor)


def _logistic_tables() -> tuple[list[int], list[int]]:
    """STRETCH of a probability >> 4, and SQUASH of a stretched value + 2048."""
    one = 1 << 128
    powers = [one]  # exp(-k / 512) 2^128
    for _ in range(4098):
        powers.append(powers[-1] * DECAY >> 128)
    squash = []
    for place in range(4096):
        power = powers[2 * abs(place - 2048)]
        probability = ((one if place >= 2048 else power) << 16) // (one + power)
        squash.append(clamp(probability, LEAST_PROBABILITY, GREATEST_PROBABILITY))
    upper = []
    k = 0
    for place in range(2048, 4096):
        while k < LARGEST_STRETCH and powers[2 * k + 1] * (2 * place + 1) > (8191 - 2 * place) * one:
            k += 1
        upper.append(k)
    return [-value for value in reversed(upper)] + upper, squash


STRETCH, SQUASH = _logistic_tables()
NUMBERS = 8  # inputs of a neuron that are not contexts


class Question(NamedTuple):
    """What a decision is mixed from: contexts, which of them hold the opposite, eight numbers, neurons."""

    places: Sequence[int]
    opposed: Sequence[bool]
    numbers: Sequence[int]
    neurons: Sequence[int]
    final_neuron: int


class Prediction(NamedTuple):
    """A question from its prediction until it has been learned from."""

    states: list[ContextState]
    inputs: list[int]
    opinions: list[int]
    probability: int


class Mixer:
    """Mixed decisions: several neurons weigh all inputs, a final one weighs what they say.

    Args:
        contexts: all that there are.
        weights: for each neuron those of its inputs.
        final_weights: for each final neuron eight.
        rate: how slowly neurons learn, as a shift.
    """

    def __init__(self, contexts: Contexts, weights: list[list[int]], final_weights: list[list[int]], rate: int) -> None:
        self.contexts = contexts
        self.weights = weights
        self.final_weights = final_weights
        self._rate = rate

    def copy(self) -> Mixer:
        """The same, which learns apart."""
        rows, final_rows = [list(row) for row in self.weights], [list(row) for row in self.final_weights]
        return Mixer(self.contexts.copy(), rows, final_rows, self._rate)

    def bit(
        self,
        decoder: RangeDecoder,
        places: Sequence[int],
        opposed: Sequence[bool],
        numbers: Sequence[int],
        neurons: Sequence[int],
        final_neuron: int,
    ) -> int:
        """A decision by the contexts at `places`, some of which hold the opposite, and eight numbers."""
        return self.bits(decoder, [Question(places, opposed, numbers, neurons, final_neuron)])[0]

    def bits(self, decoder: RangeDecoder, questions: Sequence[Question]) -> list[int]:
        """Decisions that are asked at once: all are predicted, then decoded, then learned one after the other."""
        predictions = [self._predict(question) for question in questions]
        bits = [decoder.bit(prediction.probability) for prediction in predictions]
        for question, prediction, bit in zip(questions, predictions, bits, strict=True):
            self._learn(question, prediction, bit)
        return bits

    def _predict(self, question: Question) -> Prediction:
        states = [self.contexts.state(place) for place in question.places]
        inputs = _inputs(states, question)
        opinions = [
            clamp(weighted(self.weights[neuron], inputs), -LARGEST_STRETCH, LARGEST_STRETCH)
            for neuron in question.neurons
        ]
        final_row = self.final_weights[question.final_neuron]
        total = clamp(weighted(final_row, opinions), -LARGEST_STRETCH, LARGEST_STRETCH)
        return Prediction(states, inputs, opinions, SQUASH[total + 2048])

    def _learn(self, question: Question, prediction: Prediction, bit: int) -> None:
        """Contexts learn from what they were at the prediction; where two places are the same the last one counts."""
        final_row = self.final_weights[question.final_neuron]
        moved(final_row, prediction.opinions, ((bit << 16) - prediction.probability + 32) >> 6)
        for neuron, opinion in zip(question.neurons, prediction.opinions, strict=True):
            error = (bit << 16) - SQUASH[opinion + 2048]
            moved(self.weights[neuron], prediction.inputs, (error + (1 << (self._rate - 1))) >> self._rate)
        for place, state, against in zip(question.places, prediction.states, question.opposed, strict=True):
            self.contexts.learn(place, state, bit ^ against)


def _inputs(states: list[ContextState], question: Question) -> list[int]:
    """For every four contexts: the means of their probabilities stretched, then the slow ones as they are."""
    signs = [-1 if against else 1 for against in question.opposed]
    stretched = [sign * STRETCH[(state.slow + state.fast) >> 5] for sign, state in zip(signs, states, strict=True)]
    plain = [sign * ((state.slow - EVEN) >> 5) for sign, state in zip(signs, states, strict=True)]
    inputs: list[int] = []
    for first in range(0, len(states), 4):
        inputs += stretched[first : first + 4] + plain[first : first + 4]
    return [*inputs, *question.numbers]


def weighted(weights: list[int], inputs: list[int]) -> int:
    """The sum of the products, as a signed number of 32 bits, in units of 2^14. Weights without inputs do not count."""
    total: int = sum(map(mul, weights, inputs)) & 0xFFFFFFFF
    return (total - (1 << 32) if total >> 31 else total) >> 14


def moved(weights: list[int], inputs: list[int], error: int) -> None:
    """Let a row of weights learn; they stay 16-bit."""
    for place, value in enumerate(inputs):
        if value:
            weight = weights[place] + ((value * error + (1 << 14)) >> 15)
            weights[place] = -32768 if weight < -32768 else min(weight, 32767)


# ---- Trained states

STEPS, RATES = 32, 4


@dataclass(frozen=True)
class Shape:
    """How large a layer's tables are, and how coarsely they are kept.

    Attributes:
        contexts, neurons, final_neurons: how many there are.
        groups: contexts of a decision, a quarter of them.
        rate: how slowly its neurons learn.
        settled: the slow rate, out of 65536, of contexts that were seen often.
        shift, final_shift: weights are multiples of two to the power of these.
        scores, score_shift: of candidates; faces have them.
    """

    contexts: int
    neurons: int
    final_neurons: int
    groups: int
    rate: int
    settled: int
    shift: int
    final_shift: int
    scores: int = 0
    score_shift: int = 0

    @property
    def inputs(self) -> int:
        """Of a neuron."""
        return 8 * self.groups + NUMBERS


@dataclass
class Layer:
    """What one layer knows."""

    mixer: Mixer
    scores: list[int]

    def copy(self) -> Layer:
        """The same, which learns apart."""
        return Layer(self.mixer.copy(), self.scores.copy())


class StatesReader:
    """Reads the states of one layer.

    Args:
        decoder: of the whole file.
    """

    def __init__(self, decoder: RangeDecoder) -> None:
        self._decoder = decoder
        self._rates = Contexts(4 * RATES)
        self._steps = Contexts(8 * STEPS)
        self._numbers = Contexts(SIGNED_CONTEXTS)

    def layer(self, shape: Shape) -> Layer:
        """Scores, contexts, weights and final weights, in this order."""
        scores = self.rows(shape.scores, 1, shape.score_shift)
        contexts = self.contexts(shape.contexts, shape.settled)
        weights = self.rows(shape.neurons, shape.inputs, shape.shift)
        final_weights = self.rows(shape.final_neurons, 8, shape.final_shift)
        return Layer(Mixer(contexts, weights, final_weights, shape.rate), [row[0] for row in scores])

    def contexts(self, count: int, settled: int) -> Contexts:
        """Each by how sure it is and, unless it was never seen, a step of its log-odds."""
        rates = [FIRST_RATE, 13107, 8192 if settled < 4000 else 2 * settled, settled]
        made = Contexts()
        rate, step = 0, STEPS // 2
        for _ in range(count):
            rate = self._tree(self._rates, 4 * rate, 2)
            probability = EVEN
            if rate:
                step = self._tree(self._steps, STEPS * (step >> 2), 5)
                probability = SQUASH[128 * step + 64]
            made.slow.append(probability)
            made.fast.append(probability)
            made.slow_rate.append(rates[rate])
            made.fast_rate.append(max(rates[rate], FAST_FLOOR))
        return made

    def rows(self, count: int, length: int, shift: int) -> list[list[int]]:
        """Rows of numbers, each by its difference from the same one of the row before."""
        made = []
        row = [0] * length
        for _ in range(count):
            row = [((before >> shift) + self._numbers.signed(self._decoder, 0)) << shift for before in row]
            if any(not -32768 <= value <= 32767 for value in row):
                raise PacketError("a weight of more than 16 bits")
            made.append(row)
        return made

    def _tree(self, contexts: Contexts, base: int, depth: int) -> int:
        """A number of `depth` bits, each with the context of the bits before."""
        node = 1
        for _ in range(depth):
            node = 2 * node + contexts.bit(self._decoder, base + node)
        return node - (1 << depth)


@functools.cache
def trained(name: str, shapes: tuple[Shape, ...]) -> list[Layer]:
    """The layers of a states file of the package; copies of them may learn."""
    data = (resources.files("meshtide_codec") / "states" / f"{name}.states").read_bytes()
    with RangeDecoder(data) as decoder:
        return [StatesReader(decoder).layer(shape) for shape in shapes]
