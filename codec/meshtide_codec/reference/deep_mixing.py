"""Decisions mixed deeply, for effort high, integers throughout (docs/format.md, section 6.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.mixing import LARGEST_STRETCHED, SQUASH, STRETCH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.reference.models import Contexts
    from meshtide_codec.reference.range_decoder import RangeDecoder

SLOW_LIMIT, FAST_LIMIT = 200, 12
WEIGHT_BITS = 16
LARGEST_WEIGHT = 8 << WEIGHT_BITS
FINAL_RATE = 19
CORRECTION_STEPS = 33


class DeepNeurons:
    """Contexts, neurons that mix them, final neurons that mix those, and corrections.

    Args:
        contexts: the slow ones, then as many fast ones.
        weights: of all neurons, one behind the other.
        final_weights: of all final neurons.
        corrections: CORRECTION_STEPS for each class.
        inputs: inputs of a neuron.
        rate: shift of the neurons' steps.
    """

    def __init__(
        self,
        contexts: Contexts,
        weights: Sequence[int],
        final_weights: Sequence[int],
        corrections: Sequence[int],
        inputs: int,
        rate: int,
    ) -> None:
        self._contexts = contexts
        self._fast = len(contexts.probabilities) // 2
        self._weights = list(weights)
        self._final_weights = list(final_weights)
        self._corrections = list(corrections)
        self._inputs = inputs
        self._rate = rate

    def bit(
        self,
        decoder: RangeDecoder,
        chosen: Sequence[int],
        final: int,
        correction: int,
        heard: Sequence[tuple[int, int]],
        numbers: Sequence[int],
    ) -> int:
        """A decision mixed by the `chosen` neurons and the `final` one.

        `heard` are the slow contexts' places with their signs, `numbers` the plain inputs.
        """
        inputs = self._heard(heard) + list(numbers)
        firsts = [neuron * self._inputs for neuron in chosen]
        said = [_within(self._product(self._weights, first, inputs) >> WEIGHT_BITS) for first in firsts]
        last = final * len(chosen)
        stretched = _within(self._product(self._final_weights, last, said) >> WEIGHT_BITS)
        mixed = SQUASH[stretched + 2048]
        step, part = divmod(stretched + 2048, 128)
        lower = correction * CORRECTION_STEPS + step
        corrected = (self._corrections[lower] * (128 - part) + self._corrections[lower + 1] * part) >> 13
        bit = decoder.bit((mixed + corrected) >> 1)

        nearer = lower + (part >= 64)
        self._corrections[nearer] += ((65535 * 64 * bit) - self._corrections[nearer]) >> 6
        _move(self._final_weights, last, said, (bit << 16) - mixed, FINAL_RATE)
        for first, output in zip(firsts, said, strict=True):
            _move(self._weights, first, inputs, (bit << 16) - SQUASH[output + 2048], self._rate)
        for place, sign in heard:
            self._contexts.learn(place, bit if sign > 0 else 1 - bit, SLOW_LIMIT)
            self._contexts.learn(place + self._fast, bit if sign > 0 else 1 - bit, FAST_LIMIT)
        return bit

    def _heard(self, heard: Sequence[tuple[int, int]]) -> list[int]:
        """What the contexts say: slow and fast ones stretched, then slow and fast ones plain."""
        both = [*heard, *((place + self._fast, sign) for place, sign in heard)]
        chances = [(self._contexts.probabilities[place], sign) for place, sign in both]
        stretched = [STRETCH[chance >> 4] * sign for chance, sign in chances]
        return stretched + [((chance - 32768) * sign) >> 5 for chance, sign in chances]

    @staticmethod
    def _product(weights: list[int], first: int, inputs: list[int]) -> int:
        return sum(weights[first + place] * value for place, value in enumerate(inputs))


def _within(stretched: int) -> int:
    return min(max(stretched, -LARGEST_STRETCHED), LARGEST_STRETCHED)


def _move(weights: list[int], first: int, inputs: list[int], error: int, rate: int) -> None:
    for place, value in enumerate(inputs):
        weight = weights[first + place] + ((value * error + (1 << (rate - 1))) >> rate)
        weights[first + place] = min(max(weight, -LARGEST_WEIGHT), LARGEST_WEIGHT)
