"""A lossy link between a real server and the decoder: packets arrive by network, and meet the link's plan here.

What is kept on disk is what the server sent. Time passes on the link's virtual clock only: a packet that the plan
delivers late goes to the decoder after those that it delivers before, and after the deadline not at all.
"""

from __future__ import annotations

import dataclasses
import math
from contextlib import aclosing
from typing import TYPE_CHECKING, Any

from meshtide_client.link.lossy_link import LossyReceiver
from meshtide_client.streaming import Reception
from meshtide_codec.errors import TransferError

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator

    from meshtide_client.holding import Holding
    from meshtide_client.link.lossy_link import LinkReport, LossyLink
    from meshtide_client.streaming import ReceivedLevel
    from meshtide_client.tide_address import Address
    from meshtide_codec.decoder import Decoder
    from meshtide_codec.stream.header import LevelEntry, StreamHeader
    from meshtide_codec.stream.packets import Packet


class LossyReception(Reception):
    """One download whose packets go over a lossy link; levels that lost something are told as not exact.

    Args:
        address: the mesh.
        holding: where packets go, and where earlier ones are.
        loss: the link.
        settings: the other arguments of `Reception`.
    """

    def __init__(self, address: Address, holding: Holding, loss: LossyLink, **settings: Any) -> None:  # noqa: ANN401
        super().__init__(address, holding, **settings)
        self._loss = loss
        self._receiver: LossyReceiver | None = None
        self._told: set[int] = set()

    @property
    def link_report(self) -> LinkReport | None:
        """What the link did, once the stream has begun."""
        return None if self._receiver is None else self._receiver.report

    async def levels(self) -> AsyncGenerator[ReceivedLevel, None]:
        """The levels as they become as complete as they will.

        Raises:
            TransferError: the link lost what every level needs; and what `Reception` raises.
        """
        shown = False
        async with aclosing(super().levels()) as levels:
            async for level in levels:
                shown = True
                yield level
        if not shown and self.link_report is not None and self.link_report.lost:
            raise TransferError(f"the link left no level that can be shown: {self.link_report.told()}")

    def _new_decoder(self, header: StreamHeader) -> Decoder:
        self._receiver = LossyReceiver(self._loss, header, self._limits, self._wanted)
        self._told.clear()
        return self._receiver.decoder

    def _decode(self, packet: Packet) -> list[ReceivedLevel]:
        """The levels of which nothing more will come after `packet`, as far as they can be shown."""
        assert self._receiver is not None  # noqa: S101 - the header comes first
        receiver, decoder = self._receiver, self._receiver.decoder
        receiver.take(packet)
        completed = []
        for place, row in enumerate(decoder.header.levels):
            if place in self._told or not receiver.resolved_before(row.packet_count):
                continue
            self._told.add(place)
            exact = decoder.is_exact(row.level)
            wanted = not exact or row.rms < self._nearest or row.level in {0, self._until.level}
            if decoder.is_available(row.level) and wanted:
                completed.append(row)
                self._nearest = min(self._nearest, row.rank if exact else math.inf)
        return [self._received_level(decoder, row) for row in completed]

    def _received_level(self, decoder: Decoder, row: LevelEntry) -> ReceivedLevel:
        level = super()._received_level(decoder, row)
        if level.exact:
            return level
        return dataclasses.replace(level, rms=math.nan, maximum=math.nan)
