"""Models that take time, on a virtual clock: bandwidth, delay, jitter; and the deadline after which it is too late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from meshtide_lab.link.checks import check_at_least, check_positive
from meshtide_lab.link.randomness import packet_uniforms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_lab.link.traffic import Fate


@dataclass(frozen=True, slots=True)
class Bandwidth:
    """A queue in front of a link that takes so many bytes a second; what was lost before it takes no time on it.

    Args:
        rate: bytes a second.

    Raises:
        OptionError: the rate is not positive.
    """

    name: ClassVar[str] = "bandwidth"
    rate: float

    def __post_init__(self) -> None:
        check_positive(self.name, "rate", self.rate)

    def apply(self, fates: Sequence[Fate], _seed: int, _key: str) -> None:
        """See `LinkModel`."""
        free = 0.0
        for fate in sorted((fate for fate in fates if not fate.lost), key=lambda fate: (fate.seconds, fate.index)):
            free = max(free, fate.seconds) + fate.entry.length / self.rate
            fate.seconds = free


@dataclass(frozen=True, slots=True)
class Delay:
    """Every packet arrives later by the same time.

    Args:
        seconds: by how much.

    Raises:
        OptionError: it is negative.
    """

    name: ClassVar[str] = "delay"
    seconds: float

    def __post_init__(self) -> None:
        check_at_least(self.name, "seconds", self.seconds, 0)

    def apply(self, fates: Sequence[Fate], _seed: int, _key: str) -> None:
        """See `LinkModel`."""
        for fate in fates:
            fate.seconds += self.seconds


@dataclass(frozen=True, slots=True)
class Jitter:
    """Every packet arrives later by a time of its own, evenly distributed; packets may overtake each other.

    Args:
        seconds: the longest time.

    Raises:
        OptionError: it is negative.
    """

    name: ClassVar[str] = "jitter"
    seconds: float

    def __post_init__(self) -> None:
        check_at_least(self.name, "seconds", self.seconds, 0)

    def apply(self, fates: Sequence[Fate], seed: int, key: str) -> None:
        """See `LinkModel`."""
        for fate in fates:
            fate.seconds += self.seconds * float(packet_uniforms(seed, key, fate.index, 1)[0])


@dataclass(frozen=True, slots=True)
class Deadline:
    """What has not arrived by then counts as lost; protected packets are waited for.

    Args:
        seconds: after the first packet was sent.

    Raises:
        OptionError: it is negative.
    """

    name: ClassVar[str] = "deadline"
    seconds: float

    def __post_init__(self) -> None:
        check_at_least(self.name, "seconds", self.seconds, 0)

    def apply(self, fates: Sequence[Fate], _seed: int, _key: str) -> None:
        """See `LinkModel`."""
        for fate in fates:
            if fate.seconds > self.seconds:
                fate.lose(self.name)
