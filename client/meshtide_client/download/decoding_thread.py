"""A thread that decodes while the event loop keeps the connection alive.

Decoding a fine level takes seconds on a large mesh. On the event loop that would leave pings unanswered and the link
idle; so every piece of decoding goes through one thread, whatever its size, in order. It is a daemon, unlike those of
`asyncio.to_thread`: Ctrl-C ends the program without waiting for a level.
"""

from __future__ import annotations

import asyncio
import queue
import threading
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


class DecodingThread:
    """Runs functions one after the other, off the event loop."""

    def __init__(self) -> None:
        self._tasks: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = queue.SimpleQueue()
        threading.Thread(target=self._work, name="meshtide-decoding", daemon=True).start()

    async def run(
        self, function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Result:
        """What `function` returns; what it raises is raised here."""
        future: Future[Result] = Future()
        self._tasks.put((future, lambda: function(*args, **kwargs)))
        return await asyncio.wrap_future(future)

    def close(self) -> None:
        """End the thread once it has done what it was given."""
        self._tasks.put(None)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            future, function = task
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(function())
            except BaseException as error:  # noqa: BLE001 - belongs to the one who waits
                future.set_exception(error)
            del task, future, function  # a level's arrays must not live until the next one comes
