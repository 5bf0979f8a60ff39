"""Encoding on a Dask cluster of real processes, some of which are killed."""

from __future__ import annotations

import asyncio
import os
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from distributed import KilledWorker

from bulk_ingests import BITS, PROFILE, chosen, expected_stream, kept_in, small_meshes
from dask_cluster import running_cluster
from meshtide_codec.errors import OptionError, TransferError
from meshtide_server.bulk_ingest import dask_cluster as module
from meshtide_server.bulk_ingest.bulk_ingest import BulkIngest
from meshtide_server.bulk_ingest.dask_cluster import DaskCluster
from meshtide_server.bulk_ingest.encode_file import FileOutcome

from ..bulk_ingest.test_encode_file import box_of, task_for

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dask_cluster import RunningCluster


def expected_outcome(file: Path) -> FileOutcome:
    stream = expected_stream(file)
    return FileOutcome(stream, box_of(stream))


@pytest.fixture(name="cluster")
def _cluster(tmp_path: Path) -> Iterator[RunningCluster]:
    (tmp_path / "cluster").mkdir()
    with running_cluster(2, tmp_path / "cluster") as cluster:
        yield cluster


def test_a_hundred_meshes_on_two_workers_of_which_one_is_killed(tmp_path: Path, cluster: RunningCluster) -> None:
    files = small_meshes(tmp_path / "scans", 100)
    expected = {file.stem: expected_stream(file) for file in files}
    work = BulkIngest(data=tmp_path / "kept", bits=BITS, profile=PROFILE, scheduler=cluster.address)
    told: list[tuple[Path, str | None, str, str | None, tuple[str, ...]]] = []

    def tell(*what: Any) -> None:
        told.append(what)
        if len(told) == 30:
            os.kill(cluster.workers[0], signal.SIGKILL)

    work.run((chosen(file) for file in files), tell)
    assert sorted(told) == [(file, file.stem, "done", None, ()) for file in files]
    found = kept_in(tmp_path / "kept")
    assert found.streams == expected
    assert found.keys == found.expected_keys


async def test_workers_that_do_not_see_a_file_are_sent_it_and_a_cluster_that_goes_is_told(
    tmp_path: Path, cluster: RunningCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = small_meshes(tmp_path / "scans", 4)
    monkeypatch.chdir(tmp_path)
    here = [Path("scans") / file.name for file in files]  # the workers work in another folder
    dask = await DaskCluster.connect(cluster.address, 3.0)
    try:
        assert await dask.encode(task_for(files[0])) == expected_outcome(files[0])
        assert not dask._send_contents
        monkeypatch.setattr(module, "CONTENT_BYTES", 10)  # less than one file: one goes after the other
        for file in here[1:]:
            assert await dask.encode(task_for(file)) == expected_outcome(file)
        assert dask._send_contents
        assert dask._sent == 0
        task = task_for(here[0])
        here[0].write_text("something else")
        assert await dask.encode(task) == FileOutcome(elsewhere=True)
        cluster.stop()
        with pytest.raises(TransferError, match="the connection to the Dask scheduler was lost"):
            await dask.encode(task_for(files[1]))
    finally:
        await dask.close()


async def test_a_cluster_without_workers_is_told(tmp_path: Path) -> None:
    with running_cluster(0, tmp_path) as cluster, pytest.raises(TransferError, match="has no worker"):
        await DaskCluster.connect(cluster.address, 0.5)


async def test_what_is_no_scheduler_is_told() -> None:
    with pytest.raises(TransferError, match="there is no Dask scheduler at tcp://127.0.0.1:9"):
        await DaskCluster.connect("tcp://127.0.0.1:9", 0.5)
    with pytest.raises(OptionError, match="is not an address of a Dask scheduler"):
        await DaskCluster.connect("carrier-pigeon://roof", 0.5)


class Client:
    """Stands for a cluster whose workers die, or are not there."""

    def __init__(self, *results: FileOutcome | Exception, threads: int = 2) -> None:
        self.results = list(results)
        self.threads = threads
        self.status = "running"
        self.released = 0

    def submit(self, *_: Any, pure: bool) -> Client:
        assert not pure  # or Dask would give the answer of an attempt that failed again
        return self

    async def result(self) -> FileOutcome:
        if not self.results:
            await asyncio.sleep(60)
        result = self.results.pop(0)
        if isinstance(result, Exception):
            raise result
        return result

    def release(self) -> None:
        self.released += 1

    async def nthreads(self) -> dict[str, int]:
        return {"tcp://worker:1": self.threads}

    async def close(self) -> None:
        self.status = "closed"


async def encoded(client: Client, file: Path, patience: float = 30.0) -> FileOutcome:
    dask = DaskCluster(client, patience)  # type: ignore[arg-type]
    try:
        return await asyncio.wait_for(dask.encode(task_for(file)), 10)
    finally:
        await dask.close()


async def test_a_file_whose_workers_died_is_begun_once_more(tmp_path: Path) -> None:
    file = small_meshes(tmp_path, 1)[0]
    died = KilledWorker("encode_file", SimpleNamespace(address="tcp://worker:1"), 3)
    client = Client(died, FileOutcome(b"stream"))
    assert await encoded(client, file) == FileOutcome(b"stream")
    assert client.released == 2
    outcome = await encoded(Client(died, died), file)
    assert outcome.stream is None
    assert "the workers died that encoded it" in (outcome.error or "")


async def test_a_cluster_that_has_lost_its_workers_is_not_waited_for_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "WATCH_SECONDS", 0.01)
    client = Client(threads=0)
    with pytest.raises(TransferError, match="has had no worker for 0.05 s"):
        await encoded(client, small_meshes(tmp_path, 1)[0], 0.05)
    assert client.released == 1


async def test_a_client_that_has_closed_takes_no_more_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WATCH_SECONDS", 0.01)
    file = small_meshes(tmp_path, 1)[0]
    client = Client()
    client.status = "closed"
    with pytest.raises(TransferError, match="the connection to the Dask scheduler was lost; run it again"):
        await encoded(client, file)
    assert client.released == 0
    client = Client()
    asyncio.get_running_loop().call_later(0.05, lambda: setattr(client, "status", "closed"))
    with pytest.raises(TransferError, match="the connection to the Dask scheduler was lost; run it again"):
        await encoded(client, file)
    assert client.released == 1


async def test_a_larger_cluster_has_more_files_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WATCH_SECONDS", 0.01)
    dask = DaskCluster(Client(threads=100), 30.0)  # type: ignore[arg-type]
    assert dask.capacity == module.FEWEST_WAITING
    await asyncio.sleep(0.05)
    assert dask.capacity == 200
    await dask.close()
