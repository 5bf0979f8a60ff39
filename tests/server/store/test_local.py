# ruff: noqa: ASYNC220, ASYNC251 - the files of tests are small
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from meshtide_server.store import StoreError
from meshtide_server.store.local import PARTS, LocalStore
from meshtide_server.store.testing import StoreConformance

WRITER = """
import asyncio, sys
from pathlib import Path
from meshtide_server.store.local import LocalStore

async def parts():
    while True:
        yield b"x" * 1000
        print("wrote", flush=True)

asyncio.run(LocalStore(Path(sys.argv[1])).put("streams/a.tide", parts()))
"""


class TestLocalStore(StoreConformance):
    @pytest.fixture
    def store(self, tmp_path: Path) -> LocalStore:
        return LocalStore(tmp_path / "store")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "store"


async def test_a_crash_leaves_no_half_file_and_the_next_start_cleans_up(root: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", WRITER, str(root)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "wrote\n"
        second = LocalStore(root)  # another process that starts meanwhile leaves the running writer's file alone
        assert len(list((root / PARTS).iterdir())) == 1
        assert [info async for info in second.list()] == []
        writer.send_signal(signal.SIGKILL)
        writer.stdout.read()
    assert len(list((root / PARTS).iterdir())) == 1
    third = LocalStore(root)
    assert list((root / PARTS).iterdir()) == []
    assert [info async for info in third.list()] == []


async def test_everything_is_on_the_disk_before_and_after_the_move(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = LocalStore(root)
    events: list[str] = []
    fsync, replace = os.fsync, Path.replace

    def noted_fsync(descriptor: int) -> None:
        events.append("sync " + Path(f"/proc/self/fd/{descriptor}").readlink().name.rsplit(".", 1)[-1])
        fsync(descriptor)

    def noted_replace(self: Path, target: Path) -> Path:
        events.append("move")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    monkeypatch.setattr(Path, "replace", noted_replace)
    await store.put("streams/a.tide", b"x")
    assert events == ["sync part", "sync store", "move", "sync streams"]


async def test_a_key_in_the_place_of_a_folder_is_told(root: Path) -> None:
    store = LocalStore(root)
    await store.put("a/b", b"x")
    await store.put("c", b"x")
    with pytest.raises(StoreError, match="a folder stands in its place"):
        await store.put("a", b"y")
    with pytest.raises(StoreError, match="a file stands in its place"):
        await store.put("c/d", b"y")
    assert list((root / PARTS).iterdir()) == []


async def test_foreign_files_that_are_hidden_are_not_listed(root: Path) -> None:
    store = LocalStore(root)
    await store.put("a", b"x")
    (root / ".DS_Store").write_bytes(b"x")
    assert [info.key async for info in store.list()] == ["a"]


async def test_the_etag_tells_a_file_that_was_changed_by_others(root: Path) -> None:
    store = LocalStore(root)
    before = await store.put("a", b"x")
    time.sleep(0.01)
    (root / "a").write_bytes(b"y")
    assert (await store.head("a")).etag != before.etag


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"nothing can be kept in .*file/store: Not a directory"):
        LocalStore(tmp_path / "file" / "store")
