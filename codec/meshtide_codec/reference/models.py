"""Adaptive contexts, and integers made of decisions with contexts (docs/format.md, section 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import PacketError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.reference.range_decoder import RangeDecoder

UNSIGNED_CONTEXTS = 131
SIGNED_CONTEXTS = 132
LONGEST = 32  # ones before the zero that no encoder writes
LARGEST_COUNT = 200
RATES = [655360 // (10 * count + 16) for count in range(LARGEST_COUNT + 1)]


class Contexts:
    """A row of contexts: for each the probability of a one, in 65536ths, and how many decisions it has seen."""

    def __init__(self, probabilities: Sequence[int], counts: Sequence[int]) -> None:
        self.probabilities = list(probabilities)
        self.counts = list(counts)

    @classmethod
    def fresh(cls, count: int) -> Contexts:
        """`count` contexts at even chances that have seen nothing."""
        return cls([1 << 15] * count, [0] * count)

    def learn(self, place: int, bit: int, limit: int = LARGEST_COUNT) -> None:
        """Move the context at `place` towards the decision; its count grows up to `limit`."""
        target = 65535 if bit else 0
        probability, count = self.probabilities[place], self.counts[place]
        self.probabilities[place] = probability + (((target - probability) * RATES[count]) >> 16)
        self.counts[place] = min(count + 1, limit)

    def bit(self, decoder: RangeDecoder, place: int) -> int:
        """A decision with the context at `place`."""
        bit = decoder.bit(self.probabilities[place])
        self.learn(place, bit)
        return bit

    def unsigned(self, decoder: RangeDecoder, base: int) -> int:
        """An unsigned integer with the 131 contexts from `base` on."""
        length = 0
        while self.bit(decoder, base + length):
            length += 1
            if length == LONGEST:
                raise PacketError("an integer is longer than any encoder writes; the stream is damaged")
        shifted = 1
        tree = base + LONGEST + 3 * length
        for place in range(length):
            if place == 0:
                bit = self.bit(decoder, tree)
            elif place == 1:
                bit = self.bit(decoder, tree + 1 + (shifted & 1))
            else:
                bit = decoder.raw_bits(1)
            shifted = 2 * shifted + bit
        return shifted - 1

    def signed(self, decoder: RangeDecoder, base: int) -> int:
        """A signed integer with the 132 contexts from `base` on."""
        magnitude = self.unsigned(decoder, base)
        if magnitude >= 1 << 31:
            raise PacketError("an integer is larger than any encoder writes; the stream is damaged")
        if magnitude and self.bit(decoder, base + UNSIGNED_CONTEXTS):
            return -magnitude
        return magnitude
