"""The layer of the application that holds clients to their limits, and drops those that do not read.

It counts connections, waits before it sends more than a client's rate allows, and gives each piece that is sent a
deadline: a client that does not read is paused by flow control (the piece waits), and its connection is cut when that
takes too long. Questions about the server's health are always answered.
"""

from __future__ import annotations

import asyncio
import logging
import time
from http import HTTPStatus
from ipaddress import ip_network
from typing import TYPE_CHECKING

from starlette.exceptions import HTTPException

from meshtide_server.http.connection import cut
from meshtide_server.http.problems import problem_response
from meshtide_server.security.client_limits import ClientLimits

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from meshtide_server.security.client_limits import Client
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")

_ALWAYS_ANSWERED = frozenset({"/healthz", "/readyz"})
_WRITING = frozenset({"POST", "PUT", "PATCH", "DELETE"})
LARGEST_CHANGE = 512 * 1024
"""Bytes of a PATCH request's body. The framework has all of it in memory before it looks at the request's token."""
_CONNECTION_RETRY = 5
"""Seconds after which a client with too many connections is asked to try again."""


class SlowClientError(ConnectionAbortedError):
    """A client did not read for too long; its connection has been cut."""


class Limiting:
    """The layer; wraps an application.

    Args:
        app: the application inside.
        settings: the limits.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._stall_timeout = settings.stall_timeout
        self._limits = ClientLimits(
            connections=settings.connections_per_client,
            bytes_per_second=settings.bytes_per_second,
            writes_per_minute=settings.writes_per_minute,
            unlimited=[ip_network(text) for text in settings.unlimited_clients],
            clock=time.monotonic,
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or serve one websocket."""
        if scope["type"] == "lifespan" or scope["path"] in _ALWAYS_ANSWERED:
            await self._app(scope, receive, send)
            return
        client = self._limits.client((scope.get("client") or ("",))[0])
        if client is None:
            await self._serve(scope, receive, send, None)
            return
        if not self._limits.enter(client):
            message = "too many connections at a time come from your address; close some, or try again later"
            await _refuse(scope, receive, send, message, _CONNECTION_RETRY)
            return
        try:
            wait = self._limits.write(client) if scope.get("method") in _WRITING else 0
            if wait:
                message = f"too many requests that write come from your address; try again in {wait} s"
                await _refuse(scope, receive, send, message, wait)
            else:
                await self._serve(scope, receive, send, client)
        finally:
            self._limits.leave(client)

    async def _serve(self, scope: Scope, receive: Receive, send: Send, client: Client | None) -> None:
        pace = _Pace(scope, send, self._stall_timeout, self._limits, client)
        if scope.get("method") == "PATCH":
            receive = _bounded(receive)
        try:
            await self._app(scope, receive, pace.send)
        except Exception:
            if not pace.too_slow:
                raise
            logger.info("dropped a client that read nothing for %g s", self._stall_timeout)
            await asyncio.sleep(0)  # the server below takes note that the connection has ended


class _Pace:
    """Sends at the client's rate, each piece with a deadline."""

    def __init__(
        self, scope: Scope, send: Send, stall_timeout: float, limits: ClientLimits, client: Client | None
    ) -> None:
        self._scope = scope
        self._send = send
        self._stall_timeout = stall_timeout
        self._limits = limits
        self._client = client
        self.too_slow = False

    async def send(self, message: Message) -> None:
        """One message of the application."""
        size = _size(message)
        if size and self._client is not None:
            wait = self._limits.send(self._client, size)
            if wait:
                await asyncio.sleep(wait)
        try:
            async with asyncio.timeout(self._stall_timeout):
                await self._send(message)
        except TimeoutError:
            self.too_slow = True
            cut(self._scope)
            raise SlowClientError(f"nothing was read for {self._stall_timeout:g} s") from None


def _bounded(receive: Receive) -> Receive:
    """`receive` of a request whose body may not be longer than `LARGEST_CHANGE`."""
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if received > LARGEST_CHANGE:
            words = f"the body is longer than {LARGEST_CHANGE} bytes, more than any change of a mesh needs"
            raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, words, {"Connection": "close"})
        return message

    return counted


def _size(message: Message) -> int:
    """Bytes that a message brings to the client."""
    if message["type"] == "http.response.body":
        return len(message.get("body", b""))
    if message["type"] == "websocket.send":
        if "frames" in message:
            return sum(map(len, message["frames"]))
        return len(message.get("bytes") or message.get("text") or b"")
    return 0


async def _refuse(scope: Scope, receive: Receive, send: Send, message: str, retry_after: int) -> None:
    headers = {"Retry-After": str(retry_after)}
    response = problem_response(HTTPStatus.TOO_MANY_REQUESTS, "too-many", message, headers)
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1013})
        return
    await response(scope, receive, send)
