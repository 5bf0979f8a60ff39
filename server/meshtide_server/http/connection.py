"""A connection as the application sees it, and the layer that brings the two together.

The gates before the protocols (request_gate.py, frame_gate.py) put a `Connection` into the state of each request and
websocket. By it, a layer can cut the connection of a client that does not read, the gate learns when an answer has been
given, and many frames are written at once, which costs one write instead of one for each. It relies on what asyncio and
ASGI promise alone; under a server without gates nothing of it is there, and nothing else is lost.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

STATE = "meshtide.connection"
"""Where the connection stands in the state of a request."""
FRAMES = "meshtide.frames"
"""The extension by which `{"type": "websocket.send", "frames": [bytes, ...]}` may be sent."""


class Outlet(Protocol):
    """What is written to a client goes through it."""

    def cork(self) -> None:
        """Keep what is written from now on."""

    def uncork(self) -> None:
        """Send what was kept, in one piece."""

    def abort(self) -> None:
        """End the connection at once: what waits to be sent is dropped."""


class Connection:
    """A connection, and whether an answer is being given on it: there is one at a time."""

    def __init__(self) -> None:
        self.busy = False
        """Whether a request is being answered."""
        self._outlet: Outlet | None = None
        self._answered: Callable[[], None] | None = None

    def opened(self, outlet: Outlet, answered: Callable[[], None] | None = None) -> None:
        """Note what writes to the client from now on.

        Args:
            outlet: writes to the client.
            answered: is called after each answer.
        """
        self._outlet, self._answered = outlet, answered
        self.busy = False

    def asked(self) -> None:
        """A request has been handed on."""
        self.busy = True

    def answered(self) -> None:
        """It has been answered, whatever came of it."""
        self.busy = False
        if self._answered is not None:
            self._answered()

    def abort(self) -> None:
        """End it at once: what waits to be sent is dropped."""
        if self._outlet is not None:
            self._outlet.abort()

    @contextmanager
    def corked(self) -> Iterator[None]:
        """What is written within the block leaves in one piece, at its end."""
        if self._outlet is None:
            yield
            return
        self._outlet.cork()
        try:
            yield
        finally:
            self._outlet.uncork()


class Connecting:
    """The layer next to the server; wraps an application.

    Args:
        app: the application inside.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or serve one websocket."""
        connection = connection_of(scope)
        if connection is None:
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            scope["extensions"][FRAMES] = {}
            await self._app(scope, receive, _sending_frames(connection, send))
        else:
            try:
                await self._app(scope, receive, send)
            finally:
                connection.answered()


def _sending_frames(connection: Connection, send: Send) -> Send:
    async def send_all(message: Message) -> None:
        frames = message.get("frames")
        if frames is None:
            await send(message)
            return
        with connection.corked():
            for frame in frames:
                await send({"type": "websocket.send", "bytes": frame})

    return send_all


def connection_of(scope: Mapping[str, Any]) -> Connection | None:
    """The connection of a request or a websocket; None under a server without gates."""
    connection: Connection | None = scope.get("state", {}).get(STATE)
    return connection


def cut(scope: Mapping[str, Any]) -> None:
    """End the connection of a client that does not read: what waits to be sent is dropped, a farewell as well."""
    connection = connection_of(scope)
    if connection is not None:
        connection.abort()
