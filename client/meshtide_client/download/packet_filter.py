"""What may stand between the packets that arrive and the decoder: nothing, or a lossy link, for experiments.

Filters are made by whatever is registered as `loss` in the group of entry points ``meshtide.links``: the laboratory's
package does so, which this one must not import. What is asked of a filter is written down here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from meshtide_client.other_packages import offered
from meshtide_codec.decoder import Decoder

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.limits import Limits
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

GROUP = "meshtide.links"
NAME = "loss"


class FilterReport(Protocol):
    """What a filter did to a stream so far."""

    @property
    def lost(self) -> int:
        """Packets that were lost, for whatever cause."""

    def plain(self) -> dict[str, Any]:
        """The figures, for programs."""

    def summary(self) -> str:
        """One sentence for a person."""


class Receiver(Protocol):
    """Takes the packets of a stream in the order in which they were sent, and decodes those that get through."""

    @property
    def decoder(self) -> Decoder:
        """With all that has got through."""

    @property
    def report(self) -> FilterReport | None:
        """What the filter in front did so far; None where there is none, so that nothing is ever lost."""

    def take(self, packet: Packet) -> None:
        """Take the next packet.

        Raises:
            PacketError: it cannot be decoded, and that is not a work of the filter.
        """

    def is_settled(self, count: int) -> bool:
        """Whether the first `count` packets were all sent, and nothing more will come of them."""


class PacketFilter(Protocol):
    """What a stream goes through before it is decoded."""

    def receiver(self, header: StreamHeader, limits: Limits | None, count: int) -> Receiver:
        """A receiver behind this filter.

        Args:
            header: of the stream, which no filter harms.
            limits: what it may claim.
            count: how many packets will be sent, from the first.

        Raises:
            OptionError: this filter cannot be used with such a stream.
            ContainerError, LimitError: as `Decoder`.
        """


class DirectReceiver:
    """A receiver behind nothing: every packet is decoded as it comes.

    Args:
        header: of the stream.
        limits: what it may claim.

    Raises:
        ContainerError, LimitError: as `Decoder`.
    """

    def __init__(self, header: StreamHeader, limits: Limits | None) -> None:
        self.decoder = Decoder(header, limits)
        self.report: FilterReport | None = None
        self._count = 0

    def take(self, packet: Packet) -> None:
        """See Receiver."""
        self.decoder.push(packet)
        self._count += 1

    def is_settled(self, count: int) -> bool:
        """See Receiver."""
        return count <= self._count


def find_filter() -> Callable[[str, int, str], PacketFilter]:
    """What makes a filter of the description of a lossy link, a seed, and the kinds of packets that it may lose.

    Raises:
        OptionError: there is none, because the laboratory is not installed.
    """
    found: Callable[[str, int, str], PacketFilter] = offered(
        GROUP,
        NAME,
        missing="a lossy link needs the laboratory, the package meshtide_lab, which is not installed here",
        remedy="install it, or fetch without --loss",
    )
    return found
