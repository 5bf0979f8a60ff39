"""Blocks of bytes in memory: those used least recently give way, and each is fetched once however many ask for it.

What is kept and what is being fetched count together: a fetch begins when there is room for what it brings, for which
blocks are dropped or other fetches awaited, in the order in which they came. A fetch that fails leaves nothing behind.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from typing import TYPE_CHECKING

from meshtide_server.hosting.single_flight import SingleFlight
from meshtide_server.operations import metrics

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine
    from typing import Any

Key = tuple[str, int]
"""The object that a block is of, and its number there."""


class BlockCache:
    """Blocks in memory.

    Args:
        budget: bytes that are kept and being fetched at most.
    """

    def __init__(self, budget: int) -> None:
        self.budget = budget
        self.held = 0
        """Bytes that are kept or being fetched."""
        self._blocks: OrderedDict[Key, bytes] = OrderedDict()
        self._flights: SingleFlight[Key, bytes] = SingleFlight()
        self._turn = asyncio.Lock()
        self._settled = asyncio.Event()

    def __len__(self) -> int:
        return len(self._blocks)

    def find(self, key: Key) -> bytes | None:
        """A block, if it is there, without waiting."""
        block = self._blocks.get(key)
        if block is not None:
            self._blocks.move_to_end(key)
        return block

    async def get(self, key: Key, size: int, fetch: Callable[[], Coroutine[Any, Any, bytes]]) -> bytes:
        """A block; fetched if it is not there, once for all who ask meanwhile.

        Args:
            key: of the block.
            size: of the block in bytes, at most the budget.
            fetch: brings it; raises, rather than to return bytes that are wrong or too few. All who wait get the error.

        Raises:
            ValueError: it is larger than the budget.
        """
        block = self.find(key)
        if block is not None:
            return block
        if size > self.budget:
            raise ValueError(f"a block of {size} bytes does not fit into {self.budget}")
        return await self._flights.do(key, lambda: self._fetch(key, size, fetch))

    def forget(self, name: str) -> None:
        """Drop the blocks of an object."""
        for key in [key for key in self._blocks if key[0] == name]:
            self._drop(key)

    async def close(self) -> None:
        """Give up what is being fetched."""
        await self._flights.close()

    async def _fetch(self, key: Key, size: int, fetch: Callable[[], Coroutine[Any, Any, bytes]]) -> bytes:
        await self._make_room(size)
        try:
            block = await fetch()
        except BaseException:
            self.held -= size
            raise
        else:
            self.held += len(block) - size
            self._blocks[key] = block
        finally:
            self._settled.set()
            metrics.store_cache(self.held)
        return block

    async def _make_room(self, size: int) -> None:
        async with self._turn:  # one after the other, or small fetches would keep a large one waiting for ever
            while self.held + size > self.budget:
                if self._blocks:
                    self._drop(next(iter(self._blocks)))
                else:
                    self._settled.clear()
                    await self._settled.wait()
            self.held += size

    def _drop(self, key: Key) -> None:
        self.held -= len(self._blocks.pop(key))
        metrics.store_cache(self.held)

    def __repr__(self) -> str:
        return f"BlockCache({len(self._blocks)} blocks, {self.held} of {self.budget} bytes)"
