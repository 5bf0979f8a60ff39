"""The gate before the websocket protocol: frames are counted, and a client has to wait that sends too many.

A frame costs the server some work however short it is. Of those that carry messages so many a second are handed on; the
others wait with their sender. Pings and pongs have no use in numbers, nor messages in many pieces: who sends such is
told so, and closed (RFC 6455, section 7.4.1, code 1008). Frames are only counted here: what they hold, and how large
they may be, is looked at behind.
"""

from __future__ import annotations

import logging
import time
from typing import TYPE_CHECKING

from meshtide_server.http.gate import Door, Gate
from meshtide_server.security.token_bucket import TokenBucket

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Callable

    from meshtide_server.http.connection import Connection

logger = logging.getLogger("meshtide.server")

MOST_FRAGMENTS = 64
"""Frames that one message may come in."""
SHORTEST_WAIT = 0.01
"""Seconds; a client that sends too many frames is looked after no more often."""
_HEAD_END = b"\r\n\r\n"
_POLICY = 1008
_LENGTHS = {126: 2, 127: 8}
"""Bytes of a length that does not fit into a frame's second byte."""


class FrameGate(Gate):
    """Stands before a websocket protocol, which is made when the request that asks for it has come.

    Frames that a client sends before it was answered wait for that: the protocol could not understand them yet.

    Args:
        inner: the protocol.
        connection: what the application knows of it.
        frames: that carry messages, a second.
        control_frames: pings, pongs and closes, a second.
        clock: seconds, never going back.
    """

    def __init__(
        self,
        inner: asyncio.Protocol,
        connection: Connection,
        *,
        frames: int,
        control_frames: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(inner, connection)
        self._frames = TokenBucket(frames, frames, clock)
        self._control = TokenBucket(control_frames, control_frames, clock)
        self._greeted = False
        self._left = 0
        self._fragments = 0

    def door(self) -> Door:
        """The connection; what is written first is the answer to the handshake."""
        return _AnsweringDoor(self.transport, self)

    def cut(self, waiting: bytearray) -> int | float:
        """The next frame, or what is there of it."""
        if not self._greeted:
            end = waiting.find(_HEAD_END)
            if end < 0:
                return 0
            self._greeted = True
            self._held = True
            return end + len(_HEAD_END)
        if self._left:
            size = min(self._left, len(waiting))
            self._left -= size
            return size
        head = _head_size(waiting)
        if not head:
            return 0
        wait = self._admit(waiting[0] & 0x0F, final=bool(waiting[0] & 0x80))
        if wait or self.deaf:
            return wait
        length = waiting[1] & 0x7F
        extended = _LENGTHS.get(length, 0)
        if extended:
            length = int.from_bytes(waiting[2 : 2 + extended], "big")
        size = min(head + length, len(waiting))
        self._left = head + length - size
        return size

    def _admit(self, opcode: int, *, final: bool) -> float:
        """Count a frame; returns the seconds for which it has to wait, of which there are none if it is admitted."""
        if opcode & 0x8:
            if self._control.try_take(1.0):
                self._refuse("too many pings and pongs")
            return 0.0
        fragments = self._fragments + 1
        if fragments > MOST_FRAGMENTS:
            self._refuse(f"a message in more than {MOST_FRAGMENTS} frames")
            return 0.0
        wait = self._frames.try_take(1.0)
        if wait:
            return max(wait, SHORTEST_WAIT)
        self._fragments = 0 if final else fragments
        return 0.0

    def _refuse(self, reason: str) -> None:
        """End the connection; the protocol behind hears a close frame, which it answers with the same."""
        logger.info("dropped a websocket: %s", reason)
        payload = _POLICY.to_bytes(2, "big") + reason.encode()
        self.give_up(heard=bytes((0x88, 0x80 | len(payload), 0, 0, 0, 0)) + payload)


class _AnsweringDoor(Door):
    """What is written first is the answer to the handshake, after which frames may pass."""

    def __init__(self, transport: asyncio.Transport, gate: FrameGate) -> None:
        super().__init__(transport, gate)
        self._answered = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send."""
        super().write(data)
        if not self._answered:
            self._answered = True
            self.resume_reading()


def _head_size(waiting: bytearray) -> int:
    """Bytes of the frame's head that the waiting bytes begin with; 0 if it is not whole yet."""
    if len(waiting) < 2:
        return 0
    size = 2 + _LENGTHS.get(waiting[1] & 0x7F, 0) + (4 if waiting[1] & 0x80 else 0)
    return size if len(waiting) >= size else 0
