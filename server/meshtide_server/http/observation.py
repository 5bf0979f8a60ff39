"""What is noted of every request: its id, a line in the log, the metrics; and what becomes of a fault.

A plain ASGI layer around all others, for it sees what they answer and may not cost much: a framework's own layers
cost more than sending a packet. A fault anywhere inside is logged with the request's id and answered as a Problem
that names it, so that a person who reports one can be helped.
"""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import suppress
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from starlette.requests import ClientDisconnect

from meshtide_server.http.connection import cut
from meshtide_server.http.problems import problem_response
from meshtide_server.operations import metrics
from meshtide_server.operations.logs import HEADER, accepted_id, bound_id

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send


logger = logging.getLogger("meshtide.access")


class Observation:
    """The layer; wraps an application.

    Args:
        app: the application inside.
        access_log: whether every request is a line at level info; else those are lines at level debug.
    """

    def __init__(self, app: ASGIApp, *, access_log: bool = False) -> None:
        self._app = app
        self._level = logging.INFO if access_log else logging.DEBUG

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or serve one websocket."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        identifier = accepted_id(next((value for name, value in scope["headers"] if name == HEADER), None))
        answer = _Answer(send, identifier)
        with bound_id(identifier):
            try:
                await self._app(scope, receive, answer.send)
            except Exception as error:
                if answer.departed or isinstance(error, ClientDisconnect):
                    await _let_go(scope)
                else:
                    logger.exception("a fault of the server")
                    metrics.fault("stream" if scope["type"] == "websocket" else "http")
                    await _close_with(scope, receive, answer, identifier)
            finally:
                self._note(scope, answer)

    def _note(self, scope: Scope, answer: _Answer) -> None:
        seconds = time.perf_counter() - answer.started
        template = getattr(scope.get("route"), "path_format", None)
        method = scope.get("method", "WEBSOCKET")
        if scope["type"] == "http" and answer.status:  # 0: the client left before there was an answer
            metrics.request_answered(method, template, answer.status, seconds, answer.size)
        if logger.isEnabledFor(self._level):
            fields: dict[str, Any] = {
                "method": method,
                "path": scope["path"],
                "status": answer.status,
                "bytes": answer.size,
                "seconds": round(seconds, 6),
                "client": (scope.get("client") or ("",))[0],
            }
            message = f"{method} {scope['path']!r} {answer.status}, {answer.size} bytes, {1e3 * seconds:.1f} ms"
            logger.log(self._level, message, extra={"fields": fields})


class _Answer:
    """Passes on what the application says, and remembers what has to be noted."""

    __slots__ = ("_header", "_send", "departed", "size", "started", "status")

    def __init__(self, send: Send, identifier: str) -> None:
        self._send = send
        self._header = (HEADER, identifier.encode("ascii"))
        self.started = time.perf_counter()
        self.departed = False
        """Whether something could not be sent, for the client has left: no fault of the server."""
        self.status = 0
        self.size = 0

    async def send(self, message: Message) -> None:
        """One message of the application."""
        kind = message["type"]
        if kind == "http.response.body":
            self.size += len(message.get("body", b""))
        elif kind == "websocket.send":
            self.size += sum(map(len, message.get("frames", ()))) or len(
                message.get("bytes") or message.get("text") or b""
            )
        elif kind in {"http.response.start", "websocket.accept", "websocket.http.response.start"}:
            self.status = message.get("status", HTTPStatus.SWITCHING_PROTOCOLS.value)
            message["headers"] = [*message.get("headers", ()), self._header]
        elif kind == "websocket.close" and not self.status:
            self.status = HTTPStatus.FORBIDDEN.value  # what a close before the acceptance becomes
        try:
            await self._send(message)
        except OSError:
            self.departed = True
            raise


async def _let_go(scope: Scope) -> None:
    """End the connection of a client that has left in the middle of an answer."""
    logger.debug("a client left before it was answered")
    cut(scope)
    await asyncio.sleep(0)  # the server below takes note that the connection has ended


async def _close_with(scope: Scope, receive: Receive, answer: _Answer, identifier: str) -> None:
    """Answer a client whose request met a fault, unless the answer has begun."""
    if scope["type"] == "websocket":
        with suppress(OSError):  # the client has left
            reason = f"a fault of the server: {identifier}"
            await answer.send({"type": "websocket.close", "code": 1011, "reason": reason})
    elif not answer.status:
        message = f"the server made a mistake; its operator finds it in the log under the request id {identifier}"
        response = problem_response(HTTPStatus.INTERNAL_SERVER_ERROR, "internal", message)
        with suppress(OSError):
            await response(scope, receive, answer.send)
    else:
        raise ConnectionAbortedError(f"the answer to request {identifier} was cut off by a fault, which is logged")
