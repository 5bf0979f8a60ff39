"""Models that lose packets: chosen ones, each on its own, or in bursts (Gilbert-Elliott).

Sources: E. N. Gilbert, "Capacity of a burst-noise channel", Bell System Technical Journal 39 (1960); E. O. Elliott,
"Estimates of error rates for codes on burst-noise channels", ibid. 42 (1963).

A model with a `unit` cuts packets into datagrams of so many bytes; a packet is lost when any of its datagrams is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from meshtide_codec.errors import OptionError
from meshtide_lab.link.checks import check_at_least, check_probability
from meshtide_lab.link.randomness import packet_uniforms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.packets import PacketKind
    from meshtide_lab.link.traffic import Fate


@dataclass(frozen=True, slots=True)
class Drop:
    """Loses chosen packets; what is left out matches all.

    Args:
        kind: kind of packet.
        levels: their levels.
        slices: their slices.
        packets: their indices in the stream.
    """

    name: ClassVar[str] = "drop"
    kind: PacketKind | None = None
    levels: frozenset[int] | None = None
    slices: frozenset[int] | None = None
    packets: frozenset[int] | None = None

    def apply(self, fates: Sequence[Fate], _seed: int, _key: str) -> None:
        """See `LinkModel`; refuses protected packets when they are named by their kind."""
        for fate in fates:
            entry = fate.entry
            wanted = (
                self.kind in {None, entry.kind}
                and (self.levels is None or entry.level in self.levels)
                and (self.slices is None or entry.slice in self.slices)
                and (self.packets is None or fate.index in self.packets)
            )
            if wanted and self.kind is not None and fate.protected:
                raise OptionError(
                    f"drop names {self.kind.label} packets, which are protected; say that they are not (--unprotected)"
                )
            if wanted:
                fate.lose(self.name)


@dataclass(frozen=True, slots=True)
class IndependentLoss:
    """Loses each packet, or datagram, with the same probability.

    Args:
        rate: the probability.
        unit: bytes of a datagram; 0 for whole packets.

    Raises:
        OptionError: a value out of range.
    """

    name: ClassVar[str] = "loss"
    rate: float
    unit: int = 0

    def __post_init__(self) -> None:
        check_probability(self.name, "rate", self.rate)
        check_at_least(self.name, "unit", self.unit, 0)

    def apply(self, fates: Sequence[Fate], seed: int, key: str) -> None:
        """See `LinkModel`."""
        for fate in fates:
            if (packet_uniforms(seed, key, fate.index, datagrams(fate, self.unit)) < self.rate).any():
                fate.lose(self.name)


@dataclass(frozen=True, slots=True)
class GilbertElliott:
    """Loses packets by a chain of two states, good and bad, that moves on with every packet or datagram.

    It moves on with protected packets too, and starts in its stationary distribution.

    Args:
        p: probability of going from good to bad.
        r: probability of going from bad to good.
        good: probability of loss in the good state.
        bad: probability of loss in the bad state.
        unit: bytes of a datagram; 0 for whole packets.

    Raises:
        OptionError: a value out of range, or a chain that never moves.

    >>> model = GilbertElliott.with_mean(0.05, burst=10)
    >>> round(model.mean_loss, 12), model.r
    (0.05, 0.1)
    """

    name: ClassVar[str] = "gilbert"
    p: float
    r: float
    good: float = 0.0
    bad: float = 1.0
    unit: int = 0

    def __post_init__(self) -> None:
        for parameter in ("p", "r", "good", "bad"):
            check_probability(self.name, parameter, getattr(self, parameter))
        check_at_least(self.name, "unit", self.unit, 0)
        if self.p + self.r == 0.0:
            raise OptionError("gilbert: p and r are both 0, so the chain never moves; use loss:rate=... instead")

    @classmethod
    def with_mean(cls, loss: float, burst: float, unit: int = 0) -> GilbertElliott:
        """The chain that loses everything in the bad state and nothing in the good one, with these means.

        Args:
            loss: mean loss rate, in [0, 1).
            burst: mean number of packets lost in a row, at least 1.
            unit: bytes of a datagram; 0 for whole packets.

        Raises:
            OptionError: a value out of range, or no such chain: losses so frequent come in longer bursts.
        """
        check_probability(cls.name, "loss", loss)
        check_at_least(cls.name, "burst", burst, 1)
        if loss == 1.0 or loss / (1 - loss) > burst:
            raise OptionError(f"gilbert: a mean loss of {loss:g} takes bursts longer than {burst:g} packets")
        return cls(p=loss / (1 - loss) / burst, r=1 / burst, unit=unit)

    @property
    def bad_share(self) -> float:
        """Probability of the bad state, in the long run."""
        return self.p / (self.p + self.r)

    @property
    def mean_loss(self) -> float:
        """Probability that a packet is lost, in the long run."""
        return self.bad_share * self.bad + (1 - self.bad_share) * self.good

    def losses(self, uniforms: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of k packets are lost, given numbers (k, 2) in [0, 1): one moves the chain, one decides there."""
        bad = bool(len(uniforms)) and float(uniforms[0, 0]) < self.bad_share
        lost = np.empty(len(uniforms), bool)
        for index, (moves, decides) in enumerate(uniforms.tolist()):
            if index:
                bad = moves >= self.r if bad else moves < self.p
            lost[index] = decides < (self.bad if bad else self.good)
        return lost

    def apply(self, fates: Sequence[Fate], seed: int, key: str) -> None:
        """See `LinkModel`."""
        counts = [datagrams(fate, self.unit) for fate in fates]
        drawn = [
            packet_uniforms(seed, key, fate.index, 2 * count).reshape(count, 2)
            for fate, count in zip(fates, counts, strict=True)
        ]
        lost = self.losses(np.concatenate([np.zeros((0, 2)), *drawn]))
        starts = np.cumsum([0, *counts])
        for fate, first, end in zip(fates, starts[:-1], starts[1:], strict=True):
            if lost[first:end].any():
                fate.lose(self.name)


def datagrams(fate: Fate, unit: int) -> int:
    """How many datagrams a packet takes: at least one."""
    return max(1, -(-fate.entry.length // unit)) if unit else 1
