"""Files on their way into store and catalogue, with encoders that do as they are told."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bulk_ingests import Chosen, chosen
from meshtide_codec.errors import TransferError
from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.bulk_ingest import ingestion as module
from meshtide_server.bulk_ingest.encode_file import FileOutcome, FileTask
from meshtide_server.bulk_ingest.ingestion import Ingestion
from meshtide_server.catalogue import Catalogue, DatabaseUnavailableError, MeshRecord
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.settings import Settings
from meshtide_server.store import StoreError, stream_key
from meshtide_server.store.memory import MemoryStore

from ..made_streams import make_stream

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterable

Reported = tuple[str, str | None, str, str | None]


class Encoders:
    """Make of each file the stream of the number that is in it; of others, what the test says."""

    def __init__(self, capacity: int = 3) -> None:
        self.capacity = capacity
        self.under_way = 0
        self.most = 0
        self.outcomes: dict[str, FileOutcome | Exception] = {}
        self.hold: asyncio.Event | None = None
        self._begun = asyncio.Condition()

    async def busy(self, expected: int) -> None:
        """Wait until so many files are under way."""
        async with asyncio.timeout(20), self._begun:
            await self._begun.wait_for(lambda: self.under_way == expected)

    async def encode(self, task: FileTask) -> FileOutcome:
        self.under_way += 1
        self.most = max(self.most, self.under_way)
        async with self._begun:
            self._begun.notify_all()
        try:
            await asyncio.sleep(0.02)
            if self.hold is not None:
                await self.hold.wait()
            outcome = self.outcomes.get(task.path.name)
            if isinstance(outcome, Exception):
                raise outcome
            return outcome or FileOutcome(make_stream(int(task.path.read_text())))
        finally:
            self.under_way -= 1


@pytest.fixture(name="catalogue")
async def _catalogue(tmp_path: Path) -> AsyncIterator[Catalogue]:
    opened = await Catalogue.open(f"sqlite:///{tmp_path}/catalogue.db")
    yield opened
    await opened.close()


@pytest.fixture(autouse=True)
def _no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PAUSES", (0.0, 0.0))


class Ingest:
    """Runs ingests and keeps what was told."""

    def __init__(self, catalogue: Catalogue, folder: Path) -> None:
        self.catalogue = catalogue
        self.folder = folder
        self.store: Any = MemoryStore()
        self.encoders = Encoders()
        self.told: list[Reported] = []
        self.notes: list[tuple[str, str]] = []
        self.settings = Settings(data=folder / "data", max_upload=100_000)

    def file(self, name: str, content: str) -> Path:
        path = self.folder / "scans" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
        return path

    async def run(self, files: Iterable[Chosen], **more: Any) -> list[Reported]:
        self.told.clear()
        given: dict[str, Any] = {"tags": ("scan",), "licence": "CC0", "taken": set(), "report": self.tell, **more}
        await Ingestion(self.store, self.catalogue, self.encoders, self.settings, **given).run(files)
        return sorted(self.told)

    def tell(self, file: Path, mesh: str | None, state: str, error: str | None, notes: tuple[str, ...]) -> None:
        self.notes += [(file.name, note) for note in notes]
        self.told.append((str(file.relative_to(self.folder / "scans")), mesh, state, error))

    async def meshes(self) -> dict[str, MeshRecord]:
        return {mesh.id: mesh for mesh in (await self.catalogue.meshes.list(MeshQuery())).meshes}


@pytest.fixture(name="ingest")
def _ingest(catalogue: Catalogue, tmp_path: Path) -> Ingest:
    return Ingest(catalogue, tmp_path)


async def test_files_become_meshes_with_ids_in_the_order_of_the_files(ingest: Ingest) -> None:
    files = [chosen(ingest.file(f"{folder}/Scan 1.obj", str(number))) for number, folder in enumerate("abcdef")]
    told = await ingest.run(iter(files), taken={"scan-1"})
    assert told == [
        ("a/Scan 1.obj", "scan-1-obj", "done", None),
        *((f"{folder}/Scan 1.obj", f"scan-1-obj-{place}", "done", None) for place, folder in enumerate("bcdef", 2)),
    ]
    assert ingest.encoders.most == ingest.encoders.capacity
    meshes = await ingest.meshes()
    mesh = meshes["scan-1-obj-3"]
    assert (mesh.name, mesh.tags, mesh.licence, mesh.source) == ("Scan 1.obj", ("scan",), "CC0", files[2].digest)
    assert await ingest.store.get(stream_key(mesh.stream or "")) == make_stream(2)


async def test_what_is_not_kept_of_a_file_is_told(ingest: Ingest) -> None:
    note = "texture coordinates (12), 2 materials: not kept"
    ingest.encoders.outcomes = {"cube.obj": FileOutcome(make_stream(1), notes=(note, "a second"))}
    await ingest.run([chosen(ingest.file(name, str(turn))) for turn, name in enumerate(("plain.obj", "cube.obj"))])
    assert ingest.notes == [("cube.obj", note), ("cube.obj", "a second")]


async def test_ids_of_packed_files_are_without_both_suffixes(ingest: Ingest) -> None:
    names = ("scan.ply.gz", "scan.obj.gz", "scan.tide.gz")
    told = await ingest.run([chosen(ingest.file(name, str(turn))) for turn, name in enumerate(names)])
    assert {row[:3] for row in told} == {
        ("scan.ply.gz", "scan", "done"),
        ("scan.obj.gz", "scan-obj-gz", "done"),
        ("scan.tide.gz", None, "failed"),
    }
    assert (await ingest.meshes())["scan"].name == "scan.ply.gz"


async def test_files_that_fail_are_told_and_stop_no_other(ingest: Ingest) -> None:
    ingest.encoders.outcomes = {
        "bad.obj": FileOutcome(error="no mesh"),
        "changed.obj": FileOutcome(elsewhere=True),
        "odd.obj": KeyError("a fault"),
        "damaged.obj": FileOutcome(make_stream()[:-1]),
    }
    names = ("bad.obj", "changed.obj", "odd.obj", "damaged.obj", "scene.gltf", "notes.txt", "good.obj")
    files = [chosen(ingest.file(name, "1")) for name in names]
    files.append(chosen(ingest.file("large.obj", "x" * 100_001)))
    gone = chosen(ingest.file("gone.obj", "2"))
    gone.file.unlink()
    told = {name: (mesh, state, error or "") for name, mesh, state, error in await ingest.run([*files, gone])}
    assert told.pop("good.obj") == ("good", "done", "")
    assert {(mesh, state) for mesh, state, _ in told.values()} == {(None, "failed")}
    expected = {
        "bad.obj": "no mesh",
        "changed.obj": "was changed while it was ingested",
        "odd.obj": "internal error: KeyError",
        "damaged.obj": "packets are whole",
        "scene.gltf": "no mesh is read from files named *.gltf",
        "notes.txt": "no mesh is read from files named *.txt",
        "large.obj": "has 100001 bytes; 100000 are taken (MESHTIDE_MAX_UPLOAD)",
        "gone.obj": "No such file",
    }
    for name, words in expected.items():
        assert words in told[name][2], name
    assert list(await ingest.meshes()) == ["good"]


async def test_streams_are_given_to_the_encoders_too_which_look_into_them(ingest: Ingest) -> None:
    good, false = (chosen(ingest.file(name, name)) for name in ("a.tide", "b.tide"))
    ingest.encoders.outcomes = {"a.tide": FileOutcome(make_stream(7)), "b.tide": FileOutcome(error="it is not so")}
    told = await ingest.run([good, false])
    assert told == [("a.tide", "a", "done", None), ("b.tide", None, "failed", "it is not so")]
    assert list(await ingest.meshes()) == ["a"]


async def test_what_is_there_by_its_content_is_kept_and_replaced_on_demand(ingest: Ingest) -> None:
    file = ingest.file("a.obj", "1")
    assert await ingest.run([chosen(file)]) == [("a.obj", "a", "done", None)]
    assert await ingest.run([chosen(file)]) == [("a.obj", "a", "kept", None)]
    file.write_text("2")
    assert await ingest.run([chosen(file, "a")], tags=()) == [("a.obj", "a", "done", None)]
    mesh = (await ingest.meshes())["a"]
    assert (mesh.tags, mesh.source) == ((), chosen(file).digest)
    assert await ingest.store.get(stream_key(mesh.stream or "")) == make_stream(2)


async def test_an_id_that_somebody_takes_meanwhile_is_left_to_them(ingest: Ingest) -> None:
    await publish(ingest.store, ingest.catalogue, make_stream(5), Publication("a", "another.obj"))
    assert await ingest.run([chosen(ingest.file("a.obj", "1"))]) == [("a.obj", "a-obj", "done", None)]
    assert (await ingest.meshes())["a"].name == "another.obj"


async def test_two_ingests_of_the_same_files_make_them_once(ingest: Ingest) -> None:
    files = [chosen(ingest.file(f"{number}.obj", str(number))) for number in range(8)]
    ingest.encoders.hold = asyncio.Event()  # so that both have looked before either publishes
    ingest.encoders.capacity = 8
    both = asyncio.gather(ingest.run(files), ingest.run(files))
    await ingest.encoders.busy(16)
    ingest.encoders.hold.set()
    await both
    assert sorted(set(ingest.told)) == [(f"{n}.obj", str(n), "done", None) for n in range(8)]
    assert list(await ingest.meshes()) == [str(number) for number in range(8)]


@pytest.mark.parametrize("error", [StoreError("the disk is full"), DatabaseUnavailableError("the cable is cut")])
async def test_what_hinders_every_file_ends_the_ingest(
    ingest: Ingest, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    attempts = 0

    async def unable(*_: Any, **__: Any) -> None:
        nonlocal attempts
        attempts += 1
        raise error

    files = [chosen(ingest.file(f"{number}.obj", str(number))) for number in range(9)]
    monkeypatch.setattr(module, "publish", unable)
    told = await ingest.run(files)
    states = [(mesh, state, words) for _, mesh, state, words in told]
    assert set(states) == {(None, "failed", str(error)), (None, "left", f"not begun: {error}")}
    assert states.count((None, "left", f"not begun: {error}")) >= 9 - ingest.encoders.capacity
    assert attempts <= 3 * ingest.encoders.capacity
    monkeypatch.setattr(module, "publish", publish)
    assert {state for _, _, state, _ in await ingest.run(files)} == {"done"}


async def test_a_store_that_fails_once_is_asked_again(ingest: Ingest, monkeypatch: pytest.MonkeyPatch) -> None:
    failed: list[str] = []

    async def hesitant(store: Any, catalogue: Any, data: Any, publication: Publication, **more: Any) -> MeshRecord:
        if publication.id not in failed:
            failed.append(publication.id)
            raise StoreError("busy")
        return await publish(store, catalogue, data, publication, **more)

    monkeypatch.setattr(module, "publish", hesitant)
    files = [chosen(ingest.file(f"{number}.obj", str(number))) for number in range(4)]
    assert {state for _, _, state, _ in await ingest.run(files)} == {"done"}
    assert len(failed) == 4


async def test_a_cluster_that_is_lost_ends_the_ingest(ingest: Ingest) -> None:
    ingest.encoders.outcomes = {"0.obj": TransferError("the cluster is gone")}
    files = [chosen(ingest.file(f"{number}.obj", str(number))) for number in range(9)]
    told = await ingest.run(files)
    assert told[0] == ("0.obj", None, "failed", "the cluster is gone")
    assert ("8.obj", None, "left", "not begun: the cluster is gone") in told


async def test_an_ingest_that_is_interrupted_ends_what_is_under_way(ingest: Ingest) -> None:
    ingest.encoders.hold = asyncio.Event()
    files = [chosen(ingest.file(f"{number}.obj", str(number))) for number in range(5)]
    running = asyncio.create_task(ingest.run(files))
    await ingest.encoders.busy(3)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    assert ingest.encoders.under_way == 0
    assert ingest.told == []
    assert await ingest.meshes() == {}
    ingest.encoders.hold.set()
    assert {state for _, _, state, _ in await ingest.run(files)} == {"done"}


async def test_few_are_published_at_a_time_however_many_are_encoded(
    ingest: Ingest, monkeypatch: pytest.MonkeyPatch
) -> None:
    under_way = most = 0

    async def counted(*what: Any, **more: Any) -> MeshRecord:
        nonlocal under_way, most
        under_way += 1
        most = max(most, under_way)
        try:
            return await publish(*what, **more)
        finally:
            under_way -= 1

    monkeypatch.setattr(module, "publish", counted)
    ingest.encoders.capacity = 60
    files = [chosen(ingest.file(f"{number}.obj", str(number))) for number in range(60)]
    assert {state for _, _, state, _ in await ingest.run(files)} == {"done"}
    assert 1 < most <= module.PUBLISHERS


async def test_files_are_read_one_by_one(ingest: Ingest) -> None:
    taken: list[str] = []
    told_before: list[int] = []

    def files() -> Iterable[Chosen]:
        for number in range(8):
            taken.append(str(number))
            told_before.append(len(ingest.told))
            yield chosen(ingest.file(f"{number}.obj", str(number)))

    await ingest.run(files())
    assert len(taken) == 8
    assert all(before >= number - ingest.encoders.capacity for number, before in enumerate(told_before))
