import asyncio
from random import Random

import pytest

from meshtide_server.hosting.block_cache import BlockCache
from meshtide_server.store import StoreError


class Source:
    """Blocks of given sizes; watches how much is held while they are fetched."""

    def __init__(self, cache: BlockCache) -> None:
        self.cache = cache
        self.fetched: list[str] = []
        self.most = 0

    async def get(self, name: str, size: int) -> bytes:
        async def fetch() -> bytes:
            self.fetched.append(name)
            self.most = max(self.most, self.cache.held)
            await asyncio.sleep(0.001)
            self.most = max(self.most, self.cache.held)
            return name.encode()[:1] * size

        return await self.cache.get((name, 0), size, fetch)


async def test_a_block_is_fetched_once_for_all_who_ask() -> None:
    source = Source(BlockCache(100))
    blocks = await asyncio.gather(*(source.get("a", 40) for _ in range(50)))
    assert blocks == [b"a" * 40] * 50
    assert await source.get("a", 40) is blocks[0]
    assert source.fetched == ["a"]
    assert source.cache.find(("a", 0)) is blocks[0]
    assert source.cache.find(("a", 1)) is None


async def test_what_was_used_least_recently_gives_way() -> None:
    source = Source(BlockCache(100))
    for name in ("a", "b", "a", "c", "a", "b"):
        await source.get(name, 40)
    assert source.fetched == ["a", "b", "c", "b"]
    assert (source.cache.held, len(source.cache)) == (80, 2)


async def test_the_budget_holds_while_much_is_fetched_at_once() -> None:
    random = Random(5)
    source = Source(BlockCache(1000))
    sizes = {f"{letter}{number}": random.randint(0, 1000) for letter in "abcdef" for number in range(20)}
    wanted = [random.choice(list(sizes)) for _ in range(400)]
    blocks = await asyncio.gather(*(source.get(name, sizes[name]) for name in wanted))
    assert [len(block) for block in blocks] == [sizes[name] for name in wanted]
    assert 500 < source.most <= 1000
    assert source.cache.held <= 1000


async def test_what_fails_is_told_to_all_and_not_kept() -> None:
    cache = BlockCache(100)

    async def fail() -> bytes:
        await asyncio.sleep(0)
        raise StoreError("gone")

    outcomes = await asyncio.gather(*(cache.get(("a", 0), 60, fail) for _ in range(5)), return_exceptions=True)
    assert [str(outcome) for outcome in outcomes] == ["gone"] * 5
    assert (cache.held, len(cache)) == (0, 0)
    assert await Source(cache).get("a", 100) == b"a" * 100


async def test_a_failure_makes_room_for_who_waits() -> None:
    cache = BlockCache(100)
    go = asyncio.Event()

    async def fail() -> bytes:
        await go.wait()
        raise StoreError("gone")

    first = asyncio.create_task(cache.get(("a", 0), 80, fail))
    await asyncio.sleep(0)
    second = asyncio.create_task(Source(cache).get("b", 90))
    await asyncio.sleep(0.01)
    assert not second.done()
    go.set()
    with pytest.raises(StoreError):
        await first
    assert await second == b"b" * 90


async def test_an_object_is_forgotten_with_all_its_blocks() -> None:
    source = Source(BlockCache(100))
    await source.get("a", 30)
    await source.get("b", 30)
    source.cache.forget("a")
    assert (source.cache.find(("a", 0)), source.cache.held) == (None, 30)


async def test_what_can_never_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="101 bytes does not fit into 100"):
        await Source(BlockCache(100)).get("a", 101)
