"""A slow link on a fast one: bytes are taken at a rate, whatever brings them."""

from __future__ import annotations

import asyncio
import time


class Pace:
    """Takes no more than so many bytes a second.

    Args:
        rate: bytes a second; None for no bound.
    """

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._started = time.monotonic()
        self._bytes = 0

    async def take(self, size: int) -> None:
        """Wait until `size` more bytes are due."""
        if self._rate is not None:
            self._bytes += size
            await asyncio.sleep(max(self._started + self._bytes / self._rate - time.monotonic(), 0.0))
