from __future__ import annotations

import asyncio
import threading
import time
from contextlib import closing

import pytest

from meshtide_client.download.decoding_thread import DecodingThread


async def test_functions_run_in_order_off_the_event_loop() -> None:
    order: list[int] = []
    with closing(DecodingThread()) as thread:
        await asyncio.gather(*(thread.run(order.append, number) for number in range(20)))
        name = await thread.run(lambda: threading.current_thread().name)
    assert order == list(range(20))
    assert name == "meshtide-decoding"


async def test_errors_are_raised_where_one_waits() -> None:
    with closing(DecodingThread()) as thread:
        with pytest.raises(ZeroDivisionError):
            await thread.run(divmod, 1, 0)
        assert await thread.run(divmod, 7, 2) == (3, 1)


async def test_the_event_loop_goes_on_meanwhile() -> None:
    ticks = 0

    async def tick() -> None:
        nonlocal ticks
        while True:
            await asyncio.sleep(0.005)
            ticks += 1

    ticking = asyncio.create_task(tick())
    with closing(DecodingThread()) as thread:
        await thread.run(time.sleep, 0.1)
    ticking.cancel()
    assert ticks >= 5


async def test_the_thread_ends_when_closed() -> None:
    thread = DecodingThread()
    worker = await thread.run(threading.current_thread)
    thread.close()
    worker.join(2.0)
    assert not worker.is_alive()


async def test_what_was_given_up_is_not_run() -> None:
    done: list[str] = []
    with closing(DecodingThread()) as thread:
        slow = asyncio.ensure_future(thread.run(time.sleep, 0.1))
        given_up = asyncio.ensure_future(thread.run(done.append, "given up"))
        await asyncio.sleep(0.01)
        given_up.cancel()
        await slow
        await thread.run(done.append, "last")
    assert done == ["last"]
