"""The protocols of uvicorn, with what this server needs of a connection besides.

Over HTTP, answers that are ready are given without asking the application, and the application can cut a connection
whose client does not read. Over a websocket, the application can send many frames at a time, which costs one write
instead of one for each. What reaches either of them has passed a gate (request_gate.py, frame_gate.py).
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.protocol import State

from meshtide_server import metrics
from meshtide_server.logs import HEADER, accepted_id

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Mapping, Sequence

    from uvicorn.protocols.http.httptools_impl import RequestResponseCycle
    from websockets.http11 import Request

    from meshtide_server.prepared_answers import PreparedAnswer, PreparedAnswers

FRAMES = "meshtide.frames"
"""The extension by which a protocol says that it takes `{"type": "websocket.send", "frames": [bytes, ...]}`."""
_BINARY = 0x82
"""First byte of a binary frame that is a message of its own (RFC 6455, section 5.2)."""


class HttpProtocol(HttpToolsProtocol):
    """`scope["state"]["transport"]` is the connection of a request, and of a websocket that begins as one.

    Args:
        prepared: answers that are ready.
        arguments: of uvicorn's protocol.
    """

    def __init__(
        self,
        *arguments: Any,  # noqa: ANN401 - uvicorn's
        prepared: PreparedAnswers,
        **named: Any,  # noqa: ANN401 - uvicorn's
    ) -> None:
        super().__init__(*arguments, **named)
        self._prepared = prepared
        self._answered = False
        self._in_turn: RequestResponseCycle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override] # uvicorn's signature
        """Called by the event loop."""
        self.app_state = {**self.app_state, "transport": transport}
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by the event loop; uvicorn tells only the request that came last, not the one whose turn it is."""
        if self._in_turn is not None and not self._in_turn.response_complete:
            self._in_turn.disconnected = True
            self._in_turn.message_event.set()
        super().connection_lost(exc)

    def answering(self) -> bool:
        """Whether an answer is being given."""
        return self.cycle is not None and not self.cycle.response_complete

    def on_headers_complete(self) -> None:
        """Called by the parser: a request, without its body, is there."""
        started = time.perf_counter()
        answer = self._ready_answer()
        if answer is None:
            super().on_headers_complete()
            if not self.pipeline:
                self._in_turn = self.cycle
            return
        self._answered = True
        chosen = next((value for name, value in self.headers if name == HEADER), None)
        lines = [answer.head]
        for name, value in self.server_state.default_headers:
            lines += (name, b": ", value, b"\r\n")
        lines += (HEADER, b": ", accepted_id(chosen).encode("ascii"), b"\r\n\r\n", answer.body)
        self.transport.write(b"".join(lines))
        metrics.request_answered("GET", answer.route, 200, time.perf_counter() - started, len(answer.body))

    def on_message_complete(self) -> None:
        """Called by the parser: the request has ended."""
        if self._answered:
            self._answered = False
            self.on_response_complete()
        else:
            super().on_message_complete()

    def on_response_complete(self) -> None:
        """Called when an answer is given: the next of the requests that wait has its turn."""
        if self.pipeline:
            self._in_turn = self.pipeline[-1][0]
        super().on_response_complete()

    def _ready_answer(self) -> PreparedAnswer | None:
        """The answer to the request that was parsed, if it is ready and its turn has come."""
        if self.answering() or self.pipeline or self.flow.write_paused or self.parser.get_method() != b"GET":
            return None
        return self._prepared.find(self.url, self.headers) if self.parser.get_http_version() == "1.1" else None


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """Takes many frames at a time."""

    def handle_connect(self, event: Request) -> None:
        """Called with the handshake's request."""
        super().handle_connect(event)
        if hasattr(self, "scope"):  # the handshake was right, and the application is about to be called
            self.scope["extensions"][FRAMES] = {}

    async def send(self, message: Any) -> None:  # noqa: ANN401 - uvicorn's
        """Called by the application.

        Raises:
            ClientDisconnected: the client has left, or is about to be; uvicorn finds so only a turn later.
        """
        if self.transport.is_closing():
            raise ClientDisconnected
        frames: Sequence[bytes] | None = message.get("frames")
        if frames is None:
            await super().send(message)
            return
        await self.writable.wait()
        if self.disconnected or self.close_sent or self.conn.state is not State.OPEN:
            raise ClientDisconnected
        self.transport.write(b"".join([part for frame in frames for part in (frame_head(len(frame)), frame)]))


def frame_head(size: int) -> bytes:
    """What stands before a binary message of `size` bytes that a server sends.

    >>> frame_head(5).hex(), frame_head(300).hex(), frame_head(70_000).hex()
    ('8205', '827e012c', '827f0000000000011170')
    """
    if size < 126:
        return bytes((_BINARY, size))
    if size < 1 << 16:
        return bytes((_BINARY, 126)) + size.to_bytes(2, "big")
    return bytes((_BINARY, 127)) + size.to_bytes(8, "big")


def cut(scope: Mapping[str, Any]) -> None:
    """End the connection of a client that does not read: what waits to be sent is dropped, a farewell as well."""
    transport = scope.get("state", {}).get("transport")
    if transport is not None:
        transport.abort()
