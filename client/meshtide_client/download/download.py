"""One mesh on its way, from its address to levels: the walk of every fetch.

    Attempts.next_events     a websocket or a file, as many connections as it takes; packets are kept as they come
    Download.levels          new packets go to the decoder, in a thread of their own; what they complete comes out

Iterators inside each other are three at most: `stream`, `Download.levels`, and the pieces of a file.
"""

from __future__ import annotations

import math
import sys
import time
from contextlib import aclosing, closing
from typing import TYPE_CHECKING

from meshtide_client.connection.link import Link
from meshtide_client.download.attempts import Attempts
from meshtide_client.download.decoding_thread import DecodingThread
from meshtide_client.download.levels import ReceivedLevel
from meshtide_client.download.packet_filter import DirectReceiver
from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import ContainerError, TransferError
from meshtide_codec.limits import Limits
from meshtide_codec.packets import LARGEST_LEVEL
from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_codec.stream.plain_values import LARGEST_INTEGER
from meshtide_codec.stream.session import HeaderEvent, PacketEvent, Until

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable, Iterable

    from meshtide_client.connection.tide_address import Address
    from meshtide_client.download.holding import Holding
    from meshtide_client.download.packet_filter import FilterReport, PacketFilter, Receiver
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import LevelEntry, StreamHeader
    from meshtide_codec.stream.session import Event


class Download:
    """One download and its decoder.

    Args:
        address: the mesh.
        holding: where packets go, and where earlier ones are.
        until: how much of the stream is wanted.
        link: timeout, retries and rate of the connection.
        limits: what the stream may claim.
        notify: called with one sentence that a person should read.
        progress: is called with the bytes of the file that are there, and that there will be.
        transport: as in `stream`.
        loss: what packets go through before they are decoded; levels that lost something by it are not exact.
    """

    def __init__(
        self,
        address: Address,
        holding: Holding,
        *,
        until: Until | None = None,
        link: Link | None = None,
        limits: Limits | None = None,
        notify: Callable[[str], None] | None = None,
        progress: Callable[[int, int], None] | None = None,
        transport: str = "auto",
        loss: PacketFilter | None = None,
    ) -> None:
        self.address = address
        check_type("until", until, Until, type(None))
        check_type("the link", link, Link, type(None))
        check_type("limits", limits, Limits, type(None))
        self._asked_level = until.level if until else None
        self._until = _sendable(until or Until())
        self._limits = limits
        self._holding = holding
        self._progress = progress or (lambda _size, _total: None)
        self._notify = notify or (lambda _: None)
        self._attempts = Attempts(
            address,
            holding,
            until=self._until,
            link=link or Link(),
            notify=self._notify,
            limits=limits,
            transport=transport,
        )
        self._loss = loss
        self._receiver: Receiver | None = None
        self._settled: set[int] = set()
        """Places in the header of the levels of which nothing more will come."""
        self._nearest = math.inf
        self._wanted = 0
        self._started = time.monotonic()

    @property
    def header(self) -> StreamHeader | None:
        """The stream's header, once it is there."""
        return self._holding.header

    @property
    def more(self) -> bool:
        """Whether the stream has packets that are not held."""
        header = self._holding.header
        return header is None or self._holding.count < len(header.packets)

    @property
    def received_bytes(self) -> int:
        """Bytes of header and packets that have come over the network."""
        return self._attempts.received_bytes

    @property
    def transport(self) -> str | None:
        """The transport that brought what has come."""
        return self._attempts.transport

    @property
    def seconds(self) -> float:
        """Seconds since the download began."""
        return time.monotonic() - self._started

    @property
    def link_report(self) -> FilterReport | None:
        """What the packets went through did to them, if it was anything, once the stream has begun."""
        return None if self._receiver is None else self._receiver.report

    async def levels(self) -> AsyncGenerator[ReceivedLevel, None]:
        """The levels as they become complete, or as complete as they will; see `stream` for what is raised.

        Raises:
            TransferError: packets were lost on the way to the decoder, and no level can be shown without them.
        """
        shown = False
        with closing(DecodingThread()) as thread:
            async with aclosing(self._attempts):
                while (events := await self._attempts.next_events()) is not None:
                    for event in events:
                        for packet in self._new_packets(event):
                            for level in await thread.run(self._decode, packet):
                                shown = True
                                yield level
        report = self.link_report
        if not shown and report is not None and report.lost:
            raise TransferError(f"the link left no level that can be shown: {report.summary()}")

    def _new_packets(self, event: Event) -> Iterable[Packet]:
        """The packets that `event` makes available for decoding."""
        packets: Iterable[Packet] = ()
        if isinstance(event, PacketEvent):
            packets = [event.packet]
        elif isinstance(event, HeaderEvent) and (self._receiver is None or not event.resumed):
            self._begin(event.header, self._until.packet_count(event.header, len(event.header_bytes)))
            packets = list(self._holding.stored_packets())[: self._wanted]
        header = self._holding.header
        if header is not None:
            total = self._file_size(int(header.packet_offsets[self._wanted]))
            self._progress(min(self._holding.size, total), total)
        return packets

    def _begin(self, header: StreamHeader, wanted: int) -> None:
        """Decode a stream from its first packet on."""
        self._wanted = wanted
        self._nearest = math.inf
        level, coarsest = self._asked_level, header.levels[0].level
        if level is not None and level > coarsest:
            self._notify(f"the stream has levels 0 to {coarsest}, and not {level}: the coarsest is fetched")
        self._settled.clear()
        if self._loss is None:
            self._receiver = DirectReceiver(header, self._limits)
        else:
            self._receiver = self._loss.receiver(header, self._limits, wanted)

    def _decode(self, packet: Packet) -> list[ReceivedLevel]:
        """The levels of which nothing more will come after `packet`, if they show the mesh better than those before.

        A preview may lie nearer to the surface than the first levels of the hierarchy that follow it. The finest
        level, and one that was asked for by its number, always count; no claim of another one to be as good as the
        finest puts those behind it aside.
        """
        receiver = self._receiver
        assert receiver is not None  # noqa: S101 - the header comes first
        receiver.take(packet)
        completed = []
        for place, row in enumerate(receiver.decoder.header.levels):
            if place in self._settled or not receiver.is_settled(row.packet_count):
                continue
            self._settled.add(place)
            if receiver.report is not None and not receiver.decoder.is_available(row.level):
                continue
            known = _is_known(receiver, row)
            if not known or row.rms < self._nearest or row.level in {0, self._until.level}:
                completed.append(row)
                self._nearest = min(self._nearest, row.rank if known else math.inf)
        return [self._received_level(receiver, row) for row in completed]

    def _received_level(self, receiver: Receiver, row: LevelEntry) -> ReceivedLevel:
        """The figures are those of the mesh as it was decoded; what the header says of it may be wrong.

        Raises:
            ContainerError: the level is not there, although the header says that it should be.
        """
        decoder = receiver.decoder
        if not decoder.is_available(row.level):
            raise ContainerError(
                f"level {row.level} is not complete after {row.packet_count} packets, as the header says; "
                "the stream is damaged"
            )
        mesh = decoder.mesh(row.level)
        known = _is_known(receiver, row)
        return ReceivedLevel(
            level=row.level,
            vertices=len(mesh.vertices),
            faces=len(mesh.faces),
            exact=decoder.is_exact(row.level),
            rms=row.rms if known else math.nan,
            maximum=row.maximum if known else math.nan,
            size=self._file_size(decoder.header.level_bytes(row)),
            seconds=self.seconds,
            mesh=mesh,
        )

    def _file_size(self, packet_bytes: int) -> int:
        """Bytes of the file when its packets have so many."""
        return PREAMBLE_BYTES + len(self._holding.header_bytes) + packet_bytes


def _is_known(receiver: Receiver, row: LevelEntry) -> bool:
    """Whether a level is what the header says of it; nobody knows how far one is off that has lost something."""
    return receiver.report is None or receiver.decoder.is_exact(row.level)


def _sendable(until: Until) -> Until:
    """The same bounds in numbers that a wire message can hold."""
    level = until.level if until.level is None else min(until.level, LARGEST_LEVEL)
    error = until.error if until.error is None else min(until.error, sys.float_info.max)
    size = until.size if until.size is None else min(until.size, LARGEST_INTEGER)
    return Until(level, error, size)
