"""Models that change what arrives: noise on the values of Diffs, and flipped bits.

Noise is that of Balan & Taubin 2000, section 4.2: x = prediction + Diff + n. Its size is given in steps of the
level's grid, or relative to the root mean square of the very Diffs that it is added to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from scipy.special import ndtri

from meshtide_codec.errors import OptionError
from meshtide_codec.packets import PacketKind
from meshtide_lab.link.checks import check_at_least, check_probability
from meshtide_lab.link.randomness import packet_generator
from meshtide_lab.link.traffic import DAMAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_lab.link.traffic import Fate

Distribution = Literal["gaussian", "uniform", "laplace"]
DISTRIBUTIONS = ("gaussian", "uniform", "laplace")


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise on Diffs; it harms Diffs alone, and is not a loss.

    Args:
        kind: its distribution, of mean 0.
        steps: its standard deviation in steps of the level's grid; or
        relative: its standard deviation as a multiple of the root mean square of the packet's Diffs.
        levels: the levels whose Diffs get it, None for all.

    Raises:
        OptionError: a value out of range, or not exactly one size.
    """

    name: ClassVar[str] = "noise"
    kind: Distribution = "gaussian"
    steps: float | None = None
    relative: float | None = None
    levels: frozenset[int] | None = None

    def __post_init__(self) -> None:
        if self.kind not in DISTRIBUTIONS:
            raise OptionError(f"noise: kind {self.kind!r} is not one of {', '.join(DISTRIBUTIONS)}")
        if (self.steps is None) == (self.relative is None):
            raise OptionError("noise: give its size either in steps or relative to the Diffs, such as relative=1")
        check_at_least(self.name, "its size", self.steps if self.relative is None else self.relative, 0)  # type: ignore[arg-type]

    def apply(self, fates: Sequence[Fate], seed: int, key: str) -> None:
        """See `LinkModel`."""
        for fate in fates:
            if fate.entry.kind is PacketKind.DIFF and (self.levels is None or fate.entry.level in self.levels):
                fate.noises.append(_PacketNoise(self, seed, key, fate.index))


@dataclass(frozen=True, slots=True)
class BitErrors:
    """Flips each bit with the same probability.

    Args:
        rate: the probability.
        checks: whether the receiver looks at checksums: a packet with a flipped bit is then as good as lost. Else it is
            decoded as it is, which fails if the decoder finds it impossible, and shows something wrong if not.

    Raises:
        OptionError: the rate is not a probability.
    """

    name: ClassVar[str] = "biterrors"
    rate: float
    checks: bool = True

    def __post_init__(self) -> None:
        check_probability(self.name, "rate", self.rate)

    def apply(self, fates: Sequence[Fate], seed: int, key: str) -> None:
        """See `LinkModel`."""
        for fate in fates:
            if fate.protected or fate.lost:
                continue
            flipped = self._flipped(8 * fate.entry.length, packet_generator(seed, key, fate.index))
            if flipped and self.checks:
                fate.lose(DAMAGE)
            elif flipped:
                fate.flipped_bits = tuple(sorted(set(fate.flipped_bits) ^ set(flipped)))

    def _flipped(self, bits: int, generator: np.random.Generator) -> list[int]:
        """Places of flipped bits: the gaps between them are geometrically distributed."""
        if self.rate == 0.0:
            return []
        if self.rate == 1.0:
            return list(range(bits))
        places: list[int] = []
        place = -1
        while True:
            gap = math.log1p(-float(generator.random())) / math.log1p(-self.rate)
            if gap >= bits - place - 1:
                return places
            place += 1 + int(gap)
            places.append(place)


@dataclass(frozen=True, slots=True)
class _PacketNoise:
    """The noise of one packet, the same each time it is asked for."""

    model: Noise
    seed: int
    key: str
    packet: int

    def __call__(self, differences: NDArray[np.float64]) -> NDArray[np.float64]:
        size = self.model.steps
        if size is None:
            relative = self.model.relative or 0.0
            size = relative * math.sqrt(float(np.square(differences).mean())) if differences.size else 0.0
        uniforms = packet_generator(self.seed, self.key, self.packet).random(differences.shape)
        return differences + size * _standard(self.model.kind, uniforms)


def _standard(kind: Distribution, uniforms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Numbers of mean 0 and standard deviation 1, by inverting the distribution function."""
    if kind == "uniform":
        return math.sqrt(12.0) * (uniforms - 0.5)
    inside = np.clip(uniforms, 2.0**-54, 1.0 - 2.0**-53)
    if kind == "gaussian":
        normal: NDArray[np.float64] = ndtri(inside)
        return normal
    centred = inside - 0.5
    magnitudes: NDArray[np.float64] = -np.sign(centred) * np.log1p(-2.0 * np.abs(centred)) / math.sqrt(2.0)
    return magnitudes


def flipped(payload: bytes, bits: Sequence[int]) -> bytes:
    """The payload with some bits changed; bit 0 is the lowest of the first byte.

    >>> flipped(bytes(2), (0, 15)).hex()
    '0180'
    """
    changed = bytearray(payload)
    for bit in bits:
        changed[bit >> 3] ^= 1 << (bit & 7)
    return bytes(changed)
