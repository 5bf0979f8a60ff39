"""Encoding on this machine: several files at a time, each in a process of its own."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from meshtide_server.bulk_ingest.encode_file import encode_file
from meshtide_server.bulk_ingest.idle_encoders import end_idle_encoders

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_server.bulk_ingest.encode_file import FileOutcome, FileTask


class LocalWorkers:
    """Worker processes on this machine.

    Args:
        count: how many.
        stage: called now and then with what one of them does.
    """

    def __init__(self, count: int, stage: Callable[[str], None] = lambda _: None) -> None:
        self._stage = stage
        self._count = count
        self._free = asyncio.Semaphore(count)

    @property
    def capacity(self) -> int:
        """How many files may be under way: as many wait, or are published, as are encoded."""
        return 2 * self._count

    async def encode(self, task: FileTask) -> FileOutcome:
        """Encode a file as soon as a worker is free."""
        async with self._free:
            return await encode_file(task, progress=lambda stage, _: self._stage(stage))

    async def close(self) -> None:
        """End the processes."""
        await end_idle_encoders()
