"""A lossy link: a chain of models with a seed, what it plans for a stream, and the receiver behind it (Sans-I/O).

The plan is made from the header alone. The receiver pushes what gets through into a decoder in the order in which it
arrives on the virtual clock, so that a stored stream and one from a server end in the same mesh.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING, Any

from meshtide_codec.decoder import Decoder
from meshtide_codec.errors import MeshtideError
from meshtide_lab.link.damage import flipped
from meshtide_lab.link.syntax import parse_models, parse_unprotected
from meshtide_lab.link.traffic import PROTECTED, Fate

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray

    from meshtide_client.download.packet_filter import PacketFilter
    from meshtide_codec.limits import Limits
    from meshtide_codec.packets import Packet, PacketKind
    from meshtide_codec.stream.header import StreamHeader
    from meshtide_lab.link.traffic import LinkModel

UNDECODABLE = "undecodable"
"""Cause of a packet that arrived, but that the decoder could not use: damaged unnoticed, or what it builds on is."""


@dataclasses.dataclass(frozen=True)
class LossyLink:
    """Models and a seed.

    Args:
        models: the chain, first to last.
        seed: of all random numbers.
        protected: kinds of packets that are never lost or damaged.

    >>> from meshtide_codec.encoder import encode
    >>> from meshtide_codec.samples import load_sample
    >>> link = LossyLink.parse("drop:kind=diff,level=0", seed=1)
    >>> received = receive(link, (stream := encode(load_sample("spot"))).header, stream.packets)
    >>> received.report.lost, received.decoder.is_exact(0)
    (1, False)
    """

    models: tuple[LinkModel, ...]
    seed: int = 0
    protected: frozenset[PacketKind] = PROTECTED

    @classmethod
    def parse(cls, text: str, seed: int = 0, unprotected: str = "") -> LossyLink:
        """The link that `text` describes, see `syntax`.

        Raises:
            OptionError: unknown models, parameters or kinds, or values out of range.
        """
        return cls(parse_models(text), seed, parse_unprotected(unprotected))

    def receiver(self, header: StreamHeader, limits: Limits | None = None, count: int | None = None) -> LossyReceiver:
        """A receiver behind this link; by it the packets of a download are lost before they are decoded.

        What is kept on disk is what the server sent. Time passes on the link's virtual clock only: a packet that the
        plan delivers late goes to the decoder after those that it delivers before, and after the deadline not at all.
        """
        return LossyReceiver(self, header, limits, count)

    def plan(self, header: StreamHeader) -> list[Fate]:
        """What happens to each packet of a stream, in transmission order.

        Raises:
            OptionError: a model that drops packets names protected ones.
        """
        fates = [Fate(entry, index, entry.kind in self.protected) for index, entry in enumerate(header.packets)]
        named: Counter[str] = Counter()
        for model in self.models:
            key = f"{model.name}{named[model.name] or ''}"
            named[model.name] += 1
            model.apply(fates, self.seed, key)
        return fates


@dataclasses.dataclass
class LinkReport:
    """What a link did to a stream so far.

    Args:
        sent: packets that came to the link.
        sent_bytes: their bytes.
        received: packets that the decoder took.
        received_bytes: their bytes.
        seconds: when the last one arrived on the virtual clock.
        causes: lost packets by cause: a model's name, "bit errors" or "undecodable".
        lost_kinds: lost packets by kind.
        damaged: packets with flipped bits that the decoder took without noticing.
        perturbed: packets whose Diffs got noise.
    """

    sent: int = 0
    sent_bytes: int = 0
    received: int = 0
    received_bytes: int = 0
    seconds: float = 0.0
    causes: Counter[str] = dataclasses.field(default_factory=Counter)
    lost_kinds: Counter[str] = dataclasses.field(default_factory=Counter)
    damaged: int = 0
    perturbed: int = 0

    @property
    def lost(self) -> int:
        """Packets that were lost, for whatever cause."""
        return sum(self.causes.values())

    def plain(self) -> dict[str, Any]:
        """The figures, for programs."""
        figures = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return figures | {"lost": self.lost, "causes": dict(self.causes), "lost_kinds": dict(self.lost_kinds)}

    def summary(self) -> str:
        """One sentence for a person.

        >>> LinkReport(sent=3, received=3).summary()
        '0 of 3 packets lost'
        """
        text = f"{self.lost} of {self.sent} packets lost"
        if self.lost:
            causes = ", ".join(f"{count} by {cause}" for cause, count in sorted(self.causes.items()))
            kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.lost_kinds.items()))
            text += f" ({causes}; {kinds})"
        if self.damaged:
            text += f", {self.damaged} decoded in spite of bit errors"
        if self.perturbed:
            text += f", Diffs of {self.perturbed} perturbed"
        if self.seconds:
            text += f"; the last one that counts arrived after {self.seconds:.3f} s on the link's clock"
        return text


def lossy_filter(text: str, seed: int, unprotected: str) -> PacketFilter:
    """What `LossyLink.parse` makes, as downloads ask for it: entry point `loss` of the group ``meshtide.links``."""
    return LossyLink.parse(text, seed, unprotected)


class LossyReceiver:
    """A decoder behind a lossy link.

    Args:
        link: the link.
        header: of the stream, which is never lost.
        limits: what the header may claim.
        count: how many packets will be sent, from the first; all when left out.

    Raises:
        OptionError: the link cannot be planned.
        ContainerError, LimitError: as `Decoder`.
    """

    def __init__(
        self, link: LossyLink, header: StreamHeader, limits: Limits | None = None, count: int | None = None
    ) -> None:
        self.fates = link.plan(header)[:count]
        self.report = LinkReport()
        self._noises = {
            (fate.entry.level, fate.entry.slice): fate.noises for fate in self.fates if fate.noises and not fate.lost
        }
        self.decoder = Decoder(header, limits, self._perturb if self._noises else None)
        arriving = (fate for fate in self.fates if not fate.lost)
        self._due = [fate.index for fate in sorted(arriving, key=lambda fate: (fate.seconds, fate.index))]
        self._next = 0
        self._waiting: dict[int, Packet] = {}
        self.resolved: list[bool] = [False] * len(self.fates)
        """Which packets are known to have arrived, or to be lost."""

    def take(self, packet: Packet) -> None:
        """Take the next packet that was sent; those whose turn it is by the link's clock go on to the decoder."""
        fate = self.fates[self.report.sent]
        self.report.sent += 1
        self.report.sent_bytes += fate.entry.length
        if fate.cause is not None:
            self._lose(fate, fate.cause)
            return
        self._waiting[fate.index] = packet
        while self._next < len(self._due) and self._due[self._next] in self._waiting:
            index = self._due[self._next]
            self._next += 1
            self._deliver(self.fates[index], self._waiting.pop(index))

    def is_settled(self, count: int) -> bool:
        """Whether the first `count` packets were all sent, and nothing more will come of them."""
        return count <= len(self.resolved) and all(self.resolved[:count])

    def _deliver(self, fate: Fate, packet: Packet) -> None:
        self.report.seconds = max(self.report.seconds, fate.seconds)
        if fate.flipped_bits:
            packet = dataclasses.replace(packet, payload=flipped(packet.payload, fate.flipped_bits))
        try:
            self.decoder.push(packet)
        except MeshtideError:
            self._lose(fate, UNDECODABLE)
            return
        self.resolved[fate.index] = True
        self.report.received += 1
        self.report.received_bytes += fate.entry.length
        self.report.damaged += bool(fate.flipped_bits)
        self.report.perturbed += bool(fate.noises)

    def _lose(self, fate: Fate, cause: str) -> None:
        self.resolved[fate.index] = True
        self.report.causes[cause] += 1
        self.report.lost_kinds[fate.entry.kind.label] += 1

    def _perturb(self, level: int, part: int, differences: NDArray[np.float64]) -> NDArray[np.float64]:
        for noise in self._noises.get((level, part), ()):
            differences = noise(differences)
        return differences


@dataclasses.dataclass(frozen=True, slots=True)
class Received:
    """What came out of a link.

    Args:
        decoder: with all that got through.
        report: what the link did.
    """

    decoder: Decoder
    report: LinkReport


def receive(link: LossyLink, header: StreamHeader, packets: Iterable[Packet]) -> Received:
    """Send a stored stream over a link.

    Raises:
        OptionError: the link cannot be planned.
    """
    receiver = LossyReceiver(link, header)
    for packet in packets:
        receiver.take(packet)
    return Received(receiver.decoder, receiver.report)
