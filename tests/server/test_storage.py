from pathlib import Path

import pytest

from meshtide_codec.errors import StreamError
from meshtide_server.storage import FileStorage, MemoryStorage, Storage


@pytest.fixture(params=["file", "memory"])
def storage(request: pytest.FixtureRequest, tmp_path: Path) -> Storage:
    if request.param == "memory":
        return MemoryStorage(bytes(range(100)))
    (tmp_path / "data").write_bytes(bytes(range(100)))
    return FileStorage(tmp_path / "data")


def test_every_storage_reads_ranges_to_many_readers(storage: Storage) -> None:
    with storage.open() as first, storage.open() as second:
        assert first.read(10, 20) == bytes(range(10, 20))
        assert second.read(0, 100) == bytes(range(100))
        assert first.read(99, 100) == b"c"
        assert first.read(5, 5) == b""
    assert storage.size == 100
    assert storage.unchanged()


def test_a_replaced_file_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(b"first")
    storage = FileStorage(path)
    (tmp_path / "other").write_bytes(b"other")
    (tmp_path / "other").replace(path)
    assert not storage.unchanged()
    with pytest.raises(StreamError, match="has changed since it was checked"):
        storage.open()


def test_a_missing_file_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(b"first")
    storage = FileStorage(path)
    path.unlink()
    assert not storage.unchanged()
    with pytest.raises(StreamError, match="can no longer be opened: No such file"):
        storage.open()


def test_a_file_cut_short_while_open_is_an_error_not_a_crash(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(bytes(100_000))
    with FileStorage(path).open() as opened:
        path.write_bytes(bytes(50_000))
        assert opened.read(0, 50_000) == bytes(50_000)
        with pytest.raises(StreamError, match="10 bytes short; it was changed in place"):
            opened.read(49_000, 50_010)


def test_closing_twice_is_fine_and_reading_after_it_is_not(tmp_path: Path) -> None:
    (tmp_path / "data").write_bytes(b"abc")
    opened = FileStorage(tmp_path / "data").open()
    opened.close()
    opened.close()
    with pytest.raises(ValueError, match="is closed"):
        opened.read(0, 1)
