from __future__ import annotations

import gzip
import json
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_client.remote import ingest as ingest_module
from meshtide_client.remote.ingest import LONGEST_PAUSE, POLL_SECONDS, WAITING_SECONDS, ingest
from meshtide_codec.errors import PeerError, TransferError
from scripted_server import Reply, scripted_server

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from meshtide_client.remote.ingest_plan import Ingested

JOB = {"id": "abc", "mesh": "vase", "state": "queued", "stage": "waiting", "progress": 0.0, "error": None}
NOTES = ["normals (3): not kept", "x\x1b[31m"]
NO_MESHES = Reply(200, b"[]")


class Patience:
    """Stands for the event that interrupts: time passes at once, and is counted."""

    def __init__(self) -> None:
        self.pauses: list[float] = []

    def wait(self, seconds: float) -> bool:
        self.pauses.append(seconds)
        return False

    def set(self) -> None:
        """Nobody interrupts."""


@pytest.fixture(name="patience", autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> Patience:
    made = Patience()
    monkeypatch.setattr(ingest_module, "Event", lambda: made)
    return made


@pytest.fixture(name="file")
def _file(tmp_path: Path) -> Path:
    path = tmp_path / "vase.ply"
    path.write_bytes(b"ply\n")
    return path


def answering(file: Path, upload: Reply, job: Callable[[int], Reply]) -> tuple[Any, list[str]]:
    """What becomes of a file at a server that answers so; `job` is told how often it was asked for."""
    asked: list[str] = []

    def answer(method: str, path: str) -> Reply:
        asked.append(f"{method} {path.partition('?')[0]}")
        if method == "GET" and path.startswith("/meshes"):
            return NO_MESHES
        return upload if method == "POST" else job(sum(line.startswith("GET /jobs") for line in asked))

    with scripted_server(answer) as url:
        [result] = ingest([file], url, timeout=5.0)
    return result, asked


def told(**changes: object) -> Reply:
    return Reply(202, json.dumps(JOB | changes).encode())


@pytest.mark.parametrize("coding", ["", "gzip"])
def test_a_job_is_watched_until_it_is_done(coding: str, file: Path) -> None:
    def packed(reply: Reply) -> Reply:
        return Reply(reply.status, gzip.compress(reply.body), {"Content-Encoding": "gzip"}) if coding else reply

    result, asked = answering(
        file, packed(told()), lambda count: packed(told(state="running" if count < 3 else "done", progress=count))
    )
    assert (result.mesh, result.state, result.error) == ("vase", "done", None)
    assert asked[-3:] == ["GET /jobs/abc"] * 3


def test_what_a_job_notes_of_its_file_is_told_within_reason(file: Path) -> None:
    result, _ = answering(file, told(), lambda _: told(state="done", notes=NOTES))
    assert result.notes == tuple(NOTES)
    result, _ = answering(file, told(), lambda _: told(state="done", notes=["x"] * 1000))
    assert len(result.notes) == 100


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"[]",
        b"{}",
        b"[" * 9999,
        json.dumps(JOB | {"id": "../x"}).encode(),
        json.dumps(JOB | {"state": 3}).encode(),
        json.dumps(JOB | {"state": "banana"}).encode(),
        json.dumps(JOB | {"mesh": ["vase"]}).encode(),
        json.dumps(JOB | {"notes": "not kept"}).encode(),
        json.dumps(JOB | {"notes": [1]}).encode(),
        json.dumps(JOB | {"state": "failed", "error": {"a": 1}}).encode(),
    ],
)
def test_answers_that_describe_no_job_end_the_waiting(body: bytes, file: Path) -> None:
    result, asked = answering(file, Reply(202, body), lambda _: told(state="done"))
    assert (result.state, len(asked)) == ("failed", 2)
    assert "does not describe a job" in result.error
    result, asked = answering(file, told(), lambda _: Reply(200, body))
    assert (result.state, len(asked)) == ("failed", 3)
    assert "does not describe a job" in result.error


def test_another_job_is_no_answer(file: Path) -> None:
    result, _ = answering(file, told(), lambda _: told(id="other", state="done"))
    assert "what answers for job abc does not describe a job" in result.error


def test_a_job_that_does_not_come_further_is_given_up(
    file: Path, patience: Patience, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ingest_module, "UNCHANGED_POLLS", 7)
    result, asked = answering(file, told(), lambda count: told(progress=min(count, 3) / 10))
    assert result.state == "failed"
    assert "job abc has not come further" in result.error
    assert sum(line == "GET /jobs/abc" for line in asked) == 3 + 7
    assert set(patience.pauses) == {POLL_SECONDS}
    monkeypatch.setattr(ingest_module, "MOST_POLLS", 20)
    result, asked = answering(file, told(), lambda count: told(stage=str(count)))
    assert "job abc has not come further" in result.error
    assert sum(line == "GET /jobs/abc" for line in asked) == 20


@pytest.mark.parametrize("pause", ["0", "00", "1", "9" * 400, "86400"])
def test_patience_that_is_asked_for_is_bounded(pause: str, file: Path, patience: Patience) -> None:
    refused = Reply(429, b'{"error": "busy", "message": "later"}', {"Retry-After": pause})
    result, asked = answering(file, refused, lambda _: told())
    assert result.error == "later (busy)"
    assert all(POLL_SECONDS <= each <= LONGEST_PAUSE for each in patience.pauses)
    assert WAITING_SECONDS <= sum(patience.pauses) < WAITING_SECONDS + LONGEST_PAUSE
    assert len(asked) == 2 + len(patience.pauses)


@pytest.mark.parametrize("pause", ["soon", "-1", "1.5", "\u00b2", "", "Wed, 21 Oct 2099 07:28:00 GMT"])
def test_patience_that_is_not_told_in_seconds_is_not_had(pause: str, file: Path, patience: Patience) -> None:
    refused = Reply(429, b'{"error": "busy", "message": "later"}', {"Retry-After": pause})
    result, _ = answering(file, refused, lambda _: told())
    assert result.error == "later (busy)"
    assert patience.pauses == []


def test_a_refusal_is_told_in_the_servers_words(file: Path) -> None:
    body = b'{"error": "read-only", "message": "this server takes no \\u001b[31muploads"}'
    result, _ = answering(file, Reply(403, body), lambda _: told())
    assert result.error == "this server takes no \\x1b[31muploads (read-only)"


@pytest.mark.parametrize("parallel", [1, 3])
def test_a_token_that_is_missing_is_told_once_and_ends_the_ingest(tmp_path: Path, parallel: int) -> None:
    files = [tmp_path / f"{number}.ply" for number in range(20)]
    for file in files:
        file.write_bytes(file.name.encode())
    sent: list[str] = []
    shown: list[Ingested] = []

    def answer(method: str, path: str) -> Reply:
        if method == "GET":
            return NO_MESHES
        sent.append(path)
        return Reply(401, b'{"error": "unauthorized", "message": "writing takes a token"}')

    with (
        scripted_server(answer) as url,
        pytest.raises(PeerError, match="set MESHTIDE_TOKEN or --token-file"),
    ):
        ingest(files, url, timeout=5.0, parallel=parallel, progress=shown.append)
    assert 1 <= len(sent) <= parallel
    assert shown == []


def test_a_token_that_ends_while_a_job_is_watched_ends_the_ingest(file: Path) -> None:
    with pytest.raises(PeerError, match="set MESHTIDE_TOKEN or --token-file"):
        answering(file, told(), lambda _: Reply(401, b""))


def test_an_answer_without_end_is_cut_short(file: Path) -> None:
    bomb = gzip.compress(bytes(1 << 26))
    result, _ = answering(file, Reply(202, bomb, {"Content-Encoding": "gzip"}), lambda _: told())
    assert "answers with more than 1048576 bytes" in result.error


def test_a_server_behind_a_prefix_is_asked_there(file: Path) -> None:
    asked: list[str] = []

    def answer(method: str, path: str) -> Reply:
        asked.append(path.partition("?")[0])
        return NO_MESHES if method == "GET" and path.startswith("/tide/meshes") else told(state="done")

    with scripted_server(answer) as url:
        [result] = ingest([file], f"{url}/tide", timeout=5.0)
    assert result.state == "done"
    assert all(path.startswith("/tide/") for path in asked)


def test_a_server_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(TransferError, match="cannot reach"):
        ingest([tmp_path / "a.ply"], "http://127.0.0.1:9")
