from contextlib import closing
from pathlib import Path

import pytest

from meshtide_codec.errors import StreamError
from meshtide_server.store.memory import MemoryStore
from meshtide_server.store.protocol import RangeReader
from meshtide_server.store.range_reader import FileReader, MemoryReader, ObjectReader

DATA = bytes(range(100))


@pytest.fixture(params=["file", "memory", "object"], name="reader")
async def _reader(request: pytest.FixtureRequest, tmp_path: Path) -> RangeReader:
    if request.param == "memory":
        return MemoryReader(DATA)
    if request.param == "object":
        store = MemoryStore()
        await store.put("data", DATA)
        return ObjectReader(store, "data")
    (tmp_path / "data").write_bytes(DATA)
    return FileReader(tmp_path / "data")


async def test_ranges_are_read_by_many(reader: RangeReader) -> None:
    with closing(reader.open()) as first, closing(reader.open()) as second:
        for opened, start, end in ((first, 10, 20), (second, 0, 100), (first, 99, 100), (first, 5, 5)):
            assert await opened.read(start, end) == DATA[start:end]
            assert opened.at_hand(start, end) == (DATA[start:end] if reader.is_near else None)
    assert reader.size == (100 if reader.is_near else None)
    assert reader.unchanged()


def test_a_replaced_file_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(b"first")
    reader = FileReader(path)
    (tmp_path / "other").write_bytes(b"other")
    (tmp_path / "other").replace(path)
    assert not reader.unchanged()
    with pytest.raises(StreamError, match="has changed since it was checked"):
        reader.open()


def test_a_missing_file_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(b"first")
    reader = FileReader(path)
    path.unlink()
    assert not reader.unchanged()
    with pytest.raises(StreamError, match="can no longer be opened: No such file"):
        reader.open()


def test_a_file_cut_short_while_open_is_an_error_not_a_crash(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(bytes(100_000))
    with closing(FileReader(path).open()) as opened:
        path.write_bytes(bytes(50_000))
        assert opened.at_hand(0, 50_000) == bytes(50_000)
        with pytest.raises(StreamError, match="10 bytes short; it was changed in place"):
            opened.at_hand(49_000, 50_010)


def test_closing_twice_is_fine_and_reading_after_it_is_not(tmp_path: Path) -> None:
    (tmp_path / "data").write_bytes(b"abc")
    opened = FileReader(tmp_path / "data").open()
    opened.close()
    opened.close()
    with pytest.raises(ValueError, match="is closed"):
        opened.at_hand(0, 1)
