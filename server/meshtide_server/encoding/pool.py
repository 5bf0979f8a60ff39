"""A pool of encoder processes: so many jobs at a time, each in a process that does nothing else meanwhile.

Processes are started when there is a job for them and no idle one; the one that worked last is taken first, so that
few are kept warm when there is little to do.
"""

from __future__ import annotations

import asyncio
from contextlib import contextmanager
from typing import TYPE_CHECKING

from meshtide_server.encoding.process import EncoderProcess

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_server.encoding.process import ProcessLimits


class EncoderPool:
    """Encoder processes for several jobs at a time.

    Args:
        size: how many there are at most.
        limits: of each of them.
    """

    def __init__(self, size: int, limits: ProcessLimits) -> None:
        self.size = size
        self._idle = [EncoderProcess(limits) for _ in range(size)]
        self._all = tuple(self._idle)

    @property
    def running(self) -> int:
        """How many processes there are."""
        return sum(encoder.running for encoder in self._all)

    @contextmanager
    def taken(self) -> Iterator[EncoderProcess]:
        """An encoder for one job; no more than `size` may be taken at a time."""
        encoder = self._idle.pop()
        try:
            yield encoder
        finally:
            self._idle.append(encoder)

    async def rest(self) -> None:
        """End the processes that have nothing to do: they hold memory. The next jobs start them again."""
        resting, self._idle = self._idle, []
        try:
            await asyncio.gather(*(encoder.close() for encoder in resting))
        finally:
            self._idle += resting

    async def close(self) -> None:
        """End all processes, and with them what they work on."""
        await asyncio.gather(*(encoder.close() for encoder in self._all))
