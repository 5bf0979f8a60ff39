"""Whether the server can do its work: asked by whoever decides where requests go."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from typing import TYPE_CHECKING

from meshtide_server.store.errors import MissingBucketError, MissingObjectError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from meshtide_server.store.protocol import Store

    Check = Callable[[], Awaitable[str | None]]

logger = logging.getLogger("meshtide.server")

CHECK_SECONDS = 2.0
"""A part that has not answered by then is not there."""
OK = "ok"
_NO_OBJECT = f"streams/{'0' * 64}.tide"


class Readiness:
    """The parts that the server needs, and whether each is there.

    Args:
        draining: is set when the server takes no new work any more.
    """

    def __init__(self, draining: asyncio.Event) -> None:
        self._draining = draining
        self._checks: dict[str, Check] = {}

    def add(self, name: str, check: Check) -> None:
        """Ask `check` from now on: it returns why that part cannot be used, or None; or raises."""
        self._checks[name] = check

    async def parts(self) -> dict[str, str]:
        """Every part and "ok", or why it cannot be used."""
        answers = await asyncio.gather(*(self._ask(name, check) for name, check in self._checks.items()))
        parts = dict(zip(self._checks, answers, strict=True))
        if self._draining.is_set():
            parts["server"] = "it is shutting down"
        return parts

    async def _ask(self, name: str, check: Check) -> str:
        try:
            async with asyncio.timeout(CHECK_SECONDS):
                return await check() or OK
        except TimeoutError:
            return f"it has not answered within {CHECK_SECONDS:g} s"
        except Exception as error:  # noqa: BLE001 - whatever it is, the part cannot be used; the log has the details
            logger.warning("%s cannot be used: %s: %s", name, type(error).__name__, error)
            return f"it cannot be used ({type(error).__name__})"


class StoreCheck:
    """Whether the store answers; until it did so once, also whether there is one.

    A bucket that does not exist answers for each object as one that exists: it has no such object.

    Args:
        store: is asked.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._is_there = False

    async def __call__(self) -> str | None:
        """Why it cannot be used, or None; raises what the store does."""
        if not self._is_there:
            try:
                async for _ in self._store.list("streams"):
                    break
            except MissingBucketError:
                return "there is no such bucket"
            self._is_there = True
        return await check_store(self._store)


async def check_store(store: Store) -> str | None:
    """Whether the store answers, be it that there is no such object; raises if not."""
    with suppress(MissingObjectError):
        await store.head(_NO_OBJECT)
    return None
