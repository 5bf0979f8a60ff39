"""One connection to a server: a websocket around a client session.

Frames are taken off the socket by a task of their own, so that what arrives is stored at once and the link stays busy
while the caller decodes; what may pile up is bounded, because credit is granted only as the caller goes on. Every way
in which a network fails becomes a TransferError, every way in which the other side turns out to be something else a
ProtocolError.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from meshtide_client.credentials import authorization, find_token
from meshtide_client.frame_meter import FrameMeter
from meshtide_client.handshake import handshake_problem
from meshtide_client.tls import tls_context
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, StreamError, TransferError
from meshtide_codec.stream.messages import LARGEST_MESSAGE
from meshtide_codec.stream.session import DEFAULT_WINDOW, error_frame

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable
    from pathlib import Path

    from meshtide_client.address import MeshAddress
    from meshtide_codec.stream.session import ClientSession, Event

_PING_SECONDS = 20.0
_SLOWEST = 512
"""Bytes of a message that have to come in each time limit after the first one: a trickle is no news."""
_CLOSE_SECONDS = 2.0
_BREACH_CODES = frozenset({1002, 1007, 1009})
"""Close codes with which this side ends a connection whose frames are malformed or too large."""
_BACKLOG_WINDOWS = 8
"""A backlog longer than so many windows means that the server ignores the credit; framing of small packets is
what makes an honest one longer than a window."""


@dataclass(frozen=True, slots=True)
class Link:
    """How a client treats its connection.

    Args:
        timeout: seconds without any part of a message after which the connection is taken for lost, and for opening it.
        retries: how often a lost connection is opened again before giving up; packets that arrive reset the count.
        delay: seconds before the first retry; each further one waits twice as long.
        longest_delay: bound of that.
        window: bytes in flight that the server is allowed.
        rate: bytes a second at which frames are taken, to see a slow link on a fast one; None for no bound.
        token: what is shown to a meshtide server that asks for one; that of the environment when left out.
        ca_file: of the authorities that vouch for servers; those of the environment or the machine when left out.

    Raises:
        OptionError: a value that makes no sense.
    """

    timeout: float = 30.0
    retries: int = 5
    delay: float = 0.5
    longest_delay: float = 10.0
    window: int = DEFAULT_WINDOW
    rate: float | None = None
    token: str | None = field(default_factory=find_token, repr=False)
    ca_file: Path | str | None = None

    def __post_init__(self) -> None:
        for name in ("timeout", "delay", "longest_delay", "window"):
            if not getattr(self, name) > 0:
                raise OptionError(f"the {name.replace('_', ' ')} of a link must be positive, not {getattr(self, name)}")
        if self.retries < 0:
            raise OptionError(f"the retries of a link must not be negative: {self.retries}")
        if self.rate is not None and not self.rate > 0:
            raise OptionError(f"the rate of a link must be positive, not {self.rate}")

    def without_token(self) -> Link:
        """The same, for a server that is none of meshtide's."""
        return replace(self, token=None)


class Connection(ClientConnection):
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


async def open_connection(address: MeshAddress, link: Link) -> Connection:
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
            create_connection=Connection,
            **secured,
        )
        assert isinstance(connection, Connection)  # noqa: S101 - made right above
    except (OSError, WebSocketException, ValueError) as error:
        raise handshake_problem(error, address, link.timeout) from error
    return connection


async def receive_events(
    connection: Connection, session: ClientSession, take: Callable[[Event], None], address: MeshAddress, link: Link
) -> AsyncGenerator[Event, None]:
    """The events of `session` over `connection`, until it is finished; close it to hang up early.

    Args:
        connection: an open connection.
        session: the client's end of the stream.
        take: is called with each event as soon as it is there, however long the caller leaves it in the backlog.
        address: the other side, for messages.
        link: timeout and rate.

    Raises:
        TransferError: the connection was lost.
        ProtocolError: what answers is not a meshtide server.
        PeerError: the server refused.
        StreamError: header or packet are damaged or over the limits.
        Exception: whatever `take` raises.
    """
    intake = _Intake(connection, session, take, address, link)
    await _send(connection, session.hello())
    pump = asyncio.create_task(intake.fill())
    try:
        while (events := await intake.next()) is not None:
            if (grant := session.credit_frame()) is not None:
                await _send(connection, grant)
            for event in events:
                yield event
    except PeerError:
        raise
    except (ProtocolError, StreamError) as error:
        with suppress(WebSocketException, OSError):
            await connection.send(error_frame("protocol", str(error)))
        raise
    finally:
        pump.cancel()
        await connection.close()


class _Intake:
    """Feeds the session with frames as they arrive; what comes of them waits here for the caller."""

    def __init__(
        self,
        connection: Connection,
        session: ClientSession,
        take: Callable[[Event], None],
        address: MeshAddress,
        link: Link,
    ) -> None:
        self._connection = connection
        self._session = session
        self._take = take
        self._address = address
        self._link = link
        self._backlog: deque[tuple[int, list[Event]]] = deque()
        self._waiting_bytes = 0
        self._end: Exception | None = None
        self._ended = False
        self._arrived = asyncio.Event()

    async def fill(self) -> None:
        """Take frames until the stream or the connection ends."""
        started = time.monotonic()
        try:
            while not self._session.finished:
                frame = await self._frame()
                if self._link.rate is not None:
                    due = started + (self._session.received_bytes + len(frame)) / self._link.rate
                    await asyncio.sleep(due - time.monotonic())
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
        self._ended = True
        self._arrived.set()

    async def next(self) -> list[Event] | None:
        """The events of the next frame, or None at the end."""
        while not self._backlog:
            if self._ended:
                if self._end is not None:
                    raise self._end
                return None
            self._arrived.clear()
            await self._arrived.wait()
        size, events = self._backlog.popleft()
        self._waiting_bytes -= size
        return events

    async def _frame(self) -> bytes | str:
        """The next message; it may take its time as long as more of it keeps coming, and not too slowly."""
        frame = asyncio.create_task(self._connection.recv())  # asked for once: fragments outlive no second asking
        begun = heard = self._connection.heard_bytes
        due = 0
        try:
            while not (await asyncio.wait([frame], timeout=self._link.timeout))[0]:
                before, heard = heard, self._connection.heard_bytes
                if heard == before or heard - begun < due:
                    raise TransferError(f"nothing came from {self._address.server} for {self._link.timeout:g} seconds")
                due += _SLOWEST
            return frame.result()
        except ConnectionClosed as error:
            raise _closed(error, self._address) from error
        finally:
            frame.cancel()


async def _send(connection: Connection, frame: bytes) -> None:
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
