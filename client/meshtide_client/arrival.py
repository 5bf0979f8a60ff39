"""A stream from its first packet to its last, across as many connections as it takes.

What arrives goes into a holding. When the connection is lost, a new one is opened after a pause and asked only for
what the holding lacks; when the server's stream has changed meanwhile, the holding starts over.
"""

from __future__ import annotations

import asyncio
import random
from contextlib import aclosing
from typing import TYPE_CHECKING

from meshtide_client.transport import open_connection, receive_events
from meshtide_codec.errors import PeerError, TransferError
from meshtide_codec.stream.session import ClientSession, HeaderEvent, PacketEvent

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable

    from meshtide_client.address import MeshAddress
    from meshtide_client.holding import Holding
    from meshtide_client.transport import Link
    from meshtide_codec.limits import Limits
    from meshtide_codec.stream.session import Event, Until

_PASSING_CODES = frozenset({"not-ready", "shutting-down", "timeout"})
"""Refusals that a later attempt may not meet."""


class Arrival:
    """The events of one download.

    Args:
        address: the mesh.
        holding: where packets go; what it holds already is not asked for.
        until: how much of the stream is wanted.
        link: how the connection is treated.
        notify: is told in one sentence when the connection is lost or the stream has changed.
        limits: what the header may claim.
    """

    def __init__(
        self,
        address: MeshAddress,
        holding: Holding,
        *,
        until: Until,
        link: Link,
        notify: Callable[[str], None],
        limits: Limits | None = None,
    ) -> None:
        self._address = address
        self._holding = holding
        self._until = until
        self._link = link
        self._notify = notify
        self._limits = limits
        self._failures = 0
        self._earlier_bytes = 0
        self._session: ClientSession | None = None

    @property
    def received_bytes(self) -> int:
        """Bytes of header and packet parts that have come over the network, over all connections."""
        return self._earlier_bytes + (self._session.received_bytes if self._session else 0)

    async def events(self) -> AsyncGenerator[Event, None]:
        """All events until the server has sent what was asked for; packets are in the holding before they are told.

        Raises:
            TransferError: there was no connection, or it was lost too often.
            ProtocolError, PeerError, StreamError: the server is none, refused, or sent something damaged.
            OSError: the holding cannot be written.
        """
        connected = False
        while True:
            self._session = self._new_session()
            try:
                connection = await open_connection(self._address, self._link)
                connected = True
                arriving = receive_events(connection, self._session, self._take, self._address, self._link)
                async with aclosing(arriving) as events:
                    async for event in events:
                        yield event
            except (TransferError, PeerError) as error:
                await self._pause(error, connected)
            else:
                return

    def _new_session(self) -> ClientSession:
        self._earlier_bytes = self.received_bytes
        return ClientSession(
            self._address.mesh,
            until=self._until,
            held_header=self._holding.header_bytes,
            held=range(self._holding.count),
            window=self._link.window,
            limits=self._limits,
        )

    def _take(self, event: Event) -> None:
        if isinstance(event, PacketEvent):
            self._holding.append(event.index, event.data)
            self._failures = 0
        elif isinstance(event, HeaderEvent) and not event.resumed:
            if self._holding.header is not None:
                self._notify(f"the stream of {self._address.mesh} has changed on the server; the download starts over")
            self._holding.begin(event.header, event.header_bytes)

    async def _pause(self, error: TransferError | PeerError, connected: bool) -> None:
        """Wait before the next attempt, or raise `error` with what is held if there is to be none."""
        if isinstance(error, PeerError):
            if error.code not in _PASSING_CODES:
                raise error
            connected = True
        if not connected or self._failures >= self._link.retries:
            attempts = f" after {self._failures} more attempts" if self._failures else ""
            ending = f"{attempts}; {self._holding.told()}"
            if isinstance(error, PeerError):
                raise PeerError(error.code, f"{error.message}{ending}") from error
            raise TransferError(f"{error}{ending}") from error
        seconds = min(self._link.delay * 2**self._failures, self._link.longest_delay)
        seconds *= random.uniform(0.75, 1.25)  # noqa: S311 - spreads the clients of a server that comes back; no secret
        self._failures += 1
        self._notify(f"{error}; trying again in {seconds:.1f} s ({self._failures} of {self._link.retries})")
        await asyncio.sleep(seconds)
