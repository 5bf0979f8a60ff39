import asyncio

import pytest

from meshtide_server.hosting.single_flight import SingleFlight


class Work:
    """Counts how often it is done, and waits until it is told to end."""

    def __init__(self, error: Exception | None = None) -> None:
        self.done = 0
        self.go = asyncio.Event()
        self._error = error

    async def __call__(self) -> str:
        self.done += 1
        await self.go.wait()
        if self._error is not None:
            raise self._error
        return f"outcome {self.done}"


async def begun(flight: SingleFlight[str, str], work: Work, count: int) -> list[asyncio.Task[str]]:
    tasks = [asyncio.create_task(flight.do("key", work)) for _ in range(count)]
    await asyncio.sleep(0.01)
    return tasks


async def test_what_many_ask_for_is_done_once_and_later_again() -> None:
    flight, work = SingleFlight[str, str](), Work()
    tasks = await begun(flight, work, 20)
    work.go.set()
    assert await asyncio.gather(*tasks) == ["outcome 1"] * 20
    assert await flight.do("key", work) == "outcome 2"


async def test_different_keys_do_not_wait_for_each_other() -> None:
    flight, slow, fast = SingleFlight[str, str](), Work(), Work()
    tasks = await begun(flight, slow, 1)
    fast.go.set()
    assert await flight.do("other", fast) == "outcome 1"
    assert not tasks[0].done()
    slow.go.set()
    await tasks[0]


async def test_all_are_told_what_went_wrong_and_the_next_tries_again() -> None:
    flight, work = SingleFlight[str, str](), Work(ValueError("no luck"))
    tasks = await begun(flight, work, 3)
    work.go.set()
    for outcome in await asyncio.gather(*tasks, return_exceptions=True):
        assert str(outcome) == "no luck"
    with pytest.raises(ValueError, match="no luck"):
        await flight.do("key", work)
    assert work.done == 2


async def test_one_who_leaves_takes_nothing_from_the_others() -> None:
    flight, work = SingleFlight[str, str](), Work()
    first, second = await begun(flight, work, 2)
    first.cancel()
    await asyncio.sleep(0.01)
    work.go.set()
    assert await second == "outcome 1"
    assert first.cancelled()


async def test_closing_gives_up() -> None:
    flight, work = SingleFlight[str, str](), Work()
    (task,) = await begun(flight, work, 1)
    await flight.close()
    with pytest.raises(asyncio.CancelledError):
        await task
