"""A stream over a websocket: one connection to a server around a client session.

Frames are taken off the socket by a task of their own, so that what arrives is stored at once and the link stays busy
while the caller decodes; what may pile up is bounded, because credit is granted only as the caller goes on. Every way
in which a network fails becomes a TransferError, every way in which the other side turns out to be something else a
ProtocolError.
"""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from meshtide_client.connection.credentials import authorization
from meshtide_client.connection.tls import tls_context
from meshtide_client.download.frame_meter import FrameMeter
from meshtide_client.download.handshake import handshake_problem
from meshtide_client.download.pace import Pace
from meshtide_codec.errors import PeerError, ProtocolError, StreamError, TransferError
from meshtide_codec.stream.messages import LARGEST_MESSAGE
from meshtide_codec.stream.session import error_frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_client.connection.address import MeshAddress
    from meshtide_client.connection.link import Link
    from meshtide_codec.stream.session import ClientSession, Event

_PING_SECONDS = 20.0
_SLOWEST = 512
"""Bytes of a message that have to come in each time limit after the first one: a trickle is not a news."""
_CLOSE_SECONDS = 2.0
_BREACH_CODES = frozenset({1002, 1007, 1009})
"""Close codes with which this side ends a connection whose frames are malformed or too large."""
_BACKLOG_WINDOWS = 8
"""A backlog longer than so many windows means that the server ignores the credit; framing of small packets is
what makes an honest one longer than a window."""


class WebsocketTransport:
    """The events of a session over one websocket.

    Args:
        address: the other side.
        session: the client's end of the stream.
        take: is called with each event as soon as it is there, however long the caller leaves it in the backlog.
        link: timeout, rate, token, and who vouches for the server.
    """

    name = "websocket"

    def __init__(self, address: MeshAddress, session: ClientSession, take: Callable[[Event], None], link: Link) -> None:
        self._address = address
        self._session = session
        self._take = take
        self._link = link
        self._connection: MeteredConnection | None = None
        self._pump: asyncio.Task[None] | None = None
        self._backlog: deque[tuple[int, list[Event]]] = deque()
        self._waiting_bytes = 0
        self._end: Exception | None = None
        self._arrived = asyncio.Event()

    @property
    def connected(self) -> bool:
        """See Transport."""
        return self._connection is not None

    @property
    def received_bytes(self) -> int:
        """See Transport."""
        return self._session.received_bytes

    async def next_events(self) -> list[Event] | None:
        """See Transport."""
        connection = await self._open() if self._connection is None else self._connection
        try:
            while (events := await self._next_frame()) is not None:
                if (grant := self._session.credit_frame()) is not None:
                    await _send(connection, grant)
                if events:
                    break
        except PeerError:
            raise
        except (ProtocolError, StreamError) as error:
            with suppress(WebSocketException, OSError):
                await connection.send(error_frame("protocol", str(error)))
            raise
        return events

    async def aclose(self) -> None:
        """See Transport."""
        if self._pump is not None:
            self._pump.cancel()
        if self._connection is not None:
            await self._connection.close()

    async def _open(self) -> MeteredConnection:
        self._connection = await open_connection(self._address, self._link)
        await _send(self._connection, self._session.hello())
        self._pump = asyncio.create_task(self._fill(self._connection))
        return self._connection

    async def _fill(self, connection: MeteredConnection) -> None:
        """Take frames until the stream or the connection ends."""
        pace = Pace(self._link.rate)
        try:
            while not self._session.finished:
                frame = await self._frame(connection)
                await pace.take(len(frame))
                events = self._session.receive(frame)
                for event in events:
                    self._take(event)
                self._backlog.append((len(frame), events))
                self._waiting_bytes += len(frame)
                if self._waiting_bytes > _BACKLOG_WINDOWS * self._link.window:
                    raise ProtocolError(f"{self._address.server} sends more than it was allowed")
                self._arrived.set()
        except Exception as error:  # noqa: BLE001 - raised again where one waits for what comes next
            self._end = error
        self._arrived.set()

    async def _next_frame(self) -> list[Event] | None:
        """The events of the next frame, or None at the end."""
        while not self._backlog:
            if self._end is not None:
                raise self._end
            if self._session.finished:
                return None
            self._arrived.clear()
            await self._arrived.wait()
        size, events = self._backlog.popleft()
        self._waiting_bytes -= size
        return events

    async def _frame(self, connection: MeteredConnection) -> bytes | str:
        """The next message; it may take its time as long as more of it keeps coming, and not too slowly."""
        frame = asyncio.create_task(connection.recv())  # asked for once: fragments outlive no second asking
        begun = heard = connection.heard_bytes
        due = 0
        try:
            while not (await asyncio.wait([frame], timeout=self._link.timeout))[0]:
                before, heard = heard, connection.heard_bytes
                if heard == before or heard - begun < due:
                    raise TransferError(f"nothing came from {self._address.server} for {self._link.timeout:g} seconds")
                due += _SLOWEST
            return frame.result()
        except ConnectionClosed as error:
            raise _closed(error, self._address) from error
        finally:
            frame.cancel()


class MeteredConnection(ClientConnection):
    """A connection that counts the bytes of messages as they come, also those of a frame that is not whole yet."""

    def __init__(self, *arguments: Any, **named: Any) -> None:  # noqa: ANN401 - the library's
        super().__init__(*arguments, **named)
        self._meter = FrameMeter()

    @property
    def heard_bytes(self) -> int:
        """Bytes of messages that have come; pings and the like are none."""
        return self._meter.message_bytes

    def data_received(self, data: bytes) -> None:
        """Called by the event loop."""
        self._meter.feed(data)
        super().data_received(data)


async def open_connection(address: MeshAddress, link: Link) -> MeteredConnection:
    """A websocket to the stream of a mesh.

    Raises:
        OptionError: the file of authorities cannot be used.
        TransferError: there is no connection.
        ProtocolError: something answers that is not a meshtide server.
        PeerError: the server refused.
    """
    secured: dict[str, Any] = {"ssl": tls_context(link.ca_file)} if address.server.secure else {}
    try:
        connection = await connect(
            address.stream_url,
            additional_headers=authorization(link.token),
            compression=None,  # packets are compressed
            max_size=LARGEST_MESSAGE,
            open_timeout=link.timeout,
            ping_interval=_PING_SECONDS,
            ping_timeout=None,  # on a slow link an answer queues behind a window of data; the backlog has its own clock
            close_timeout=_CLOSE_SECONDS,
            proxy=None if address.server.is_loopback else True,
            create_connection=MeteredConnection,
            **secured,
        )
        assert isinstance(connection, MeteredConnection)  # noqa: S101 - made right above
    except (OSError, WebSocketException, ValueError) as error:
        raise handshake_problem(error, address, link.timeout) from error
    return connection


async def _send(connection: MeteredConnection, frame: bytes) -> None:
    with suppress(ConnectionClosed):  # what the server said before it closed, and that it did, comes from the backlog
        await connection.send(frame)


def _closed(error: ConnectionClosed, address: MeshAddress) -> TransferError | ProtocolError:
    """What the end of a connection means."""
    if error.sent is not None and not error.rcvd_then_sent and error.sent.code in _BREACH_CODES:
        return ProtocolError(f"{address.server} does not keep to the protocol: {error.sent.reason or error}")
    if error.rcvd is None:
        reason = "it closed without a word" if error.sent is None else str(error.sent.reason or error)
    else:
        reason = f"closed with code {error.rcvd.code}" + (f": {error.rcvd.reason}" if error.rcvd.reason else "")
    return TransferError(f"the connection to {address.server} was lost ({reason})")
