"""Jobs that go wrong: too slow, killed, or hostile; others go on beside them."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from .conftest import TETRAHEDRON, LiveServer, running
from .test_routes_ingest import finished, post, settings_for

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from pathlib import Path


@pytest.fixture
def start(folder: Path, tmp_path: Path) -> Callable[..., AbstractContextManager[LiveServer]]:
    """Starts a server that takes uploads."""
    return lambda **more: running(settings_for(folder, tmp_path / "data", **more))


def outcome(server: LiveServer, filename: str, data: bytes) -> dict[str, Any]:
    answer = post(server.url, filename, data)
    assert answer.status_code == 202
    return finished(server.url, answer.json()["id"])


def test_a_job_that_takes_too_long_fails_at_once(start: Callable[..., AbstractContextManager[LiveServer]]) -> None:
    with start(job_seconds=0.05) as server:
        job = outcome(server, "slow.obj", TETRAHEDRON.encode())
        assert (job["state"], job["attempts"]) == ("failed", 1)
        assert "took longer than 0.05 s" in job["error"]
        assert not server.app.state.jobs._encoder.running


def test_a_job_that_brings_its_process_down_is_tried_twice_and_disturbs_no_other(
    start: Callable[..., AbstractContextManager[LiveServer]],
) -> None:
    with start() as server:
        runner = server.app.state.jobs
        note = runner._advance

        def advance(stage: str, fraction: float) -> None:
            if runner._job.mesh_id == "deadly" and runner._encoder.running:
                os.kill(runner._encoder._process.pid, signal.SIGKILL)
            note(stage, fraction)

        runner._advance = advance
        deadly = post(server.url, "deadly.obj", TETRAHEDRON.encode()).json()
        good = outcome(server, "good.obj", TETRAHEDRON.replace("1", "2", 1).encode())
        assert (good["state"], good["attempts"]) == ("done", 1)
        job = finished(server.url, deadly["id"])
        assert (job["state"], job["attempts"]) == ("failed", 2)
        assert "killed by SIGKILL" in job["error"]
        assert httpx.get(f"{server.url}/meshes/good").status_code == 200


def test_a_hostile_file_is_refused_once_with_its_reason(
    start: Callable[..., AbstractContextManager[LiveServer]],
) -> None:
    with start(max_vertices=3) as server:
        job = outcome(server, "four.obj", TETRAHEDRON.encode())
        assert (job["state"], job["attempts"]) == ("failed", 1)
        assert "claims 4 vertices; this server takes 3 (MESHTIDE_MAX_VERTICES)" in job["error"]


def test_a_fault_of_the_server_costs_one_job(
    start: Callable[..., AbstractContextManager[LiveServer]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("meshtide_server.job_runner.CHUNK", 7)  # an upload comes from the store in pieces
    with start() as server:
        runner = server.app.state.jobs
        work = runner._encoded

        async def faulty(job: Any, source: Path) -> Path:
            if job.mesh_id == "odd":
                raise KeyError("a fault")
            result: Path = await work(job, source)
            return result

        runner._encoded = faulty
        odd = outcome(server, "odd.obj", TETRAHEDRON.encode())
        assert (odd["state"], odd["attempts"], odd["error"]) == ("failed", 2, "internal error: KeyError")
        assert outcome(server, "good.obj", TETRAHEDRON.replace("1", "2", 1).encode())["state"] == "done"
