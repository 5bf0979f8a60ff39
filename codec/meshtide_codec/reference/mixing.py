"""Decisions mixed from several contexts by a neuron, integers throughout (docs/format.md, section 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.reference.models import Contexts
    from meshtide_codec.reference.range_decoder import RangeDecoder

WEIGHT_BITS = 14
LARGEST_WEIGHT = 8 << WEIGHT_BITS
LARGEST_STRETCHED = 2047
ONE = 1 << 128
DECAY = 0xFF801FFAAB554445B04105B043E8F48D  # 2^128 exp(-1/512), rounded down


def _decays(count: int) -> list[int]:
    decays = [ONE]
    while len(decays) < count:
        decays.append((decays[-1] * DECAY) >> 128)
    return decays


def _squash_table() -> list[int]:
    decays = _decays(4097)
    table = []
    for index in range(4096):
        decay = decays[2 * abs(index - 2048)]
        numerator = ONE if index >= 2048 else decay
        table.append(min(max((numerator << 16) // (ONE + decay), 48), 65488))
    return table


def _stretch_table() -> list[int]:
    decays = _decays(4098)
    table = [0] * 4096
    place = 0
    for index in range(2048, 4096):
        while place < LARGEST_STRETCHED and decays[2 * place + 1] * (2 * index + 1) > (8191 - 2 * index) << 128:
            place += 1
        table[index], table[4095 - index] = place, -place
    return table


SQUASH = _squash_table()
STRETCH = _stretch_table()


class Neurons:
    """Contexts, and neurons of so many inputs each that mix them.

    Args:
        contexts: the contexts.
        weights: the weights of all neurons, one behind the other.
        inputs: inputs of a neuron.
    """

    def __init__(self, contexts: Contexts, weights: Sequence[int], inputs: int) -> None:
        self.contexts = contexts
        self._weights = list(weights)
        self._inputs = inputs

    def bit(
        self,
        decoder: RangeDecoder,
        neuron: int,
        places: Sequence[int],
        rate: int,
        limit: int,
        signs: Sequence[int] | None = None,
    ) -> int:
        """A decision mixed by `neuron` from the contexts at `places`, of which each speaks with its sign.

        `rate` is the shift of the weights' steps, `limit` the cap of the contexts' counts.
        """
        signs = signs or [1] * self._inputs
        first = neuron * self._inputs
        opinions = [
            STRETCH[self.contexts.probabilities[place] >> 4] * sign for place, sign in zip(places, signs, strict=True)
        ]
        total = sum(self._weights[first + i] * opinion for i, opinion in enumerate(opinions)) >> WEIGHT_BITS
        probability = SQUASH[min(max(total, -LARGEST_STRETCHED), LARGEST_STRETCHED) + 2048]
        bit = decoder.bit(probability)
        error = (bit << 16) - probability
        for i, opinion in enumerate(opinions):
            weight = self._weights[first + i] + ((opinion * error + (1 << (rate - 1))) >> rate)
            self._weights[first + i] = min(max(weight, -LARGEST_WEIGHT), LARGEST_WEIGHT)
        for place, sign in zip(places, signs, strict=True):
            self.contexts.learn(place, bit if sign > 0 else 1 - bit, limit)
        return bit
