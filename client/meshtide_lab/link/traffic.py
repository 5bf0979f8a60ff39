"""The packets of a stream on their way through a chain of models."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Protocol

from meshtide_codec.packets import PacketKind

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.stream.header import PacketEntry

DAMAGE = "bit errors"
ALL_KINDS = frozenset(PacketKind)
PROTECTED = ALL_KINDS - {PacketKind.DIFF}
"""What a link does no harm to unless one asks for it: everything but Diffs."""


class DiffNoise(Protocol):
    """Noise on the Diffs of one packet."""

    def __call__(self, differences: NDArray[np.float64]) -> NDArray[np.float64]:
        """Diffs (n, 3) in steps of their level's grid, with the noise added."""


@dataclasses.dataclass
class Fate:
    """What a link does to one packet.

    Args:
        entry: the packet's row in the header.
        index: its place in the stream.
        protected: whether it cannot be lost; it takes its time all the same.
        seconds: when it arrives, on a clock that starts with the first packet.
        cause: name of the model that lost it, or None.
        flipped_bits: bits of its payload that arrive wrong, ascending; they matter only if checksums are off.
        noises: noise on its Diffs, in the order in which it is added.
    """

    entry: PacketEntry
    index: int
    protected: bool
    seconds: float = 0.0
    cause: str | None = None
    flipped_bits: tuple[int, ...] = ()
    noises: list[DiffNoise] = dataclasses.field(default_factory=list)

    @property
    def lost(self) -> bool:
        """Whether it never arrives."""
        return self.cause is not None

    def lose(self, cause: str) -> None:
        """Lose the packet, unless it is protected or lost already."""
        if not self.protected and self.cause is None:
            self.cause = cause


class LinkModel(Protocol):
    """One model of a chain; a frozen dataclass of its parameters."""

    @property
    def name(self) -> str:
        """What it is called in the textual form."""

    def apply(self, fates: Sequence[Fate], seed: int, key: str) -> None:
        """Let the model act on all packets of a stream, given in transmission order.

        Args:
            fates: what the models before have made of them.
            seed: of the link.
            key: under which the model draws its random numbers.
        """
