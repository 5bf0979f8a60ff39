"""The layer that gives answers again: whole answers to what is asked for most, packets and small files.

Finding out what to answer costs many times what sending a packet does. An answer that a route has given, and marked
with how to see that it still holds, is kept for a short while and given again before the routes are asked. Requests
whose headers could change the answer always go to them. It keeps nothing where reading takes a token. A proxy that
caches, as docs/operate.md sets one up, does the same for longer, with less.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

HOLDS = "holds"
"""Where a route leaves, in the state of its request, how to see that its answer holds; then it may be given again."""
LARGEST_BODY = 60 * 1024
"""With its headers it fits into what a connection may hold back, 64 KiB, so that nobody has to wait for a reader."""
BUDGET = 32 << 20
"""Bytes of bodies that are kept."""
SECONDS = 1.0
"""How long an answer may be given again: another server may have deleted the mesh meanwhile."""
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
_DECISIVE = frozenset({
    b"authorization", b"content-length", b"expect", b"origin", b"range", b"te", b"transfer-encoding", b"upgrade",
})  # fmt: skip
"""Headers that may change the answer, or ask for more than one; so do all that begin with if-."""


class ReadyAnswer(NamedTuple):
    """An answer with status 200.

    Args:
        headers: of the answer.
        body: all of it.
        route: that gave it, for the metrics.
        holds: says, without waiting, whether it would still be given.
        until: when it has to be made anew, in seconds of the clock.
    """

    headers: list[tuple[bytes, bytes]]
    body: bytes
    route: Any
    holds: Callable[[], bool]
    until: float


class ReadyAnswers:
    """The layer; wraps an application. The answers that were not asked for the longest give way.

    Args:
        app: the application inside.
        budget: bytes of bodies that are kept; 0: none, and everything is asked of the application.
        clock: seconds, never going back.
    """

    def __init__(self, app: ASGIApp, budget: int = BUDGET, clock: Callable[[], float] = time.monotonic) -> None:
        self._app = app
        self._budget = budget
        self._clock = clock
        self._size = 0
        self._answers: OrderedDict[bytes, ReadyAnswer] = OrderedDict()

    def __len__(self) -> int:
        return len(self._answers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or serve one websocket."""
        if scope["type"] != "http" or not self._budget:
            await self._app(scope, receive, send)
        elif scope["method"] not in _SAFE:
            await self._app(scope, receive, self._forgetting(send))
        elif scope["method"] != "GET" or scope["query_string"] or not plain(scope["headers"]):
            await self._app(scope, receive, send)
        elif (answer := self._find(scope["raw_path"])) is None:
            recorder = _Recorder(send)
            await self._app(scope, receive, recorder.send)
            self._keep(scope, recorder)
        else:
            scope["route"] = answer.route
            await send({"type": "http.response.start", "status": HTTPStatus.OK.value, "headers": list(answer.headers)})
            await send({"type": "http.response.body", "body": answer.body})

    def _forgetting(self, send: Send) -> Send:
        """`send` of a request that writes: whoever gets its answer sees what it changed."""

        async def forget(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._answers.clear()
                self._size = 0
            await send(message)

        return forget

    def _find(self, target: bytes) -> ReadyAnswer | None:
        answer = self._answers.get(target)
        if answer is not None and (self._clock() >= answer.until or not answer.holds()):
            self._drop(target)
            return None
        if answer is not None:
            self._answers.move_to_end(target)
        return answer

    def _keep(self, scope: Scope, recorder: _Recorder) -> None:
        holds = scope.get("state", {}).get(HOLDS)
        if holds is None or not recorder.is_whole:
            return
        body = b"".join(recorder.parts)
        self._drop(scope["raw_path"])
        until = self._clock() + SECONDS
        self._answers[scope["raw_path"]] = ReadyAnswer(recorder.headers, body, scope.get("route"), holds, until)
        self._size += len(body)
        while self._size > self._budget:
            self._drop(next(iter(self._answers)))

    def _drop(self, target: bytes) -> None:
        answer = self._answers.pop(target, None)
        if answer is not None:
            self._size -= len(answer.body)


class _Recorder:
    """Passes on an answer, and remembers it as long as it is short."""

    __slots__ = ("_send", "_size", "headers", "is_whole", "parts")

    def __init__(self, send: Send) -> None:
        self._send = send
        self._size = 0
        self.headers: list[tuple[bytes, bytes]] = []
        self.parts: list[bytes] = []
        self.is_whole = False
        """Whether this is an answer with status 200 of which `parts` are the whole body."""

    async def send(self, message: Message) -> None:
        """One message of the application."""
        if message["type"] == "http.response.start":
            is_right = message["status"] == HTTPStatus.OK
            self.headers = list(message.get("headers", ()))
            self._size = 0 if is_right else LARGEST_BODY + 1
        elif message["type"] == "http.response.body" and self._size <= LARGEST_BODY:
            body = message.get("body", b"")
            self._size += len(body)
            self.parts.append(body)
            self.is_whole = self._size <= LARGEST_BODY and not message.get("more_body", False)
        await self._send(message)


def plain(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Whether none of a request's headers could change the answer.

    >>> plain([(b"host", b"localhost"), (b"connection", b"keep-alive")])
    True
    >>> plain([(b"host", b"localhost"), (b"if-none-match", b"*")])
    False
    """
    return not any(name in _DECISIVE or name.startswith(b"if-") for name, _ in headers)
