"""Jobs of a server: several at a time, and jobs that go wrong, which disturb no others."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import psutil
import pytest

from meshtide_server.catalogue import Catalogue, JobState
from meshtide_server.encoding.attempt import JobAttempt
from meshtide_server.hosting.publishing import publish
from meshtide_server.store import StoreError
from upload_server import TOKEN as UPLOAD_TOKEN
from upload_server import taking_uploads

from ..conftest import TETRAHEDRON, LiveServer, running
from ..encoding.test_process import FAULTY
from ..http.routes.test_ingest import WRITER, finished, post, settings_for
from ..made_streams import real_stream

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    Start = Callable[..., AbstractContextManager[LiveServer]]


@pytest.fixture
def start(folder: Path, tmp_path: Path) -> Start:
    """Starts a server that takes uploads, each time on the same store and catalogue."""
    return lambda **more: running(settings_for(folder, tmp_path / "data", **more))


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Encoders do what the names of files say."""
    monkeypatch.setattr("meshtide_server.encoding.process.PROGRAM", FAULTY)


def outcome(server: LiveServer, filename: str, data: bytes) -> dict[str, Any]:
    answer = post(server.url, filename, data)
    assert answer.status_code == 202
    return finished(server.url, answer.json()["id"])


def solid(number: int) -> bytes:
    """A mesh file, another one for each number."""
    return f"# {number}\n{TETRAHEDRON}".encode()


def until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def job_now(server: LiveServer, job: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = httpx.get(f"{server.url}/jobs/{job['id']}").json()
    return found


def until_stage(server: LiveServer, job: dict[str, Any], stage: str) -> None:
    until(lambda: job_now(server, job)["stage"] == stage)


@pytest.mark.parametrize(
    ("number", "code", "state", "attempts"), [(signal.SIGTERM, 0, "queued", 0), (signal.SIGKILL, -9, "running", 1)]
)
def test_no_encoder_outlives_its_server(tmp_path: Path, number: int, code: int, state: str, attempts: int) -> None:
    environment = {"MESHTIDE_DATA": str(tmp_path / "data"), "MESHTIDE_DRAIN_TIMEOUT": "0"}
    with taking_uploads(str(Path(__file__).parents[1] / "faulty_server.py"), **environment) as (url, process):
        headers = {"Authorization": f"Bearer {UPLOAD_TOKEN}"}
        answer = httpx.post(f"{url}/meshes", params={"filename": "sleep.obj"}, content=solid(1), headers=headers)
        job = answer.json()
        until(lambda: bool(httpx.get(f"{url}/jobs/{job['id']}").json()["stage"] == "sleep"))
        (encoder,) = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(number)
        assert process.wait(30) == code
        psutil.wait_procs([encoder], 30)
        assert not encoder.is_running()
    found = on_catalogue(tmp_path, lambda catalogue: catalogue.jobs.get(job["id"]))
    assert (found.state.value, found.attempts) == (state, attempts)


def on_catalogue(tmp_path: Path, work: Callable[[Catalogue], Any]) -> Any:
    """Do something with the servers' catalogue, as another server would."""

    async def run() -> Any:
        catalogue = await Catalogue.open(f"sqlite:///{tmp_path}/data/catalogue.db")
        try:
            return await work(catalogue)
        finally:
            await catalogue.close()

    return asyncio.run(run())


def encoders(server: LiveServer) -> int:
    return int(server.app.parts.jobs._encoders.running)


@pytest.mark.usefixtures("faulty")
def test_several_jobs_are_worked_on_at_once_and_handed_back_at_the_end(start: Start, tmp_path: Path) -> None:
    with start(job_processes=3, job_lost_seconds=1) as server:
        slow = [post(server.url, f"sleep-{turn}.obj", solid(turn)).json() for turn in range(2)]
        for job in slow:
            until_stage(server, job, "sleep")
        assert outcome(server, "good.obj", solid(2))["state"] == "done"  # not held up by the others
        more = post(server.url, "sleep-2.obj", solid(3)).json()
        until_stage(server, more, "sleep")
        waiting = post(server.url, "sleep-3.obj", solid(4)).json()
        time.sleep(0.7)
        assert job_now(server, waiting)["state"] == "queued"
        assert encoders(server) == 3
        runner = server.app.parts.jobs
    assert runner._encoders.running == 0
    jobs = on_catalogue(tmp_path, lambda catalogue: catalogue.jobs.list(state=JobState.QUEUED))
    assert {job.id for job in jobs} == {job["id"] for job in (*slow, more, waiting)}
    assert {(job.attempts, job.owner) for job in jobs} == {(0, None)}


@pytest.mark.usefixtures("faulty")
def test_a_job_that_takes_too_long_fails_at_once(start: Start) -> None:
    with start(job_seconds=0.5, job_processes=1) as server:
        job = outcome(server, "sleep.obj", solid(1))
        assert (job["state"], job["attempts"], job["error"]) == ("failed", 1, "it took longer than 0.5 s")
        assert encoders(server) == 0


@pytest.mark.usefixtures("faulty")
def test_a_parser_that_runs_away_costs_one_job(start: Start) -> None:
    with start(job_processor_seconds=1, job_processes=1) as server:
        job = outcome(server, "spin.obj", solid(1))
        assert (job["state"], job["attempts"]) == ("failed", 1)
        assert job["error"] == "it took more than 1 s of processor time"
        assert outcome(server, "burn.obj", solid(2))["state"] == "done"


@pytest.mark.usefixtures("faulty")
@pytest.mark.parametrize(("name", "how"), [("crash", "killed by SIGSEGV"), ("die", "with exit code 3")])
def test_a_job_that_brings_its_process_down_is_tried_twice_and_disturbs_no_other(
    start: Start, name: str, how: str
) -> None:
    with start(job_processes=2) as server:
        deadly = post(server.url, f"{name}.obj", solid(1)).json()
        good = outcome(server, "good.obj", solid(2))
        assert (good["state"], good["attempts"]) == ("done", 1)
        job = finished(server.url, deadly["id"])
        assert (job["state"], job["attempts"]) == ("failed", 2)
        assert how in job["error"]
        assert httpx.get(f"{server.url}/meshes/good").status_code == 200


def test_a_hostile_file_is_refused_once_with_its_reason(start: Start) -> None:
    with start(max_vertices=3) as server:
        job = outcome(server, "four.obj", TETRAHEDRON.encode())
        assert (job["state"], job["attempts"]) == ("failed", 1)
        assert "claims 4 vertices; 3 are the most that is read (this server's MESHTIDE_MAX_VERTICES)" in job["error"]


@pytest.mark.usefixtures("faulty")
def test_a_server_that_is_not_heard_of_loses_its_job_and_stops_working_on_it(
    start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with start(job_lost_seconds=1) as server:
        job = post(server.url, "sleep.obj", solid(1)).json()
        until_stage(server, job, "sleep")
        server.app.parts.draining.set()  # it would take the job again
        (lost,) = on_catalogue(tmp_path, lambda catalogue: catalogue.jobs.release_lost(timedelta(0)))
        assert (lost.id, lost.state.value) == (job["id"], "queued")
        until(lambda: encoders(server) == 0)
        assert "was not heard of any more" in job_now(server, job)["error"]
    monkeypatch.undo()
    with start() as server:
        done = finished(server.url, job["id"])
        assert (done["state"], done["attempts"], done["error"]) == ("done", 2, None)
        assert httpx.get(f"{server.url}/meshes/sleep.tide").status_code == 200


def test_a_job_that_is_replaced_while_its_upload_is_read_is_no_fault(
    start: Start, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with start(job_processes=1) as server:
        store = server.app.parts.library.published.store
        head = store.head
        reading, go = threading.Event(), threading.Event()

        async def slow(key: str) -> Any:
            if key.startswith("sources/") and server.app.parts.jobs._attempts and not go.is_set():
                reading.set()
                await asyncio.to_thread(go.wait, 20)
            return await head(key)

        monkeypatch.setattr(store, "head", slow)
        first = httpx.put(
            f"{server.url}/meshes/mine", params={"filename": "a.tide"}, content=real_stream(1), headers=WRITER
        ).json()
        assert reading.wait(20)
        monkeypatch.setattr(store, "head", head)
        second = httpx.put(
            f"{server.url}/meshes/mine", params={"filename": "a.tide"}, content=real_stream(2), headers=WRITER
        ).json()
        go.set()
        assert finished(server.url, second["id"])["state"] == "done"
        assert job_now(server, first)["error"] == "a later upload under the same id replaced it"
    assert not [record for record in caplog.records if record.levelname in {"WARNING", "ERROR"}]


@pytest.mark.usefixtures("faulty")
def test_a_later_upload_under_the_same_id_ends_the_earlier_job(start: Start) -> None:
    with start(job_lost_seconds=1, job_processes=2) as server:
        url = f"{server.url}/meshes/mine"
        first = httpx.put(url, params={"filename": "a.obj"}, content=solid(1), headers=WRITER).json()
        assert finished(server.url, first["id"])["state"] == "done"
        slow = post(server.url, "sleep.obj", solid(2)).json()
        until_stage(server, slow, "sleep")
        answer = httpx.put(
            f"{server.url}/meshes/sleep", params={"filename": "b.tide"}, content=real_stream(2), headers=WRITER
        )
        assert finished(server.url, answer.json()["id"])["state"] == "done"
        ended = job_now(server, slow)
        assert (ended["state"], ended["error"]) == ("failed", "a later upload under the same id replaced it")
        assert httpx.get(f"{server.url}/meshes/sleep.tide").content == real_stream(2)
        runner = server.app.parts.jobs
        until(lambda: not runner._attempts)


def test_a_job_that_has_just_been_published_is_not_taken_for_lost(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[str] = []

    async def slow(*arguments: Any, **more: Any) -> None:
        await publish(*arguments, **more)
        await asyncio.sleep(0.5)  # several heartbeats
        ended.append("well")

    monkeypatch.setattr("meshtide_server.encoding.attempt.publish", slow)
    with start(job_lost_seconds=1) as server:
        assert outcome(server, "small.tide", real_stream(1))["state"] == "done"
        until(lambda: ended == ["well"], 5)


def test_a_fault_of_the_server_costs_one_job(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshtide_server.encoding.attempt.CHUNK", 7)  # an upload comes from the store in pieces
    work = JobAttempt._encoded

    async def faulty(self: JobAttempt, encoder: Any, source: Path) -> Path:
        if self._job.mesh_id == "odd":
            raise KeyError("a fault")
        return await work(self, encoder, source)

    monkeypatch.setattr(JobAttempt, "_encoded", faulty)
    with start() as server:
        odd = outcome(server, "odd.obj", TETRAHEDRON.encode())
        assert (odd["state"], odd["attempts"], odd["error"]) == ("failed", 2, "internal error: KeyError")
        assert outcome(server, "good.obj", TETRAHEDRON.replace("1", "2", 1).encode())["state"] == "done"


def test_a_timeout_of_the_store_is_a_fault_of_the_server_and_not_of_the_upload(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    with start() as server:
        store = server.app.parts.library.published.store
        get_range = store.get_range

        async def slow(*_: object) -> bytes:
            raise TimeoutError

        monkeypatch.setattr(store, "get_range", slow)
        job = outcome(server, "small.tide", real_stream(1))
        assert (job["state"], job["attempts"]) == ("failed", 2)
        assert job["error"] == "a fault of the server (TimeoutError); its operator finds more in the log"
        monkeypatch.setattr(store, "get_range", get_range)
        assert outcome(server, "other.tide", real_stream(2))["state"] == "done"


def test_jobs_wait_for_a_store_that_is_away(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshtide_server.encoding.attempt.REST_SECONDS", 0.05)
    with start(job_processes=1) as server:
        store = server.app.parts.library.published.store
        head = store.head
        asked: list[str] = []
        job = {}

        async def away(key: str) -> Any:
            if not job:
                return await head(key)
            asked.append(key)
            raise StoreError("it is away")

        server.loop.call_soon_threadsafe(server.app.parts.draining.set)  # not begun before all is in place
        time.sleep(0.1)
        monkeypatch.setattr(store, "head", away)
        job.update(post(server.url, "small.tide", real_stream(1)).json())
        server.loop.call_soon_threadsafe(server.app.parts.draining.clear)
        until(lambda: len(asked) > 8)  # more than two attempts would ask
        assert job_now(server, job)["state"] in {"queued", "running"}
        monkeypatch.setattr(store, "head", head)
        done = finished(server.url, job["id"])
        assert (done["state"], done["attempts"]) == ("done", 1)
