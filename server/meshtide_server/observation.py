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

from meshtide_server import metrics
from meshtide_server.connections import cut
from meshtide_server.logs import HEADER, accepted_id, bound_id
from meshtide_server.prepared_answers import LARGEST_BODY, plain
from meshtide_server.problems import problem_response

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from meshtide_server.prepared_answers import PreparedAnswers

logger = logging.getLogger("meshtide.access")

HOLDS = "holds"
"""Where a route leaves, in the state of its request, how to see that its answer holds; then it may be given again."""
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})


class Observation:
    """The layer; wraps an application.

    Args:
        app: the application inside.
        prepared: takes the answers that may be given again.
        access_log: whether every request is a line at level info; else those are lines at level debug.
    """

    def __init__(self, app: ASGIApp, prepared: PreparedAnswers, *, access_log: bool = False) -> None:
        self._app = app
        self._prepared = prepared
        self._level = logging.INFO if access_log else logging.DEBUG

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or serve one websocket."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        identifier = accepted_id(next((value for name, value in scope["headers"] if name == HEADER), None))
        changing = scope.get("method", "GET") not in _SAFE
        answer = _Answer(send, identifier, self._prepared.clear if changing else None)
        with bound_id(identifier):
            try:
                await self._app(scope, receive, answer.send)
            except Exception as error:
                if answer.departed or isinstance(error, ClientDisconnect):
                    await _let_go(scope)
                else:
                    logger.exception("a fault of the server")
                    metrics.fault("stream" if scope["type"] == "websocket" else "http")
                    await _part(scope, receive, answer, identifier)
            else:
                self._prepare(scope, answer)
            finally:
                self._note(scope, answer)

    def _prepare(self, scope: Scope, answer: _Answer) -> None:
        """Keep an answer that may be given again."""
        holds = scope.get("state", {}).get(HOLDS)
        if holds is None or not self._prepared.enabled or not answer.is_whole or scope["method"] != "GET":
            return
        if not scope["query_string"] and plain(scope["headers"]):
            template = getattr(scope.get("route"), "path_format", metrics.UNMATCHED)
            self._prepared.keep(scope["raw_path"], answer.headers, b"".join(answer.parts), template, holds)

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

    __slots__ = ("_before", "_header", "_send", "departed", "headers", "is_whole", "parts", "size", "started", "status")

    def __init__(self, send: Send, identifier: str, before: Callable[[], None] | None) -> None:
        self._before = before
        self._send = send
        self._header = (HEADER, identifier.encode("ascii"))
        self.started = time.perf_counter()
        self.departed = False
        """Whether something could not be sent, for the client has left: no fault of the server."""
        self.status = 0
        self.size = 0
        self.headers: list[tuple[bytes, bytes]] = []
        self.parts: list[bytes] = []
        """The body, as long as it is short."""
        self.is_whole = False
        """Whether this is an answer with status 200 of which `parts` are the whole body."""

    async def send(self, message: Message) -> None:
        """One message of the application."""
        kind = message["type"]
        if kind == "http.response.body":
            body = message.get("body", b"")
            self.size += len(body)
            if self.status == HTTPStatus.OK:
                self._remember(body, last=not message.get("more_body", False))
        elif kind == "websocket.send":
            self.size += sum(map(len, message.get("frames", ()))) or len(
                message.get("bytes") or message.get("text") or b""
            )
        elif kind in {"http.response.start", "websocket.accept", "websocket.http.response.start"}:
            self.status = message.get("status", HTTPStatus.SWITCHING_PROTOCOLS.value)
            if self._before is not None:  # what was changed must not be seen any more by who is told that it was
                self._before()
            self.headers = list(message.get("headers", ()))
            message["headers"] = [*self.headers, self._header]
        elif kind == "websocket.close" and not self.status:
            self.status = HTTPStatus.FORBIDDEN.value  # what a close before the acceptance becomes
        try:
            await self._send(message)
        except OSError:
            self.departed = True
            raise

    def _remember(self, body: bytes, *, last: bool) -> None:
        if self.size > LARGEST_BODY:
            self.parts.clear()
        else:
            self.parts.append(body)
            self.is_whole = last


async def _let_go(scope: Scope) -> None:
    """End the connection of a client that has left in the middle of an answer."""
    logger.debug("a client left before it was answered")
    cut(scope)
    await asyncio.sleep(0)  # the server below takes note that the connection has ended


async def _part(scope: Scope, receive: Receive, answer: _Answer, identifier: str) -> None:
    """Tell a client whose request met a fault, as far as the answer has not begun."""
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
