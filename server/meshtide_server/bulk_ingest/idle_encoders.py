"""Encoders' processes that are kept between files, because loading the encoder takes longer than most files.

Each event loop has its own: processes belong to the loop that started them. One that nobody has taken for a while ends
by itself, so that a worker of a cluster keeps none after the last file.
"""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from meshtide_server.encoding.process import EncoderProcess

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from meshtide_server.encoding.process import ProcessLimits

IDLE_SECONDS = 20.0


class _IdleEncoders:
    """The idle encoders of one event loop, each with the timer that ends it."""

    def __init__(self) -> None:
        self._idle: dict[ProcessLimits, list[tuple[EncoderProcess, asyncio.Task[None]]]] = {}

    def take(self, limits: ProcessLimits) -> EncoderProcess:
        waiting = self._idle.get(limits)
        if not waiting:
            return EncoderProcess(limits)
        encoder, timer = waiting.pop()
        timer.cancel()
        return encoder

    def give_back(self, limits: ProcessLimits, encoder: EncoderProcess) -> None:
        if not encoder.running:
            return
        timer = asyncio.create_task(self._end_later(limits, encoder), name="end an idle encoder")
        self._idle.setdefault(limits, []).append((encoder, timer))

    async def end_all(self) -> None:
        waiting = [pair for pairs in self._idle.values() for pair in pairs]
        self._idle.clear()
        for encoder, timer in waiting:
            timer.cancel()
            await encoder.close()

    async def _end_later(self, limits: ProcessLimits, encoder: EncoderProcess) -> None:
        await asyncio.sleep(IDLE_SECONDS)
        self._idle[limits] = [pair for pair in self._idle[limits] if pair[0] is not encoder]
        await encoder.close()


_of_loops: WeakKeyDictionary[asyncio.AbstractEventLoop, _IdleEncoders] = WeakKeyDictionary()


@asynccontextmanager
async def encoder_taken(limits: ProcessLimits) -> AsyncIterator[EncoderProcess]:
    """An encoder that nobody else has meanwhile.

    Args:
        limits: what its process may take.
    """
    idle = _of_loops.setdefault(asyncio.get_running_loop(), _IdleEncoders())
    encoder = idle.take(limits)
    try:
        yield encoder
    finally:
        idle.give_back(limits, encoder)


async def end_idle_encoders() -> None:
    """End those of this event loop now."""
    idle = _of_loops.get(asyncio.get_running_loop())
    if idle is not None:
        await idle.end_all()
