"""A stream from its first packet to its last, across as many connections as it takes.

What arrives goes into a holding. When the connection is lost, a new one is opened after a pause and asked only for
what the holding lacks; when the server's stream has changed meanwhile, the holding starts over. Where one transport
does not get through, the next one goes on: websocket, ranges over HTTP, a plain download.

Nothing goes on for ever: attempts are counted until a packet comes that was not held, and so are changes of the stream.
Every error says which packets are missing, and what is kept.
"""

from __future__ import annotations

import asyncio
import random
from typing import TYPE_CHECKING, TypeVar, cast

from meshtide_client.connection.tide_address import TideAddress
from meshtide_client.download.file_session import FileSession
from meshtide_client.download.ranges import FileTransport, open_source
from meshtide_client.download.transport import transports_for
from meshtide_client.download.websocket import WebsocketTransport
from meshtide_codec.errors import MeshtideError, PeerError, ProtocolError, StreamError, TransferError
from meshtide_codec.stream.session import ClientSession, HeaderEvent, PacketEvent
from meshtide_codec.stream.shortage import find_shortage

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_client.connection.link import Link
    from meshtide_client.connection.tide_address import Address
    from meshtide_client.download.holding import Holding
    from meshtide_client.download.transport import Transport
    from meshtide_codec.limits import Limits
    from meshtide_codec.stream.session import Event, Until

_Problem = TypeVar("_Problem", bound=TransferError | ProtocolError | StreamError)
_PASSING_CODES = frozenset({"not-ready", "shutting-down", "timeout"})
"""Refusals that a later attempt may not meet."""


class Attempts:
    """The events of one download, which end when everything that was asked for is held.

    Args:
        address: the mesh, or the file.
        holding: where packets go; what it holds already is not asked for.
        until: how much of the stream is wanted.
        link: how the connection is treated.
        notify: called with one sentence when the connection is lost or the stream has changed.
        limits: what the header may claim.
        transport: "auto" for whichever works first, or the one to use.

    Raises:
        OptionError: the address cannot be read by that transport.
    """

    def __init__(
        self,
        address: Address,
        holding: Holding,
        *,
        until: Until,
        link: Link,
        notify: Callable[[str], None],
        limits: Limits | None = None,
        transport: str = "auto",
    ) -> None:
        self._transports = list(transports_for(address, transport))
        self._used: str | None = None
        self._first_problem: TransferError | ProtocolError | None = None
        self._moved = False
        self._address = address
        self._holding = holding
        self._until = until
        self._link = link
        self._notify = notify
        self._limits = limits
        self._failures = 0
        self._changes = 0
        self._earlier_bytes = 0
        self._transport: Transport | None = None
        self._connected = False

    @property
    def transport(self) -> str | None:
        """The name of the transport that brought the last event."""
        return self._used

    @property
    def received_bytes(self) -> int:
        """Bytes of header and packets that have come over the network, over all connections."""
        return self._earlier_bytes + (self._transport.received_bytes if self._transport else 0)

    async def next_events(self) -> list[Event] | None:
        """The events that come next, or None at the end; packets are in the holding before they are returned.

        Raises:
            OptionError: the holding is a file that is to be kept, and holds another stream.
            TransferError: there was no connection, or it was lost too often.
            ProtocolError, PeerError, StreamError: the server is none, refused, or sent something damaged.
            OSError: the holding cannot be written.
        """
        while True:
            transport = self._transport = self._transport or self._new_transport()
            try:
                events = await transport.next_events()
            except (TransferError, ProtocolError) as error:
                await self.aclose()
                await self._recover(error, transport)
            except StreamError as error:
                raise self._with_what_is_held(error) from error
            else:
                if events:
                    self._connected = True
                    self._note(transport.name)
                return events

    async def aclose(self) -> None:
        """Hang up; whoever asks for events again connects again."""
        if self._transport is not None:
            transport, self._earlier_bytes, self._transport = self._transport, self.received_bytes, None
            await transport.aclose()

    def _new_transport(self) -> Transport:
        """One more connection, by the transport whose turn it is, for what is not held."""
        address, name = self._address, self._transports[0]
        if name == "websocket":
            assert not isinstance(address, TideAddress)  # noqa: S101 - transports_for() has seen to it
            session = ClientSession(
                address.mesh,
                until=self._until,
                held_header=self._holding.header_bytes,
                held=range(self._holding.count),
                window=self._link.window,
                limits=self._limits,
            )
            return WebsocketTransport(address, session, self._take, self._link)
        file_session = FileSession(
            until=self._until,
            held_header=self._holding.header_bytes,
            held=self._holding.count,
            limits=self._limits,
        )
        source = open_source(address, name, self._link)
        return FileTransport(source, file_session, self._take, str(address), self._link.rate)

    def _note(self, name: str) -> None:
        """Note which transport works; a person hears of it if it is not the first one."""
        if self._used != name and self._first_problem is not None:
            self._notify(f"{self._first_problem}; reading by {name} instead")
        self._used = name

    def _take(self, event: Event) -> None:
        if isinstance(event, PacketEvent):
            self._holding.append(event.index, event.data)
            self._failures = 0
            self._moved = True
        elif isinstance(event, HeaderEvent) and not event.resumed:
            changed = self._holding.header is not None
            if changed:
                self._count_change()
            self._holding.begin(event.header, event.header_bytes)
            if changed:
                self._notify(f"the stream of {self._address.mesh} has changed on the server; the download starts over")

    def _count_change(self) -> None:
        """The server has another stream than the one that is held: an honest one changes it now and then."""
        self._changes += 1
        if self._changes > 1 + self._link.retries:
            raise ProtocolError(f"the stream of {self._address} has changed on the server {self._changes} times")

    async def _recover(self, error: TransferError | ProtocolError, transport: Transport) -> None:
        """Wait before the next attempt, turn to the next transport, or raise `error` with what is held."""
        refused = isinstance(error, PeerError)
        passing = isinstance(error, TransferError) or (isinstance(error, PeerError) and error.code in _PASSING_CODES)
        self._connected = self._connected or transport.connected
        heard = self._connected or refused or transport.received_bytes > 0
        if passing and heard and self._failures < self._link.retries:
            await self._pause(error)
            return
        problem = _extended(error, f" after {self._failures} more attempts") if passing and self._failures else error
        if refused or len(self._transports) == 1:
            raise self._with_what_is_held(self._verdict(problem)) from error
        self._first_problem = self._first_problem or problem
        self._transports.pop(0)
        self._failures, self._connected, self._moved = 0, False, False

    def _verdict(self, last: TransferError | ProtocolError) -> TransferError | ProtocolError:
        """What to raise once no transport is left: why the first one failed, unless a later one got further."""
        first = self._first_problem
        if first is None or self._moved or isinstance(last, PeerError):
            return last
        if isinstance(first, TransferError) and isinstance(last, TransferError):
            return first
        return type(first)(f"{first}; by {self._transports[0]}: {last}")

    def _with_what_is_held(self, error: _Problem) -> _Problem:
        """The same error, which also says what is missing and what is kept."""
        clauses = []
        header = self._holding.header
        if header is not None:
            wanted = self._until.packet_count(header, len(self._holding.header_bytes))
            shortage = find_shortage(header, range(self._holding.count), wanted)
            if shortage is not None and str(shortage) not in str(error):
                clauses.append(str(shortage))
        if header is not None or isinstance(error, TransferError):
            clauses.append(self._holding.summary(repeat=not isinstance(error, StreamError)))
        return _extended(error, "".join(f"; {clause}" for clause in clauses)) if clauses else error

    async def _pause(self, error: TransferError | ProtocolError) -> None:
        """Wait before the next attempt."""
        seconds = min(self._link.delay * 2**self._failures, self._link.longest_delay)
        seconds *= random.uniform(0.75, 1.25)  # noqa: S311 - spreads the clients of a server that comes back; no secret
        self._failures += 1
        self._notify(f"{error}; trying again in {seconds:.1f} s ({self._failures} of {self._link.retries})")
        await asyncio.sleep(seconds)


def _extended(error: _Problem, ending: str) -> _Problem:
    """An error of the same kind whose message goes on."""
    made: MeshtideError
    if isinstance(error, PeerError):
        made = PeerError(error.code, f"{error.message}{ending}")
    elif isinstance(error, StreamError):
        message = f"{error.message}{ending}"
        made = type(error)(message, level=error.level, packet=error.packet, offset=error.offset)
    else:
        made = type(error)(f"{error}{ending}")
    return cast("_Problem", made)
