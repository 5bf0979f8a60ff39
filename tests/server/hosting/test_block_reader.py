import asyncio
import hashlib
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.stream.container import ContainerReader
from meshtide_server.hosting import block_reader
from meshtide_server.hosting.block_cache import BlockCache
from meshtide_server.hosting.block_reader import BlockReader
from meshtide_server.store import DamagedObjectError, StoreError
from meshtide_server.store.memory import MemoryStore

from ..made_streams import make_stream

KEY = "streams/a.tide"
SIZES = (400, 30, 40, 2000, 50, 5000)
WHOLE = make_stream()


class Watched(MemoryStore):
    """Notes which ranges were asked for, and may die or damage what it returns."""

    def __init__(self) -> None:
        super().__init__()
        self.ranges: list[tuple[int, int]] = []
        self.dead = False
        self.cut = 0
        self.flipped = False

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        self.ranges.append((start, end))
        await asyncio.sleep(0.001)
        if self.dead:
            raise StoreError("the store is gone")
        data = bytearray(await super().get_range(key, start, end))
        if self.flipped:
            data[len(data) // 2] ^= 1
        return bytes(data[: len(data) - self.cut])


async def stored(
    data: bytes = WHOLE, budget: int = 1 << 20, block: int = 2200, monkeypatch: pytest.MonkeyPatch | None = None
) -> tuple[BlockReader, Watched]:
    """A stream in a store, in blocks of up to `block` bytes."""
    if monkeypatch is not None:
        monkeypatch.setattr(block_reader, "BLOCK_BYTES", block)
    reader = ContainerReader()
    packets = reader.feed(data)
    assert reader.header is not None
    store = Watched()
    await store.put(KEY, data)
    digests = tuple(hashlib.sha256(packet.payload).digest() for packet in packets)
    elsewhere = await store.open_range_reader(KEY)
    blocks = BlockReader(elsewhere, KEY, reader.header, reader.header_bytes, digests, BlockCache(budget))
    return blocks, store


async def test_whole_packets_are_fetched_once(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, store = await stored(monkeypatch=monkeypatch)
    front = len(blocks.front)
    assert [start - front for start in blocks.starts] == [0, 470, 2520, 7520]
    assert blocks.size == len(WHOLE)
    first, second = blocks.open(), blocks.open()
    assert await first.read(0, front) == WHOLE[:front]
    assert store.ranges == []
    assert await first.read(0, len(WHOLE)) == WHOLE
    assert await second.read(0, len(WHOLE)) == WHOLE
    assert second.at_hand(10, len(WHOLE) - 3) == WHOLE[10:-3]
    assert store.ranges == list(pairwise(blocks.starts))
    assert blocks.unchanged()


async def test_at_hand_is_what_is_in_memory_and_nothing_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, store = await stored(monkeypatch=monkeypatch)
    first, second, third, _ = blocks.starts
    opened = blocks.open()
    assert opened.at_hand(0, first) == WHOLE[:first]  # the header comes from the catalogue
    assert opened.at_hand(second, second + 5) is None
    assert store.ranges == []
    assert await opened.read(second, second + 5) == WHOLE[second : second + 5]
    assert opened.at_hand(second, third) == WHOLE[second:third]
    assert opened.at_hand(second, third + 1) is None
    blocks.cache.forget(KEY)
    assert opened.at_hand(second, second + 5) is None
    assert store.ranges == [(second, third)]


async def test_bytes_that_came_are_read_though_others_take_their_room_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, store = await stored(budget=5000, block=2200, monkeypatch=monkeypatch)
    opened = blocks.open()
    again = asyncio.create_task(opened.read(blocks.starts[2], blocks.size))  # fills all of the cache
    assert await opened.read(blocks.starts[1], blocks.starts[2]) == WHOLE[blocks.starts[1] : blocks.starts[2]]
    assert await again == WHOLE[blocks.starts[2] :]
    assert len(store.ranges) == 2


@given(st.integers(0, len(WHOLE)), st.integers(0, len(WHOLE)), st.integers(1, 8000))
async def test_any_range_is_that_of_the_file(first: int, second: int, block: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        blocks, _ = await stored(block=block, monkeypatch=patch)
    start, end = sorted((first, second))
    opened = blocks.open()
    assert await opened.read(start, end) == WHOLE[start:end]


async def test_a_hot_stream_asks_the_store_once_for_all_its_readers(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, store = await stored(monkeypatch=monkeypatch)

    async def read() -> bytes:
        opened = blocks.open()
        return await opened.read(0, blocks.size)

    assert await asyncio.gather(*(read() for _ in range(100))) == [WHOLE] * 100
    assert len(store.ranges) == 3


async def test_a_large_stream_takes_no_more_memory_than_it_may(monkeypatch: pytest.MonkeyPatch) -> None:
    data = make_stream(3, (40_000, 50_000, 60_000, 30_000, 20_000, 50_000))
    blocks, store = await stored(data, budget=100_000, block=60_000, monkeypatch=monkeypatch)
    random = Random(1)
    most = 0

    async def read() -> None:
        nonlocal most
        opened = blocks.open()
        for _ in range(20):
            start = random.randrange(len(data) - 1000)
            assert await opened.read(start, start + 1000) == data[start : start + 1000]
            most = max(most, blocks.cache.held)

    await asyncio.gather(*(read() for _ in range(10)))
    assert 60_000 <= most <= 100_000
    assert len(store.ranges) > 6


async def test_a_store_that_dies_ends_in_an_error_and_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, store = await stored(monkeypatch=monkeypatch)
    middle = blocks.starts[1]
    opened = blocks.open()
    assert await opened.read(0, middle) == WHOLE[:middle]
    store.dead = True
    with pytest.raises(StoreError, match="the store is gone"):
        await opened.read(middle, blocks.size)
    assert await opened.read(0, middle) == WHOLE[:middle]
    store.dead = False
    assert await opened.read(middle, blocks.size) == WHOLE[middle:]
    await store.delete(KEY)
    blocks.cache.forget(KEY)
    opened = blocks.open()
    with pytest.raises(DamagedObjectError, match="is gone from the store"):
        await opened.read(middle, blocks.size)
    await store.put(KEY, WHOLE[:-1])
    opened = blocks.open()
    with pytest.raises(DamagedObjectError, match="is damaged: bytes .* are not a range of"):
        await opened.read(middle, blocks.size)


@pytest.mark.parametrize("fault", ["cut", "flipped"])
async def test_wrong_or_short_bytes_are_an_error_and_not_kept(
    fault: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    blocks, store = await stored(monkeypatch=monkeypatch)
    store.cut, store.flipped = (7, False) if fault == "cut" else (0, True)
    expected = (
        "2043 bytes came of the 2050" if fault == "cut" else r"packet 3 \(Map&Conn, level 0\) at byte \d+ has another"
    )
    opened = blocks.open()
    with pytest.raises(DamagedObjectError, match=expected):
        await opened.read(blocks.starts[1], blocks.starts[1] + 1)
    assert (blocks.cache.held, len(blocks.cache)) == (0, 0)
    assert "is damaged" in caplog.text
    store.cut, store.flipped = 0, False
    opened = blocks.open()
    assert await opened.read(0, blocks.size) == WHOLE


async def test_a_packet_that_never_fits_is_told_at_once() -> None:
    with pytest.raises(StoreError, match="has a packet of 5000 bytes, and the cache takes 4999; raise MESHTIDE_STORE_"):
        await stored(budget=4999)
