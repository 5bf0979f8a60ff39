"""A protocol in front of another one: it hands on what arrives in pieces that it has looked at, a few in each turn.

What stands behind it, another package's protocol, keeps whatever it is given, and works it off in one go. So
bytes wait here, where they are counted: of what a client sends without pause a few pieces are handed on before others
have their turn, and while any wait, nothing more is read from the socket, so that no more than one read's worth is ever
held. It relies on asyncio's protocols and transports alone.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from meshtide_server.http.connection import Connection

PIECES_A_TURN = 16
"""Pieces that are handed on before others have their turn."""
LINGER_SECONDS = 1.0
"""How long a connection that is given up is still read from, unheard: an end at once could take the last words along
that were sent to the client."""


class Door:
    """The connection as the protocol behind a gate sees it: reading is paused by way of the gate, closing as well."""

    def __init__(self, transport: asyncio.Transport, gate: Gate) -> None:
        self.outside = transport
        self._gate = gate
        self._corked: list[bytes | bytearray | memoryview] | None = None

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send; what is for a client that has left is dropped, for uvloop's closed transports raise an error."""
        if self._corked is not None:
            self._corked.append(data)
        elif not self.outside.is_closing():
            self.outside.write(data)

    def cork(self) -> None:
        """Keep what is written."""
        self._corked = []

    def abort(self) -> None:
        """End the connection at once."""
        self.outside.abort()

    def uncork(self) -> None:
        """Send what was kept, in one piece."""
        kept, self._corked = self._corked, None
        if kept:
            self.write(b"".join(kept))

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the transport has
        return getattr(self.outside, name)

    def pause_reading(self) -> None:
        """Hand on no more for now."""
        self._gate.hold(held=True)

    def resume_reading(self) -> None:
        """Go on."""
        self._gate.hold(held=False)

    def is_closing(self) -> bool:
        """Whether the connection is closed, or about to be."""
        return self._gate.lingering or self.outside.is_closing()

    def close(self) -> None:
        """Close the connection once all is sent; one that was given up a little later."""
        if self._gate.deaf:
            self._gate.linger()
        else:
            self.outside.close()


class Gate(asyncio.Protocol):
    """Stands before `inner`; a subclass decides in `cut` what a piece is, and what may not pass.

    Args:
        inner: the protocol behind.
        connection: what the application knows of it.
    """

    def __init__(self, inner: asyncio.Protocol, connection: Connection) -> None:
        self.inner = inner
        self.connection = connection
        self.transport: asyncio.Transport
        self.deaf = False
        """Whether the connection is given up: nothing that arrives is handed on any more."""
        self.lingering = False
        """Whether it is open only for what was sent last to arrive."""
        self._waiting = bytearray()
        self._held = False
        self._working = False
        self._turn: asyncio.Handle | None = None

    @property
    def waiting(self) -> int:
        """Bytes that wait here."""
        return len(self._waiting)

    def cut(self, waiting: bytearray) -> int | float:
        """How many of the waiting bytes are handed on next, as an int; 0 if more have to arrive before.

        A float is the number of seconds after which to ask again.
        """
        raise NotImplementedError

    def replaced(self) -> bool:
        """Whether another protocol has taken the connection over."""
        return False

    def blocked(self) -> bool:
        """Whether nothing may be handed on before `proceed` is called."""
        return False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by the event loop, or by the protocol that was there before, with its own view of the connection."""
        given: Any = transport
        self.transport = given.outside if isinstance(given, Door) else given
        door = self.door()
        self.connection.opened(door, self.proceed)
        self.inner.connection_made(cast("asyncio.Transport", door))

    def door(self) -> Door:
        """The connection as the protocol behind is to see it."""
        return Door(self.transport, self)

    def take_over(self, rest: bytes) -> None:
        """Go on with a connection of which another gate has read `rest`."""
        if rest:
            self.data_received(rest)
        self._regulate()

    def data_received(self, data: bytes) -> None:
        """Called by the event loop."""
        if self.deaf:
            return
        self._waiting += data
        if self._turn is None and not self._held:
            self.work()

    def eof_received(self) -> bool | None:
        """Called by the event loop."""
        return None if self.deaf else self.inner.eof_received()

    def pause_writing(self) -> None:
        """Called by the event loop."""
        self.inner.pause_writing()

    def resume_writing(self) -> None:
        """Called by the event loop."""
        self.inner.resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by the event loop."""
        self.deaf = True
        self._forget()
        self.inner.connection_lost(exc)

    def hold(self, *, held: bool) -> None:
        """Stop handing on, or go on; called by the protocol behind."""
        self._held = held
        if self._working or self.deaf:
            return
        if not held and self._waiting and self._turn is None:
            self._after(0.0)
        self._regulate()

    def proceed(self) -> None:
        """Go on with what waits; called when an answer has been given."""
        if not self.deaf and self._waiting and not self._held and self._turn is None and not self._working:
            self._after(0.0)

    def work(self) -> None:
        """One turn: hand on a few pieces."""
        self._turn = None
        self._working = True
        pause: float | None = 0.0
        for _ in range(PIECES_A_TURN):
            if self._held or self.deaf or self.transport.is_closing() or not self._waiting:
                pause = None
                break
            size = self.cut(self._waiting)
            if isinstance(size, float) or not size:
                pause = size or None
                break
            piece = bytes(memoryview(self._waiting)[:size])
            del self._waiting[:size]
            self.inner.data_received(piece)
            if self.replaced():
                self._hand_over()
                return
        self._working = False
        if pause is not None and self._waiting and not self.deaf:
            self._after(pause)
        self._regulate()

    def give_up(self, *, said: bytes = b"", heard: bytes = b"") -> None:
        """Hand on nothing more, and end the connection in a way that the client can see why.

        Args:
            said: to the client.
            heard: by the protocol behind, which may say something itself.
        """
        self.deaf = True
        self._forget()
        if heard:
            self.inner.data_received(heard)
        if said and not self.transport.is_closing():
            self.transport.write(said)
        self.linger()

    def linger(self) -> None:
        """Close the connection for the client, and a little later altogether."""
        if self.lingering:
            return
        self.lingering = True
        with suppress(OSError, RuntimeError, NotImplementedError):  # it is closed already, or has no such thing
            self.transport.write_eof()
        self._regulate()
        asyncio.get_running_loop().call_later(LINGER_SECONDS, self.transport.abort)

    def _hand_over(self) -> None:
        """Leave the connection to the protocol that has taken it over, with what has arrived since."""
        rest = bytes(self._waiting)
        self.deaf = True
        self._forget()
        successor = self.transport.get_protocol()
        assert isinstance(successor, Gate)  # noqa: S101 - what replaces a gate is one
        successor.take_over(rest)

    def _after(self, seconds: float) -> None:
        loop = asyncio.get_running_loop()
        self._turn = loop.call_later(seconds, self.work) if seconds else loop.call_soon(self.work)

    def _forget(self) -> None:
        """Let go of what waits."""
        self._waiting.clear()
        if self._turn is not None:
            self._turn.cancel()
            self._turn = None

    def _regulate(self) -> None:
        """Read from the socket only when all that could be handed on has been."""
        if self.transport.is_closing():
            return
        if not self.deaf and (self._held or self._turn is not None or (self._waiting and self.blocked())):
            self.transport.pause_reading()
        else:
            self.transport.resume_reading()
