# ruff: noqa: ASYNC110, ASYNC240 - tests may poll, and their files are small
import asyncio
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from meshtide_server import library as library_module
from meshtide_server.encoder_process import Encoded, EncodingFailedError, Job
from meshtide_server.hosted_mesh import Status
from meshtide_server.library import Library
from meshtide_server.models import MeshSummary
from meshtide_server.settings import Settings

from .conftest import make_stream


class FakeEncoder:
    """Takes the place of the encoder's process: the stream of a mesh is random bytes made from its digest."""

    jobs: list[Job]

    def __init__(self) -> None:
        self.jobs = []
        self.closed = False
        self.hold = asyncio.Event()
        self.hold.set()

    async def encode(self, job: Job, progress: Callable[[str, float], None]) -> Encoded:
        self.jobs.append(job)
        progress("levels", 0.5)
        await self.hold.wait()
        name = job.file.name if job.file else job.sample
        if name == "bad.obj":
            raise EncodingFailedError("bad.obj: face 3 names vertex 99 of 8")
        data = make_stream(sum(job.digest.encode()))
        if name == "homeless.obj":
            return Encoded(None, data, ("/full: No space left on device",))
        job.targets[0].write_bytes(data)
        return Encoded(job.targets[0], b"", ())

    async def close(self) -> None:
        self.closed = True


@pytest.fixture
def encoders(monkeypatch: pytest.MonkeyPatch) -> list[FakeEncoder]:
    made: list[FakeEncoder] = []

    def make() -> FakeEncoder:
        made.append(FakeEncoder())
        return made[-1]

    monkeypatch.setattr(library_module, "EncoderProcess", make)
    return made


@asynccontextmanager
async def opened(**settings: object) -> AsyncIterator[Library]:
    library = Library(Settings.model_validate({"rescan_seconds": 0, **settings}))
    await library.start()
    try:
        yield library
    finally:
        await library.stop()


async def settled(library: Library) -> dict[str, Status]:
    await asyncio.wait_for(library.settled(), 10)
    return {mesh.id: mesh.status for mesh in library.meshes}


async def eventually(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not condition():
            await asyncio.sleep(0.01)


async def test_good_and_bad_neighbours(
    folder: Path, encoders: list[FakeEncoder], caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "cut.tide").write_bytes(make_stream()[:-5])
    (folder / "foreign.tide").write_text("hello")
    (folder / "empty.tide").touch()
    (folder / "older.tide").write_bytes(make_stream()[:8] + b"\2\0" + make_stream()[10:])
    (folder / "bad.obj").touch()
    (folder / "Good One.PLY").touch()
    (folder / "notes.txt").touch()
    (folder / ".hidden.obj").touch()
    (folder / "folder.obj").mkdir()
    (folder / "dangling.obj").symlink_to(folder / "nowhere")
    async with opened(directory=folder) as library:
        assert await settled(library) == {
            "bad": Status.FAILED,
            "cut": Status.FAILED,
            "empty": Status.FAILED,
            "foreign": Status.FAILED,
            "good-one": Status.READY,
            "older": Status.FAILED,
            "small": Status.READY,
        }
        reasons = {mesh.id: mesh.reason for mesh in library.meshes if mesh.reason}
        assert reasons["bad"] == "bad.obj: face 3 names vertex 99 of 8"
        assert "the file ends after" in reasons["cut"]
        assert "not a .tide file" in reasons["foreign"]
        assert "older meshtide (format 2): encode it again" in reasons["older"]
        assert "bad cannot be served" in caplog.text
    assert encoders[0].closed


async def test_ids_of_packed_files_are_without_both_suffixes(folder: Path, encoders: list[FakeEncoder]) -> None:
    for name in ("scan.obj.gz", "vase.PLY.gz", "vase.obj", "notes.gz"):
        (folder / name).touch()
    async with opened(directory=folder) as library:
        assert set(await settled(library)) == {"scan", "vase", "vase-obj", "small"}
    assert len(encoders) == 1


async def test_a_stream_is_encoded_once(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").write_text("v 0 0 0")
    for _ in range(2):
        async with opened(directory=folder) as library:
            assert (await settled(library))["a"] == Status.READY
    assert [len(encoder.jobs) for encoder in encoders] == [1, 0]
    (folder / "a.obj").write_text("v 0 0 1")
    async with opened(directory=folder) as library:
        await settled(library)
    assert len(encoders[2].jobs) == 1
    assert len(list((folder / ".meshtide").iterdir())) == 1  # the stale stream is gone


async def test_other_options_make_another_stream_beside_the_first(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").write_text("v 0 0 0")
    for bits in (12, 10, 12, 10):
        async with opened(directory=folder, bits=bits) as library:
            await settled(library)
    assert [len(encoder.jobs) for encoder in encoders] == [1, 1, 0, 0]


async def test_a_damaged_cache_is_made_anew(
    folder: Path, encoders: list[FakeEncoder], caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "a.obj").write_text("v 0 0 0")
    async with opened(directory=folder) as library:
        await settled(library)
    (cached,) = (folder / ".meshtide").iterdir()
    cached.write_bytes(cached.read_bytes()[:-1])
    async with opened(directory=folder) as library:
        assert (await settled(library))["a"] == Status.READY
    assert len(encoders[1].jobs) == 1
    assert "is damaged and will be made anew" in caplog.text


@pytest.mark.usefixtures("encoders")
async def test_the_cache_can_be_elsewhere(folder: Path, tmp_path: Path) -> None:
    (folder / "a.obj").touch()
    async with opened(directory=folder, cache=tmp_path / "cache") as library:
        await settled(library)
    assert len(list((tmp_path / "cache").rglob("*.tide"))) == 1
    assert not (folder / ".meshtide").exists()


async def test_a_cache_that_cannot_be_written_loses_nothing_while_the_server_runs(
    folder: Path, encoders: list[FakeEncoder], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "a.obj").touch()
    (tmp_path / "file").touch()
    async with opened(directory=folder, cache=tmp_path / "file") as library:
        assert (await settled(library))["a"] == Status.READY
        scratch = encoders[0].jobs[0].targets[0].parent
        assert scratch.is_dir()
    assert not scratch.exists()
    assert "then lost" in caplog.text


@pytest.mark.usefixtures("encoders")
async def test_a_stream_that_can_be_stored_nowhere_is_served_from_memory(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "homeless.obj").touch()
    async with opened(directory=folder) as library:
        assert (await settled(library))["homeless"] == Status.READY
        mesh = library.find("homeless")
        assert mesh is not None
        assert mesh.stream is not None
        with mesh.stream.open() as stream:
            assert len(stream.read(0, mesh.stream.size)) == mesh.stream.size
    assert "No space left on device" in caplog.text
    assert "kept in memory" in caplog.text


@pytest.mark.usefixtures("encoders")
async def test_files_of_one_stem_get_ids_of_their_own(folder: Path) -> None:
    for name in ("small.obj", "small.stl", "SMALL.obj"):
        (folder / name).write_text(name)
    async with opened(directory=folder) as library:
        assert set(await settled(library)) == {"small", "small-obj", "small-obj-2", "small-stl"}
        mesh = library.find("small")
        assert mesh is not None
        assert mesh.source.is_stream


@pytest.mark.usefixtures("encoders")
async def test_names_of_any_bytes_are_listed_in_printable_letters(folder: Path) -> None:
    for name in (b"caf\xe9.obj", b"a\nb.obj", b"\x1b[31mred.obj", "\u202eexe.obj".encode(), b"bad\xff.tide"):
        Path(os.fsdecode(os.fsencode(folder) + b"/" + name)).write_bytes(name)
    async with opened(directory=folder) as library:
        await settled(library)
        rows = [MeshSummary.of(mesh).model_dump_json() for mesh in library.meshes]
        assert len(rows) == 6
        assert {mesh.source.name for mesh in library.meshes} == {
            "small.tide", r"caf\udce9.obj", r"a\nb.obj", r"\x1b[31mred.obj", r"\u202eexe.obj", r"bad\udcff.tide"
        }  # fmt: skip
        statuses = [mesh.status for mesh in library.meshes]
        assert (statuses.count(Status.READY), statuses.count(Status.FAILED)) == (5, 1)


async def test_samples(encoders: list[FakeEncoder], private_cache: Path) -> None:
    async with opened(samples=True) as library:
        assert await settled(library) == {"spot": Status.READY, "stanford-bunny": Status.READY}
    assert len(list(private_cache.rglob("samples/*.tide"))) == 2
    async with opened(samples=True) as library:
        await settled(library)
    assert encoders[1].jobs == []


async def test_progress_is_told_while_a_mesh_is_encoded(folder: Path, encoders: list[FakeEncoder]) -> None:
    for name in ("a.obj", "b.obj"):
        (folder / name).touch()
    async with opened(directory=folder) as library:
        encoders[0].hold.clear()
        await eventually(lambda: bool(encoders[0].jobs))
        first, second, small = library.meshes
        await eventually(lambda: small.status == Status.READY)
        assert (first.status, first.stage, first.progress) == (Status.ENCODING, "levels", 0.5)
        assert (second.status, second.stage) == (Status.ENCODING, "waiting")
        encoders[0].hold.set()
        await settled(library)


async def test_stopping_in_the_middle_is_quick(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").touch()
    async with opened(directory=folder) as library:
        encoders[0].hold.clear()
        await eventually(lambda: bool(encoders[0].jobs))
        async with asyncio.timeout(2):
            await library.stop()
    assert encoders[0].closed


@pytest.mark.usefixtures("encoders")
async def test_new_changed_and_vanished_files_are_noticed(folder: Path) -> None:
    async with opened(directory=folder, rescan_seconds=0.05) as library:
        assert set(await settled(library)) == {"small"}
        first = library.find("small")
        (folder / "new.obj").touch()
        await eventually(lambda: library.find("new") is not None)
        assert (await settled(library))["new"] == Status.READY
        replacement = folder / ".small.part"
        replacement.write_bytes(make_stream(5))
        replacement.replace(folder / "small.tide")
        await eventually(lambda: library.find("small") is not first)
        await settled(library)
        mesh = library.find("small")
        assert mesh is not None
        assert mesh.stream is not None
        assert mesh.stream.header.options["seed"] == 5
        (folder / "new.obj").unlink()
        await eventually(lambda: library.find("new") is None)


async def test_a_cached_stream_that_vanishes_is_made_again(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").touch()
    async with opened(directory=folder, rescan_seconds=0.05) as library:
        await settled(library)
        for path in (folder / ".meshtide").iterdir():
            path.unlink()
        await eventually(lambda: len(encoders[0].jobs) == 2)
        assert (await settled(library))["a"] == Status.READY


@pytest.mark.usefixtures("encoders")
async def test_a_file_that_is_still_being_copied_is_left_alone(folder: Path) -> None:
    whole = make_stream(9)
    async with opened(directory=folder, rescan_seconds=0.2) as library:
        await settled(library)
        with (folder / "copy.tide").open("wb") as file:
            for start in range(0, len(whole), 1000):
                file.write(whole[start : start + 1000])
                file.flush()
                os.utime(file.fileno())
                await asyncio.sleep(0.06)
                mesh = library.find("copy")
                assert mesh is None or mesh.status != Status.FAILED
        await eventually(lambda: library.find("copy") is not None)
        assert (await settled(library))["copy"] == Status.READY


@pytest.mark.usefixtures("encoders")
async def test_an_empty_folder_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with opened(directory=tmp_path) as library:
        assert await settled(library) == {}
    assert "there are no meshes in" in caplog.text


@pytest.mark.usefixtures("encoders")
async def test_a_folder_that_vanishes_is_told_and_survived(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with opened(directory=folder, rescan_seconds=0.05) as library:
        await settled(library)
        folder.rename(folder.parent / "elsewhere")
        await eventually(lambda: "cannot look into" in caplog.text)
        assert library.find("small") is not None
        (folder.parent / "elsewhere").rename(folder)
