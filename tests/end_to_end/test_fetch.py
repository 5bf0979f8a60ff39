"""`meshtide fetch` against a real server, over a real socket."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from websockets.sync.server import serve

from meshtide_codec.command_line import ExitCode
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.stream.container import preamble, read_available

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MESH = "patch"
PARTIAL = f"{MESH}.ply.partial.tide"


def fetched(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """What a successful fetch with --json says."""
    assert done.returncode == ExitCode.OK, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_mesh_arrives_exactly(server: Any, meshtide: Any) -> None:
    done = meshtide("fetch", server.mesh_url)
    assert done.returncode == ExitCode.OK
    expected = server.encoded.quantized.mesh()
    loaded = load_mesh(meshtide.folder / f"{MESH}.ply")
    np.testing.assert_allclose(loaded.vertices, expected.vertices, rtol=1e-6)
    np.testing.assert_array_equal(loaded.faces, expected.faces)
    assert f"{MESH}.ply: level 0, {len(expected.vertices)} vertices, {len(expected.faces)} faces" in done.stdout
    assert f"{len(server.whole)} bytes in" in done.stdout
    assert done.stderr == ""
    assert meshtide.files == {f"{MESH}.ply"}


def test_every_bound_is_kept(server: Any, meshtide: Any) -> None:
    levels = server.encoded.header.levels
    start = len(preamble(server.encoded.header.to_bytes()))
    row = levels[1]
    size = start + server.encoded.header.level_bytes(row)
    bounds = (("--until-level", row.level), ("--max-error", row.rms), ("--max-bytes", size))
    for option, value in bounds:
        options = ("-o", "coarse.obj", "--overwrite", "--json")
        answer = fetched(meshtide("fetch", server.mesh_url, option, str(value), *options))
        assert (answer["level"], answer["size"], answer["complete"]) == (row.level, size, False)
        assert (answer["vertices"], answer["faces"], answer["rms"]) == (row.vertices, row.faces, row.rms)
        assert [level["level"] for level in answer["levels"]] == [levels[0].level, row.level]
        assert len(load_mesh(meshtide.folder / "coarse.obj").faces) == row.faces


def test_levels_and_stream_can_be_kept(server: Any, meshtide: Any) -> None:
    answer = fetched(
        meshtide("fetch", server.mesh_url, "--keep-levels", "levels", "--stream-file", "all.tide", "--json")
    )
    assert answer["stream_file"] == "all.tide"
    assert (meshtide.folder / "all.tide").read_bytes() == server.whole
    kept = {path.name for path in (meshtide.folder / "levels").iterdir()}
    assert kept == {f"{MESH}-level-{row.level}.ply" for row in server.encoded.header.levels}


def test_a_server_that_is_killed_costs_no_packet_twice(
    start_server: Callable[[], Any], relay: Callable[..., Any], meshtide: Any
) -> None:
    output = meshtide.folder / f"{MESH}.ply"
    output.write_text("what was here before")
    with start_server() as first:
        link = relay(first.url, len(first.whole) // 2)
        process = meshtide.start("fetch", f"{link.url}/meshes/{MESH}", "--retries", "1", "--overwrite")
        assert link.full.wait(60.0)
        first.process.send_signal(signal.SIGKILL)
        first.process.wait()
        link.cut.set()
        _, errors = process.communicate(timeout=60)
    assert process.returncode == ExitCode.NETWORK
    assert "Traceback" not in errors
    assert "trying again" in errors
    assert "is complete" in errors.splitlines()[-1]
    assert PARTIAL in errors.splitlines()[-1]
    assert output.read_text() == "what was here before"

    partial = meshtide.folder / PARTIAL
    _, packets, _ = read_available(partial.read_bytes())
    held = partial.stat().st_size
    assert 0 < len(packets) < len(first.encoded.header.packets)
    with start_server() as second:
        answer = fetched(meshtide("fetch", second.mesh_url, "--overwrite", "--json"))
    assert answer["received_bytes"] == len(second.whole) - held
    assert answer["size"] == len(second.whole)
    np.testing.assert_array_equal(load_mesh(output).faces, second.encoded.quantized.mesh().faces)
    assert meshtide.files == {f"{MESH}.ply"}


def test_a_connection_that_breaks_is_opened_again(server: Any, relay: Callable[..., Any], meshtide: Any) -> None:
    link = relay(server.url, len(server.whole) * 2 // 3)
    link.cut.set()
    done = meshtide("fetch", f"{link.url}/meshes/{MESH}", "--json")
    answer = fetched(done)
    assert "trying again" in done.stderr
    assert len(server.whole) - len(preamble(b"")) <= answer["received_bytes"] < len(server.whole) * 3 // 2


@pytest.mark.parametrize(
    ("number", "last"), [(signal.SIGINT, "meshtide: interrupted"), (signal.SIGTERM, "meshtide: ended by SIGTERM")]
)
def test_a_signal_keeps_what_has_arrived(server: Any, meshtide: Any, number: signal.Signals, last: str) -> None:
    partial = meshtide.folder / PARTIAL
    process = meshtide.start("fetch", server.mesh_url, "--rate", "1500")
    wait_for(lambda: partial.exists() and partial.stat().st_size > 700, process)
    process.send_signal(number)
    output, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert output == ""
    told, ending = errors.splitlines()
    assert told.startswith("level ")
    assert PARTIAL in told
    assert ending == last
    held = partial.stat().st_size
    answer = fetched(meshtide("fetch", server.mesh_url, "--json"))
    assert answer["received_bytes"] == len(server.whole) - held


def test_a_damaged_partial_file_is_told_and_used_as_far_as_it_is_sound(server: Any, meshtide: Any) -> None:
    damaged = bytearray(server.whole)
    damaged[-1] ^= 1
    (meshtide.folder / PARTIAL).write_bytes(damaged)
    done = meshtide("fetch", server.mesh_url, "--json")
    assert fetched(done)["received_bytes"] == server.encoded.header.packets[-1].length
    assert "is damaged" in done.stderr


def test_a_foreign_stream_file_is_kept(server: Any, meshtide: Any) -> None:
    (meshtide.folder / "notes.tide").write_text("my notes")
    refused = meshtide("fetch", server.mesh_url, "--stream-file", "notes.tide")
    assert refused.returncode == ExitCode.USAGE
    assert "notes.tide is there already" in refused.stderr
    assert meshtide.files == {"notes.tide"}
    done = meshtide("fetch", server.mesh_url, "--stream-file", "notes.tide", "--overwrite")
    assert done.returncode == ExitCode.OK
    assert (meshtide.folder / "notes.tide.old1").read_text() == "my notes"
    assert (meshtide.folder / "notes.tide").read_bytes() == server.whole
    assert "notes.tide.old1" in done.stderr


def test_an_unknown_mesh(server: Any, meshtide: Any) -> None:
    done = meshtide("fetch", f"{server.url}/meshes/teapot")
    assert done.returncode == ExitCode.NETWORK
    assert done.stderr.startswith("meshtide: there is no mesh 'teapot'")
    assert meshtide.files == set()


@pytest.fixture(name="foreign_server")
def _foreign_server() -> Iterator[str]:
    """A websocket server that repeats what it hears."""

    def echo(connection: Any) -> None:
        for message in connection:
            connection.send(message)

    with serve(echo, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()
        thread.join()


def test_a_foreign_websocket_server(foreign_server: str, meshtide: Any) -> None:
    done = meshtide("fetch", f"{foreign_server}/meshes/{MESH}")
    assert done.returncode == ExitCode.NETWORK
    assert len(done.stderr.splitlines()) == 1
    assert "Hello is not expected here" in done.stderr
    assert meshtide.files == set()


def test_a_folder_that_cannot_be_written(server: Any, meshtide: Any) -> None:
    folder = meshtide.folder / "locked"
    folder.mkdir(mode=0o555)
    if os.access(folder, os.W_OK):  # as for root, who may write everywhere but here
        folder = Path("/proc")
    done = meshtide("fetch", server.mesh_url, "-o", folder / "patch.ply")
    assert done.returncode == ExitCode.DISK
    assert str(folder) in done.stderr
    assert "the download was not started" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_disk_that_fills_up_keeps_what_was_complete(server: Any, meshtide: Any) -> None:
    def allow_small_files() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))

    done = meshtide("fetch", server.mesh_url, preexec_fn=allow_small_files)  # a full disk, as far as a program can tell
    assert done.returncode == ExitCode.DISK
    assert PARTIAL in done.stderr
    assert "is complete" in done.stderr
    held = (meshtide.folder / PARTIAL).stat().st_size
    assert held <= 1500
    assert fetched(meshtide("fetch", server.mesh_url, "--json"))["received_bytes"] == len(server.whole) - held


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["fetch", "localhost/meshes/patch"], ExitCode.USAGE, "does not start with http://"),
        (["fetch", "http://127.0.0.1:9/meshes/patch"], ExitCode.NETWORK, "Connection refused"),
        (["fetch", "http://127.0.0.1:9/meshes/patch", "-o", "patch.doc"], ExitCode.USAGE, "must end with one of"),
        (["fetch", "http://127.0.0.1:9/meshes/patch", "--timeout", "0"], ExitCode.USAGE, "timeout"),
        (["fetch", "http://127.0.0.1:9/meshes/patch", "--until-level", "-1"], ExitCode.USAGE, "until-level"),
        (["meshes", "http://127.0.0.1:9"], ExitCode.NETWORK, "cannot reach"),
    ],
)
def test_what_cannot_work_is_told(arguments: list[str], code: ExitCode, message: str, meshtide: Any) -> None:
    done = meshtide(*arguments)
    assert done.returncode == code
    assert message in done.stderr
    assert done.stdout == ""
    assert meshtide.files == set()


def test_a_bound_that_allows_nothing(server: Any, meshtide: Any) -> None:
    done = meshtide("fetch", server.mesh_url, "--max-bytes", "10")
    assert done.returncode == ExitCode.USAGE
    assert "the coarsest takes" in done.stderr


def test_meshes_are_listed(server: Any, meshtide: Any) -> None:
    done = meshtide("meshes", server.url)
    assert done.returncode == ExitCode.OK
    assert MESH in done.stdout
    assert str(server.encoded.header.vertices) in done.stdout
    answer = json.loads(meshtide("meshes", server.url, "--json").stdout)
    assert answer["server"] == server.url
    assert [(mesh["id"], mesh["status"], mesh["bytes"]) for mesh in answer["meshes"]] == [
        (MESH, "ready", len(server.whole))
    ]
