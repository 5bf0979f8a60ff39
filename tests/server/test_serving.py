import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from meshtide_codec.stream.messages import (
    PROTOCOL_VERSION,
    Credit,
    Done,
    Error,
    Hello,
    decode_message,
    encode_message,
)
from meshtide_server.app import create_app
from meshtide_server.serving import AddressError, bind, configuration, is_announcement, url_of
from meshtide_server.settings import Settings

from .made_streams import make_stream

LARGE_PAYLOADS = (3000, 500, 600_000, 700_000, 50, 40_000_000)


@dataclass
class ServerProcess:
    """`python -m meshtide_server` in a process of its own."""

    process: subprocess.Popen[str]
    url: str

    def end(self, number: int) -> tuple[int, str, float]:
        """Send a signal; returns the exit code, what was logged, and how long it took."""
        self.process.send_signal(number)
        return self.ended()

    def ended(self) -> tuple[int, str, float]:
        """Wait for the end; returns the same."""
        started = time.monotonic()
        _, log = self.process.communicate(timeout=20)
        return self.process.returncode, log, time.monotonic() - started


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "meshtide_server", *map(str, arguments)]


@pytest.fixture
def start() -> Iterator[Callable[..., ServerProcess]]:
    """Starts servers on free ports; none outlives the test."""
    processes: list[subprocess.Popen[str]] = []

    def begin(*arguments: object) -> ServerProcess:
        process = subprocess.Popen(
            command(*arguments, "--port", 0, "--announce"),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "COLUMNS": "200"},
        )
        processes.append(process)
        assert process.stdout is not None
        return ServerProcess(process, json.loads(process.stdout.readline())["url"])

    yield begin
    for process in processes:
        with suppress(ProcessLookupError):
            process.kill()
        process.communicate()


def wait_for(url: str, status: str, seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while any(mesh["status"] != status for mesh in httpx.get(f"{url}/meshes").json()):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_sigterm_in_the_middle_of_a_stream(start: Callable[..., ServerProcess], folder: Path) -> None:
    (folder / "large.tide").write_bytes(make_stream(1, LARGE_PAYLOADS))
    server = start(folder, "--drain-timeout", 0.2)
    wait_for(server.url, "ready")
    with connect(server.url.replace("http", "ws") + "/meshes/large/stream", compression=None) as connection:
        connection.send(encode_message(Hello(PROTOCOL_VERSION, "large", b"", (), None, None, None, credit=10_000_000)))
        connection.recv(5)
        server.process.send_signal(signal.SIGTERM)
        last = None
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                last = decode_message(connection.recv(10))
    assert isinstance(last, Error)
    assert last.code == "shutting-down"
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1012
    assert "shutting down" in closed.value.rcvd.reason
    code, log, seconds = server.ended()
    assert code == 0
    assert seconds < 15  # not the 30 that streams would have had
    assert "Traceback" not in log


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_each_event_is_one_line_and_so_is_the_end(
    start: Callable[..., ServerProcess], folder: Path, number: signal.Signals
) -> None:
    server = start(folder)
    wait_for(server.url, "ready")
    code, log, seconds = server.end(number)
    assert code == 0
    assert seconds < 3
    messages = [line.split(maxsplit=2)[2] for line in log.splitlines()]
    assert sorted(messages) == sorted(
        [
            f"listening on {server.url}",
            f"small is ready: 1600 vertices, 3196 faces, 3 levels, {len(make_stream())} bytes",
            "shutting down",
        ]
    )


def test_sigterm_during_a_slow_download(start: Callable[..., ServerProcess], folder: Path) -> None:
    (folder / "large.tide").write_bytes(make_stream(1, LARGE_PAYLOADS))
    server = start(folder, "--drain-timeout", 0.2)
    wait_for(server.url, "ready")
    with httpx.stream("GET", f"{server.url}/meshes/large.tide") as response:
        next(response.iter_raw())
        code, log, seconds = server.end(signal.SIGTERM)
    assert code == 0
    assert seconds < 8
    assert "Traceback" not in log


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
def test_sigterm_while_a_mesh_is_encoded_leaves_no_process(start: Callable[..., ServerProcess]) -> None:
    server = start("--samples")
    pid = server.process.pid
    children: list[int] = []
    deadline = time.monotonic() + 10
    while not children and time.monotonic() < deadline:
        children = [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    assert children
    assert httpx.get(f"{server.url}/healthz").json()["meshes"]["encoding"] > 0
    code, log, seconds = server.end(signal.SIGTERM)
    assert code == 0
    assert seconds < 15  # not the 30 that streams would have had
    assert "Traceback" not in log
    for child in children:
        assert not Path(f"/proc/{child}").exists()


def test_a_signal_right_after_the_start_is_heeded(start: Callable[..., ServerProcess]) -> None:
    code, log, _ = start("--samples").end(signal.SIGTERM)
    assert code == 0
    assert "Traceback" not in log


def test_samples_are_encoded_and_served(start: Callable[..., ServerProcess], private_cache: Path) -> None:
    server = start("--samples")
    assert httpx.get(f"{server.url}/healthz").json()["status"] == "ok"
    wait_for(server.url, "ready", 180)
    meshes = httpx.get(f"{server.url}/meshes").json()
    assert {mesh["id"]: mesh["vertices"] for mesh in meshes} == {"spot": 2930, "stanford-bunny": 34834}
    for mesh in meshes:
        assert len(httpx.get(f"{server.url}/meshes/{mesh['id']}.tide").content) == mesh["bytes"]
    assert len(list(private_cache.rglob("*.tide"))) == 2


def test_ready_file_lasts_as_long_as_the_server(
    start: Callable[..., ServerProcess], folder: Path, tmp_path: Path
) -> None:
    path = tmp_path / "ready.json"
    server = start(folder, "--ready-file", path)
    assert json.loads(path.read_text()) == {"url": server.url}
    assert server.end(signal.SIGTERM)[0] == 0
    assert not path.exists()


def test_a_ready_file_takes_the_place_of_nothing_else(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "notes.json"
    for content in ("my notes", '{"url": "x", "mine": 1}', "[1]", "7"):
        path.write_text(content)
        assert not is_announcement(path)
    done = subprocess.run(
        command(folder, "--port", 0, "--ready-file", path), capture_output=True, text=True, check=False, timeout=30
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"meshtide: {path} is there already")
    assert path.read_text() == "7"
    for content in ("", '{"url": "http://127.0.0.1:8000"}\n'):
        path.write_text(content)
        assert is_announcement(path)
    assert not is_announcement(tmp_path)


def test_a_port_that_is_taken_is_one_line_and_code_5(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = subprocess.run(command(folder, "--port", port), capture_output=True, text=True, check=False, timeout=30)
    assert done.returncode == 5
    assert re.fullmatch(
        rf"meshtide: cannot listen on 127\.0\.0\.1 port {port}: Address already in use; .*\n", done.stderr
    )


def test_bind_refuses_addresses_that_are_not_there() -> None:
    with pytest.raises(AddressError, match="choose others with --host and --port"):
        bind("192.0.2.1", 0)
    with pytest.raises(AddressError, match=r"cannot listen on a\.\.b port 80"):
        bind("a..b", 80)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0"])  # noqa: S104 - for a moment, on a free port
def test_url_is_one_that_this_machine_reaches(host: str) -> None:
    with bind(host, 0) as listener:
        port = listener.getsockname()[1]
        assert url_of(listener) in (f"http://127.0.0.1:{port}", f"http://[::1]:{port}")


def test_frames_are_limited_and_never_compressed(folder: Path) -> None:
    settings = Settings(directory=folder, max_message=2048, stall_timeout=120)
    config = configuration(create_app(settings), settings)
    assert (config.ws_max_size, config.ws_per_message_deflate, config.access_log) == (2048, False, False)
    assert config.ws_ping_timeout == 120


def hold(connection: ClientConnection, mesh: str, credit: int = 10_000) -> None:
    """Begin a stream that waits for credit after so many bytes."""
    connection.send(encode_message(Hello(PROTOCOL_VERSION, mesh, b"", (), None, None, None, credit)))
    connection.recv(5)


def until_not_ready(url: str) -> httpx.Response:
    deadline = time.monotonic() + 5
    while (answer := httpx.get(f"{url}/readyz")).status_code == 200:
        assert time.monotonic() < deadline
    return answer


def test_draining_lets_streams_end_and_takes_no_new_ones(start: Callable[..., ServerProcess], folder: Path) -> None:
    server = start(folder, "--drain-timeout", 30)
    wait_for(server.url, "ready")
    address = server.url.replace("http", "ws") + "/meshes/small/stream"
    with connect(address, compression=None) as running:
        hold(running, "small", 100)
        server.process.send_signal(signal.SIGTERM)
        answer = until_not_ready(server.url)
        assert (answer.status_code, answer.json()["parts"]["server"]) == (503, "it is shutting down")
        assert httpx.get(f"{server.url}/healthz").status_code == 200
        assert "meshtide_draining 1.0" in httpx.get(f"{server.url}/metrics").text
        with connect(address, compression=None) as late:
            refusal = decode_message(late.recv(5))
            with pytest.raises(ConnectionClosed) as refused:
                late.recv(5)
        assert isinstance(refusal, Error)
        assert refusal.code == "shutting-down"
        assert refused.value.rcvd is not None
        assert refused.value.rcvd.code == 1012
        running.send(encode_message(Credit(1 << 20)))
        with pytest.raises(ConnectionClosed) as ended:
            while True:
                last = decode_message(running.recv(5))
    assert isinstance(last, Done)
    assert ended.value.rcvd is not None
    assert ended.value.rcvd.code == 1000
    code, log, seconds = server.ended()
    assert code == 0
    assert seconds < 15  # not the 30 that streams would have had
    # The stream, and perhaps the request that asks whether the server is still ready.
    assert re.search("draining: [12] streams and requests have 30 s to end", log)


@pytest.mark.parametrize("second", [signal.SIGTERM, signal.SIGINT])
def test_a_second_signal_ends_it_at_once(
    start: Callable[..., ServerProcess], folder: Path, second: signal.Signals
) -> None:
    server = start(folder, "--drain-timeout", 60)
    wait_for(server.url, "ready")
    with connect(server.url.replace("http", "ws") + "/meshes/small/stream", compression=None) as running:
        hold(running, "small", 100)
        server.process.send_signal(signal.SIGTERM)
        until_not_ready(server.url)
        code, log, seconds = server.end(second)
    assert code == 0
    assert seconds < 15  # not the 30 that streams would have had
    assert "Traceback" not in log


def test_the_log_as_json_is_one_object_a_line(start: Callable[..., ServerProcess], folder: Path) -> None:
    server = start(folder, "--log-format", "json", "--log-level", "debug")
    wait_for(server.url, "ready")
    headers = {"X-Request-ID": "chosen-3", "Authorization": "Bearer s3cr3t"}
    httpx.get(f"{server.url}/meshes/small?ticket=s3cr3t", headers=headers)
    with connect(
        server.url.replace("http", "ws") + "/meshes/small/stream?ticket=s3cr3t", additional_headers=headers
    ) as connection:
        hold(connection, "small")
    code, log, _ = server.end(signal.SIGTERM)
    assert code == 0
    assert "s3cr3t" not in log
    entries = [json.loads(line) for line in log.splitlines()]
    assert all({"time", "level", "logger", "message"} <= entry.keys() for entry in entries)
    mine = [entry for entry in entries if entry.get("request_id") == "chosen-3" and "status" in entry]
    assert [(entry["path"], entry["status"]) for entry in mine] == [
        ("/meshes/small", 200),
        ("/meshes/small/stream", 101),
    ]
