"""The websocket side of a stream: a thin shell around the codec's ServerSession.

One task feeds the session what the client sends, another sends what the session has, never more than the client has
granted and its socket takes. Whatever ends a stream early reaches the client in an error frame first, and then in
the close code.

======================  =====  ==================================================================================
error frame             close  when
======================  =====  ==================================================================================
(none)                  1000   all was sent, or the client gave up
unknown-mesh            1008   there is no mesh of that id
not-ready               1013   it is being encoded, or replaced on the disk, or store or catalogue do not answer
mesh-failed             1011   it cannot be served, or is damaged in the store
protocol                1002   a frame that is malformed or out of turn
timeout                 1008   no hello, or no credit and no reading, for too long
shutting-down           1012   the server is going away; connect again, to another one or later, to resume
internal                1011   a fault of the server
(none)                  1009   a frame over the size limit; sent by the protocol below
======================  =====  ==================================================================================
"""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from meshtide_codec.errors import PeerError, ProtocolError, StreamError
from meshtide_codec.stream.session import PacketRange, ServerSession, error_frame
from meshtide_server.http.connection import FRAMES, cut
from meshtide_server.http.lookup import find_stream
from meshtide_server.http.problems import problem_response, unavailable
from meshtide_server.operations import metrics
from meshtide_server.operations.metrics import StreamOutcome
from meshtide_server.refusals import RefusedError
from meshtide_server.security.origins import may_connect
from meshtide_server.store import StoreError

if TYPE_CHECKING:
    from meshtide_server.hosting.library import Library
    from meshtide_server.hosting.stream import HostedStream
    from meshtide_server.security.access import Access
    from meshtide_server.settings import Settings
    from meshtide_server.store.protocol import OpenRanges

logger = logging.getLogger("meshtide.server")

GOODBYE_SECONDS = 1.0
"""How long a client may take to read why it is dropped."""
BATCH_BYTES = 1 << 16
"""Frames are handed to the connection until they are so many bytes, then others get their turn."""
LONGEST_REASON = 120
"""Bytes of a close frame's reason; the websocket protocol allows 123."""
_CLOSE_CODES = {"unknown-mesh": 1008, "not-ready": 1013, "mesh-failed": 1011}
_OUTCOMES = {
    "": StreamOutcome.COMPLETE,
    "protocol": StreamOutcome.BREACH,
    "timeout": StreamOutcome.TIMEOUT,
    "shutting-down": StreamOutcome.SHUTDOWN,
    "internal": StreamOutcome.FAULT,
}


@dataclass(frozen=True, slots=True)
class Farewell:
    """How a stream ends.

    Args:
        close: the websocket close code.
        code: of the error frame; empty if there is none.
        message: of the error frame and the close frame.
    """

    close: int
    code: str = ""
    message: str = ""

    @property
    def outcome(self) -> StreamOutcome:
        """What the metrics count it as."""
        return _OUTCOMES.get(self.code, StreamOutcome.REFUSED)


_SHUTTING_DOWN = Farewell(1012, "shutting-down", "the server is shutting down; connect again to resume")
_COMPLETE = Farewell(1000)
_GIVEN_UP = Farewell(1000)
"""The answer to a client that gave up."""


class RunningStreams:
    """All streams that are running.

    Args:
        library: the meshes.
        settings: timeouts, and which pages may connect.
        access: who may read.
        draining: is set when the server takes no new streams any more.
    """

    def __init__(self, library: Library, settings: Settings, access: Access, draining: asyncio.Event) -> None:
        self._library = library
        self._draining = draining
        self._access = access
        self._settings = settings
        self._closing = False
        self._running: set[asyncio.Task[None]] = set()
        self._conversations: set[Conversation] = set()

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._running)

    async def serve(self, websocket: WebSocket, mesh_id: str) -> None:
        """Serve one client from its handshake to its close."""
        if not may_connect(websocket.headers, self._settings.allowed_origins):
            logger.info("refused a page of %r", websocket.headers.get("origin"))
            await websocket.close()  # before it was accepted: HTTP status 403
            return
        try:
            self._access.check_stream(websocket.headers.get("authorization"), websocket.query_params.get("ticket"))
        except RefusedError as error:
            await websocket.send_denial_response(
                problem_response(error.status, error.code, error.message, error.headers)
            )
            return
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 - a coroutine that runs is in a task
        self._running.add(task)
        metrics.stream_started()
        started = time.perf_counter()
        outcome = StreamOutcome.LEFT
        try:
            await websocket.accept()
            farewell = await self._farewell(websocket, mesh_id)
            if farewell is not None:
                outcome = StreamOutcome.LEFT if farewell is _GIVEN_UP else farewell.outcome
                if websocket.application_state is WebSocketState.CONNECTED:
                    await _close_with(websocket, farewell)
        except WebSocketDisconnect:
            logger.debug("the client of %s left before it was greeted", mesh_id)
        finally:
            metrics.stream_ended(outcome, time.perf_counter() - started)
            self._running.discard(task)

    async def close(self, patience: float = 2 * GOODBYE_SECONDS + 0.5) -> None:
        """Announce to all clients that the server goes away, and wait until they know, at most `patience` seconds."""
        self._closing = True
        for conversation in self._conversations:
            conversation.end(_SHUTTING_DOWN)
        if self._running:
            await asyncio.wait(self._running, timeout=patience)

    async def _farewell(self, websocket: WebSocket, mesh_id: str) -> Farewell | None:
        """Stream to one client, and take what goes wrong in the server for the end of that stream only."""
        if self._draining.is_set():
            return _SHUTTING_DOWN
        try:
            return await self._stream(websocket, mesh_id)
        except WebSocketDisconnect:
            raise
        except Exception:
            logger.exception("a fault of the server in a stream")
            metrics.fault("stream")
            return Farewell(1011, "internal", "the server made a mistake; its log has the details")

    async def _stream(self, websocket: WebSocket, mesh_id: str) -> Farewell | None:
        """Stream to one client; returns how to part from it, or None if it has left."""
        try:
            found, stream = await find_stream(self._library, mesh_id)
        except RefusedError as error:
            return Farewell(_CLOSE_CODES[error.code], error.code, error.message)
        try:
            with closing(stream.open()) as opened:
                return await self._run(Conversation(websocket, found.id, stream, opened, self._settings))
        except StreamError as error:
            logger.warning("%s: %s", found.id, error)
            return Farewell(1013, "not-ready", str(error))
        except StoreError as error:
            refusal = unavailable(error)
            return Farewell(_CLOSE_CODES[refusal.code], refusal.code, refusal.message)

    async def _run(self, conversation: Conversation) -> Farewell | None:
        if self._closing:
            return _SHUTTING_DOWN
        self._conversations.add(conversation)
        try:
            return await conversation.run()
        finally:
            self._conversations.discard(conversation)


class Conversation:
    """One client's stream: the two tasks that share its session."""

    def __init__(
        self, websocket: WebSocket, mesh_id: str, stream: HostedStream, opened: OpenRanges, settings: Settings
    ) -> None:
        self._websocket = websocket
        self._stream = stream
        self._opened = opened
        self._session = ServerSession(mesh_id, stream.header, stream.header_bytes)
        self._due: PacketRange | None = None
        """What the session has named and nobody has read yet."""
        self._settings = settings
        self._heard = asyncio.Event()
        self._over: asyncio.Future[Farewell | None] = asyncio.get_running_loop().create_future()
        self._greeted_at = 0.0
        self._first_packet_sent = False

    async def run(self) -> Farewell | None:
        """Stream; returns how to part from the client, or None if it has left."""
        tasks = (asyncio.create_task(self.listen()), asyncio.create_task(self.send()))
        for task in tasks:
            task.add_done_callback(self._task_ended)
        try:
            return await self._over
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def end(self, farewell: Farewell) -> None:
        """End it, unless it has ended."""
        if not self._over.done():
            self._over.set_result(farewell)

    def _task_ended(self, task: asyncio.Task[Farewell | None]) -> None:
        if task.cancelled() or self._over.done():
            return
        error = task.exception()
        if error is None or isinstance(error, WebSocketDisconnect):
            self._over.set_result(None if error else task.result())
        else:
            self._over.set_exception(error)

    async def listen(self) -> Farewell | None:
        """Feed the session until the client leaves or errs."""
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return None
            data = message.get("bytes")
            try:
                self._session.receive(message.get("text") or "" if data is None else data)
            except PeerError as error:
                logger.info("a client gave up: %s", error)
                return _GIVEN_UP
            except ProtocolError as error:
                logger.info("a client broke the protocol: %s", error)
                return Farewell(1002, "protocol", str(error))
            if not self._greeted_at:
                self._greeted_at = time.perf_counter()
            self._heard.set()
            await asyncio.sleep(0)  # a client that talks without pause must not keep others waiting

    async def send(self) -> Farewell:
        """Send what the session has until all is sent or nothing moves any more."""
        try:
            return await self._send()
        finally:
            self._count()

    async def _send(self) -> Farewell:
        loop = asyncio.get_running_loop()
        deadline = loop.time() + self._settings.hello_timeout
        greeted = False
        while True:
            frames = await self._next_frames()
            if self._session.greeted and not greeted:
                greeted = True
                deadline = loop.time() + self._settings.stall_timeout
            try:
                async with asyncio.timeout_at(deadline):
                    if not frames:
                        self._count()
                        await self._heard.wait()
                        self._heard.clear()
                        continue
                    await self._transmit(frames)
                    if not self._first_packet_sent and self._session.sent_by_kind.keys() - {None}:
                        self._first_packet_sent = True
                        metrics.first_packet_sent(time.perf_counter() - self._greeted_at)
            except TimeoutError:
                return self._timeout(greeted=greeted)
            except RuntimeError as error:  # the protocol below has closed the connection while this was going on
                raise WebSocketDisconnect(1006) from error
            if self._session.finished:
                # Here and now: what is sent without a pause leaves in one piece with the last frames.
                await _close_with(self._websocket, _COMPLETE)
                return _COMPLETE
            deadline = loop.time() + self._settings.stall_timeout
            await asyncio.sleep(0)

    async def _next_frames(self) -> list[bytes]:
        """What is to be sent next, up to a batch; what is there leaves before anything is waited for."""
        frames: list[bytes] = []
        size = 0
        while size < BATCH_BYTES:
            due = self._due or self._session.next()
            if isinstance(due, PacketRange):
                start = self._stream.packet_offset(due.index)
                place = start + due.start, start + due.end
                data = self._opened.at_hand(*place)
                if data is None and frames:
                    self._due = due
                    break
                due = due.frame(await self._opened.read(*place) if data is None else data)
                self._due = None
            if due is None:
                break
            frames.append(due)
            size += len(due)
        return frames

    async def _transmit(self, frames: list[bytes]) -> None:
        """Send frames, in one go if the server below can do that."""
        if FRAMES in self._websocket.scope.get("extensions", {}):
            await self._websocket.send({"type": "websocket.send", "frames": frames})
            return
        for frame in frames:
            await self._websocket.send_bytes(frame)

    def _count(self) -> None:
        """Count in the metrics what was sent since the last time; not with each frame, of which there are many."""
        for kind, size in self._session.sent_by_kind.items():
            metrics.stream_sent(kind, size)
        self._session.sent_by_kind.clear()

    def _timeout(self, *, greeted: bool) -> Farewell:
        if greeted:
            message = f"the stream stood still for {self._settings.stall_timeout:g} s: no credit, or nobody reads"
        else:
            message = f"no hello within {self._settings.hello_timeout:g} s"
        logger.info("dropped a client: %s", message)
        return Farewell(1008, "timeout", message)


async def _close_with(websocket: WebSocket, farewell: Farewell) -> None:
    """Send the error frame, if there is one, and close; cut the connection of a client that reads neither."""
    reason = farewell.message.encode()[:LONGEST_REASON].decode(errors="ignore")
    try:
        with suppress(WebSocketDisconnect, RuntimeError):
            async with asyncio.timeout(GOODBYE_SECONDS):
                if farewell.code:
                    await websocket.send_bytes(error_frame(farewell.code, farewell.message))
    except TimeoutError:  # nobody reads; what waits to be sent must not stay in memory
        cut(websocket.scope)
        return
    with suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        async with asyncio.timeout(GOODBYE_SECONDS):
            await websocket.close(farewell.close, reason)
