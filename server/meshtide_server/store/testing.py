"""What every store must do: a test class to inherit, whoever wrote the store.

    import pytest
    from meshtide_server.store.testing import StoreConformance

    class TestMyStore(StoreConformance):
        @pytest.fixture
        def store(self):
            return MyStore()

Needs pytest, pytest-asyncio and hypothesis (`pip install 'meshtide[testing]'`); nothing else of the package imports
this module. `pytest.register_assert_rewrite("meshtide_server.store.testing")` in a conftest.py makes pytest tell what
the two sides of a failed assertion were.
"""

from __future__ import annotations

import asyncio
import hashlib
from contextlib import closing
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_server.store import InvalidKeyError, MissingObjectError, ObjectInfo, ObjectRangeError, Store, StoreError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

try:
    import pytest
    import pytest_asyncio  # noqa: F401 - runs the tests
    from hypothesis import HealthCheck, given, settings
    from hypothesis import strategies as st
except ModuleNotFoundError as error:
    raise MeshtideError(f"meshtide_server.store.testing needs {error.name}: pip install 'meshtide[testing]'") from error

FOREIGN_KEYS = (
    "",
    "/",
    "/etc/passwd",
    "..",
    "../escape",
    "streams/../../escape",
    "streams/./a",
    "streams//a",
    "streams/",
    ".hidden",
    "streams/.parts",
    "a\\b",
    "a\0b",
    "a b",
    "Upper",
    "büste",
    "a%2e%2e",
    "a\n",
    "c:",
    "x" * 129,
    "/".join(["x" * 100] * 6),
)


async def parts_of(data: bytes, size: int) -> AsyncIterator[bytes]:
    """`data` in parts of `size` bytes."""
    for start in range(0, len(data), size):
        await asyncio.sleep(0)
        yield data[start : start + size]


async def listed(store: Store, prefix: str = "", after: str = "") -> list[str]:
    """The keys of a listing, as they come."""
    return [info.key async for info in store.list(prefix, after=after)]


@pytest.mark.asyncio
class StoreConformance:
    """Each test gets an empty store as `store`: a fixture of the class that inherits."""

    async def test_what_was_put_is_there(self, store: Store) -> None:
        info = await store.put("streams/a.tide", b"hello")
        assert (info.key, info.size) == ("streams/a.tide", 5)
        assert info.etag
        assert await store.get("streams/a.tide") == b"hello"
        assert await store.head("streams/a.tide") == info

    async def test_an_empty_object_is_an_object(self, store: Store) -> None:
        await store.put("empty", b"")
        await store.put("empty-streamed", parts_of(b"", 1))
        for key in ("empty", "empty-streamed"):
            assert await store.get(key) == b""
            assert await store.get_range(key, 0, 0) == b""
            assert (await store.head(key)).size == 0

    async def test_putting_again_replaces(self, store: Store) -> None:
        first = await store.put("a", b"first")
        second = await store.put("a", b"second, longer")
        assert await store.get("a") == b"second, longer"
        assert second.etag != first.etag
        assert await store.head("a") == second

    async def test_missing_keys_are_told(self, store: Store) -> None:
        await store.put("folder/a", b"x")
        for key in ("nothing", "folder", "folder/b", "folder/a/b"):
            with pytest.raises(MissingObjectError, match=f"there is no object '{key}'"):
                await store.get(key)
            with pytest.raises(MissingObjectError):
                await store.get_range(key, 0, 1)
            with pytest.raises(MissingObjectError):
                await store.get_range(key, 0, 0)
            with pytest.raises(MissingObjectError):
                await store.head(key)
            await store.delete(key)
        assert await store.get("folder/a") == b"x"

    async def test_ranges_are_read_again_and_again(self, store: Store) -> None:
        data = bytes(range(256))
        await store.put("streams/a.tide", data)
        reader = await store.open_range_reader("streams/a.tide")
        assert reader.size in {None, len(data)}
        with closing(reader.open()) as first, closing(reader.open()) as second:
            for opened, start, end in ((first, 0, 256), (second, 7, 11), (first, 255, 256)):
                assert await opened.read(start, end) == data[start:end]
                assert opened.at_hand(start, end) == (data[start:end] if reader.is_near else None)
        assert reader.unchanged()

    async def test_a_range_reader_of_nothing_is_refused_at_once_or_when_it_is_read(self, store: Store) -> None:
        with pytest.raises(MissingObjectError):
            await (await store.open_range_reader("streams/none.tide")).open().read(0, 1)
        with pytest.raises(InvalidKeyError):
            await store.open_range_reader("../none")

    async def test_deleted_objects_are_gone(self, store: Store) -> None:
        await store.put("a", b"x")
        await store.put("b", b"y")
        await store.delete("a")
        await store.delete("a")
        with pytest.raises(MissingObjectError):
            await store.get("a")
        assert await listed(store) == ["b"]

    async def test_ranges(self, store: Store) -> None:
        data = bytes(range(100))
        await store.put("a", data)
        for start, end in ((0, 100), (0, 1), (99, 100), (10, 20), (0, 0), (50, 50), (100, 100)):
            assert await store.get_range("a", start, end) == data[start:end]

    @pytest.mark.parametrize(
        ("start", "end"), [(0, 101), (99, 101), (100, 101), (101, 101), (101, 200), (5, 4), (-1, 5), (-5, -1), (0, -1)]
    )
    async def test_ranges_outside_are_refused(self, store: Store, start: int, end: int) -> None:
        await store.put("a", bytes(100))
        with pytest.raises(ObjectRangeError, match=f"bytes {start} to {end} are not a range of object 'a'"):
            await store.get_range("a", start, end)

    @pytest.mark.parametrize("key", FOREIGN_KEYS)
    async def test_foreign_keys_are_refused(self, store: Store, key: str) -> None:
        for attempt in (
            store.get(key),
            store.get_range(key, 0, 1),
            store.put(key, b"x"),
            store.put(key, parts_of(b"x", 1)),
            store.head(key),
            store.delete(key),
        ):
            with pytest.raises(InvalidKeyError):
                await attempt
        if key not in {"", "streams/"}:
            with pytest.raises(InvalidKeyError):
                await listed(store, key)
        assert await listed(store) == []

    async def test_large_objects_are_put_in_parts(self, store: Store) -> None:
        data = hashlib.shake_128(b"large").digest(20_000_003)
        for size in (1 << 16, 9_000_000):
            info = await store.put("sources/large.obj", parts_of(data, size))
            assert info.size == len(data)
            assert await store.get("sources/large.obj") == data
            assert await store.get_range("sources/large.obj", 8_388_600, 8_388_700) == data[8_388_600:8_388_700]
            assert await store.head("sources/large.obj") == info

    @pytest.mark.parametrize("before", [0, 100, 12_000_000])
    async def test_a_put_that_fails_on_the_way_changes_nothing(self, store: Store, before: int) -> None:
        async def failing() -> AsyncIterator[bytes]:
            for start in range(0, before, 3_000_000):
                yield bytes(min(3_000_000, before - start))
            raise ConnectionResetError("the client left")

        with pytest.raises((ConnectionResetError, StoreError)):
            await store.put("new", failing())
        await store.put("old", b"old")
        with pytest.raises((ConnectionResetError, StoreError)):
            await store.put("old", failing())
        assert await store.get("old") == b"old"
        assert await listed(store) == ["old"]

    async def test_a_put_that_is_given_up_changes_nothing(self, store: Store) -> None:
        begun = asyncio.Event()

        async def endless() -> AsyncIterator[bytes]:
            yield b"x"
            begun.set()
            await asyncio.Event().wait()

        task = asyncio.create_task(store.put("a", endless()))
        await begun.wait()
        assert await listed(store) == []
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert await listed(store) == []

    async def test_concurrent_puts_leave_one_whole_object(self, store: Store) -> None:
        candidates = [bytes([number]) * (1000 + number) for number in range(12)]
        await store.put("a", candidates[0])

        async def look() -> None:
            for _ in range(10):
                assert await store.get("a") in candidates

        puts = [store.put("a", data if index % 2 else parts_of(data, 100)) for index, data in enumerate(candidates)]
        await asyncio.gather(*puts, look(), look())
        assert await store.get("a") in candidates
        assert await listed(store) == ["a"]

    async def test_listing_is_in_order_and_by_folder(self, store: Store) -> None:
        keys = ["b/2", "a", "b/10", "b/c/1", "b-x/1", "b.x", "bb/1", "c", "b_x"]
        for key in keys:
            await store.put(key, key.encode())
        assert sorted(await listed(store)) == sorted(keys)  # in which order folders come is the store's own
        assert await listed(store, "b") == ["b/10", "b/2", "b/c/1"]
        assert await listed(store, "b/") == ["b/10", "b/2", "b/c/1"]
        assert await listed(store, "b/c") == ["b/c/1"]
        assert await listed(store, "a") == []
        assert await listed(store, "nowhere") == []
        infos = [info async for info in store.list("b")]
        assert infos == [await store.head(info.key) for info in infos]

    async def test_a_listing_can_go_on_where_it_ended(self, store: Store) -> None:
        keys = [f"streams/{number:03d}.tide" for number in range(25)]
        await asyncio.gather(*(store.put(key, b"x") for key in keys))
        seen: list[str] = []
        while True:
            page: list[ObjectInfo] = []
            async for info in store.list("streams", after=seen[-1] if seen else ""):
                page.append(info)
                if len(page) == 10:
                    break
            if not page:
                break
            seen += [info.key for info in page]
        assert seen == keys
        assert await listed(store, "streams", after="streams/0235") == keys[24:]

    async def test_any_bytes_come_back(self, store: Store) -> None:
        loop = asyncio.get_running_loop()

        @settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
        @given(data=st.binary(max_size=300), cut=st.tuples(st.integers(0, 300), st.integers(0, 300)))
        def check(data: bytes, cut: tuple[int, int]) -> None:
            start, end = sorted(min(place, len(data)) for place in cut)

            async def there_and_back() -> None:
                await store.put("any", data)
                assert await store.get("any") == data
                assert await store.get_range("any", start, end) == data[start:end]

            asyncio.run_coroutine_threadsafe(there_and_back(), loop).result(30)

        await asyncio.to_thread(check)

    async def test_closing_twice_lets_go_of_no_object(self, store: Store) -> None:
        await store.put("streams/kept", b"as it was")
        await store.close()
        await store.close()
        assert await store.get("streams/kept") == b"as it was"
