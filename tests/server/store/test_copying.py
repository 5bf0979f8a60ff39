import hashlib
import json
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from meshtide_codec.errors import OptionError, StreamError
from meshtide_server.commands import register
from meshtide_server.store import MissingObjectError, ObjectInfo, StoreError, stream_key
from meshtide_server.store import copying as copying_module
from meshtide_server.store.copying import Copied, check_store, copy_store
from meshtide_server.store.local import LocalStore
from meshtide_server.store.memory import MemoryStore


async def filled(count: int = 20) -> MemoryStore:
    store = MemoryStore()
    for number in range(count):
        await store.put(f"streams/{number:02d}.tide", bytes([number]) * (100 * number))
    return store


async def everything(store: MemoryStore | LocalStore) -> dict[str, bytes]:
    return {info.key: await store.get(info.key) async for info in store.list()}


async def test_all_is_copied_and_a_second_time_only_what_is_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(copying_module, "PIECE_BYTES", 333)
    source, target = await filled(), LocalStore(tmp_path / "target")
    told: list[Copied] = []
    first = await copy_store(source, target, told.append)
    assert (first.objects, first.bytes, first.kept, first.gone) == (20, 19_000, 0, 0)
    assert len(told) == 20
    assert await everything(target) == await everything(source)
    await source.put("streams/new.tide", b"new")
    await target.put("streams/own.tide", b"own")
    second = await copy_store(source, target)
    assert (second.objects, second.kept) == (1, 20)
    assert await target.get("streams/own.tide") == b"own"


async def test_what_was_cut_short_is_copied_again() -> None:
    source, target = await filled(3), MemoryStore()
    await target.put("streams/02.tide", b"\x02" * 199)
    assert (await copy_store(source, target)).objects == 3
    assert await everything(target) == await everything(source)


async def test_what_is_deleted_meanwhile_is_no_error() -> None:
    class Fleeting(MemoryStore):
        async def get_range(self, key: str, start: int, end: int) -> bytes:
            if key.endswith("01.tide"):
                raise MissingObjectError(key)
            return await super().get_range(key, start, end)

    source, target = Fleeting(), MemoryStore()
    source._objects = (await filled(3))._objects
    copied = await copy_store(source, target)
    assert (copied.objects, copied.gone) == (2, 1)


async def test_a_store_that_fails_is_told() -> None:
    class Full(MemoryStore):
        async def put(self, key: str, data: bytes | AsyncIterator[bytes]) -> ObjectInfo:
            raise StoreError(f"no room for {key}, a {type(data).__name__}")

    with pytest.raises(StoreError, match="no room for streams/"):
        await copy_store(await filled(), Full())


def digest_key(data: bytes) -> str:
    return stream_key(hashlib.sha256(data).hexdigest())


async def test_what_is_damaged_is_not_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(copying_module, "PIECE_BYTES", 3)
    source, target = MemoryStore(), MemoryStore()
    for data in (b"whole", b"damaged", b"short"):
        await source.put(digest_key(data), data)
    await source.put(digest_key(b"damaged"), b"dAmaged")
    listed = dict(source._objects)
    data, info = listed[digest_key(b"short")]
    source._objects[digest_key(b"short")] = (data[:-1], info)
    bad = sorted([digest_key(b"damaged"), digest_key(b"short")])
    copied = await copy_store(source, target)
    assert (copied.objects, copied.damaged) == (1, bad)
    assert await everything(target) == {digest_key(b"whole"): b"whole"}
    checked = await check_store(source)
    assert (checked.objects, checked.bytes, checked.damaged) == (1, 5, bad)
    assert (await check_store(target)).damaged == []


def command(*arguments: str) -> typer.testing.Result:
    app = typer.Typer()
    register(app)
    return CliRunner().invoke(app, list(arguments))


def test_the_command(tmp_path: Path) -> None:
    (tmp_path / "source" / "streams").mkdir(parents=True)
    (tmp_path / "source" / "streams" / "a.tide").write_bytes(b"abc")
    done = command("copy-store", str(tmp_path / "source"), str(tmp_path / "target"), "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {"objects": 1, "bytes": 3, "kept": 0, "gone": 0, "damaged": []}
    assert (tmp_path / "target" / "streams" / "a.tide").read_bytes() == b"abc"
    again = command("copy-store", str(tmp_path / "source"), str(tmp_path / "target"))
    assert "0 objects with 0 bytes copied, 1 were there" in again.output
    assert isinstance(command("copy-store", str(tmp_path / "nothing"), str(tmp_path / "target")).exception, OptionError)
    key = digest_key(b"abc")
    (tmp_path / "target" / key).write_bytes(b"abc")
    assert "2 objects with 6 bytes are whole, 0 are damaged" in command("check-store", str(tmp_path / "target")).output
    (tmp_path / "target" / key).write_bytes(b"abd")
    damaged = command("check-store", str(tmp_path / "target"), "--json")
    assert json.loads(damaged.stdout) == {"objects": 1, "bytes": 3, "damaged": [key]}
    assert isinstance(damaged.exception, StreamError)
