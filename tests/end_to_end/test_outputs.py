"""What commands leave on the disk and on the terminal, with real processes."""

from __future__ import annotations

import fcntl
import json
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from hosted_folder import serving
from meshtide_codec.command_line import ExitCode
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_codec.testing import grid

MESH = "patch"
ODD_NAMES = (b"caf\xe9.tide", b"a\nb.tide", b"\x1b[31mred.tide", "\u202exe.tide".encode(), b"[bold]x[red].tide")


def test_of_four_fetches_into_one_file_one_wins_and_the_others_say_so(server: Any, meshtide: Any) -> None:
    started = [meshtide.start("fetch", server.mesh_url, "-o", "one.ply") for _ in range(4)]
    ended = [(process, *process.communicate(timeout=120)) for process in started]
    won = [output for process, output, _ in ended if process.returncode == ExitCode.OK]
    lost = [(process.returncode, errors) for process, _, errors in ended if process.returncode != ExitCode.OK]
    assert len(won) == 1
    for code, errors in lost:
        assert code in {ExitCode.USAGE, ExitCode.NETWORK, ExitCode.DISK}
        assert errors.startswith("meshtide: ")
        assert any(words in errors for words in ("another process", "is there already", "in the meantime"))
        assert len(errors.splitlines()) == 1
    assert meshtide.files == {"one.ply"}
    assert len(load_mesh(meshtide.folder / "one.ply").vertices) == len(server.encoded.quantized.positions)


def test_a_fetch_replaces_a_file_only_when_it_is_said(server: Any, meshtide: Any) -> None:
    output = meshtide.folder / f"{MESH}.ply"
    output.write_text("mine")
    for arguments in ((), ("-o", output), ("--keep-levels", "."), ("-o", "new.ply", "--stream-file", output)):
        (meshtide.folder / f"{MESH}-level-1.ply").write_text("mine as well")
        done = meshtide("fetch", server.mesh_url, *arguments)
        assert done.returncode == ExitCode.USAGE
        assert "--overwrite" in done.stderr
        assert output.read_text() == "mine"
    assert meshtide.files == {f"{MESH}.ply", f"{MESH}-level-1.ply"}
    assert meshtide("fetch", server.mesh_url, "--overwrite").returncode == ExitCode.OK
    assert len(load_mesh(output).vertices) > 0


def test_the_reader_of_a_pipe_may_go_early(server: Any, meshtide: Any) -> None:
    (meshtide.folder / "patch.tide").write_bytes(server.whole)
    for arguments in (["--help"], ["encode", "--help"], ["info", "patch.tide"], ["meshes", server.url, "--json"]):
        read, write = os.pipe()
        os.close(read)
        process = subprocess.Popen(
            [sys.executable, "-m", "meshtide_client.main", *arguments],
            cwd=meshtide.folder,
            stdout=write,
            stderr=subprocess.PIPE,
            text=True,
        )
        os.close(write)
        _, errors = process.communicate(timeout=60)
        assert (process.returncode, errors) == (ExitCode.OK, ""), arguments


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_an_encoding_that_is_ended_leaves_nothing(meshtide: Any, number: signal.Signals) -> None:
    save_mesh(grid(40), meshtide.folder / "patch.ply")
    pipe = meshtide.folder / "pipe.tide"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.fcntl(reader, fcntl.F_SETPIPE_SZ, 4096)  # less than the stream: the command waits until it is read
    process = meshtide.start("encode", "patch.ply", "-o", "pipe.tide", "--profile", "classic", "--bits", "20")
    assert select.select([reader], [], [], 120)[0]
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    os.close(reader)
    assert process.returncode == 128 + number
    assert errors.count("\n") == 1
    assert meshtide.files == {"patch.ply", "pipe.tide"}


def test_no_name_hides_the_other_meshes(server: Any, meshtide: Any) -> None:
    folder = meshtide.folder / "meshes"
    folder.mkdir()
    for name in (*ODD_NAMES, b"good.tide"):
        Path(os.fsdecode(os.fsencode(folder) + b"/" + name)).write_bytes(server.whole)
    Path(os.fsdecode(os.fsencode(folder) + b"/bad\xff.ply")).write_text("no mesh")
    save_mesh(grid(6), Path(os.fsdecode(os.fsencode(folder) + b"/small\xff.ply")))
    with serving(folder) as url:
        deadline = time.monotonic() + 120
        while True:
            done = meshtide("meshes", url, "--json")
            assert done.returncode == ExitCode.OK, done.stderr
            rows = json.loads(done.stdout)["meshes"]
            if all(row["status"] != "encoding" for row in rows) or time.monotonic() > deadline:
                break
            time.sleep(0.2)
        states = {row["name"]: row["status"] for row in rows}
        assert len(rows) == len(ODD_NAMES) + 3
        assert states["good.tide"] == "ready"
        assert states[r"caf\udce9.tide"] == "ready"
        assert states[r"small\udcff.ply"] == "ready"
        assert states[r"bad\udcff.ply"] == "failed"
        assert all(name.isprintable() for name in states)
        listed = meshtide("meshes", url)
        assert listed.returncode == ExitCode.OK
        assert "good" in listed.stdout
        exported = meshtide("export", url, "--static", "site")
        assert exported.returncode == ExitCode.OK, exported.stderr
    assert len(json.loads((meshtide.folder / "site" / "meshes" / "index.json").read_text("utf-8"))) == len(rows) - 1


def test_files_of_any_name_are_ingested(server: Any, meshtide: Any) -> None:
    folder = meshtide.folder / "files"
    folder.mkdir()
    for number, name in enumerate((*ODD_NAMES, b"good.tide")):
        content = server.whole if name.startswith(b"good") else b"no stream %d" % number
        Path(os.fsdecode(os.fsencode(folder) + b"/" + name)).write_bytes(content)
    done = meshtide("ingest", folder, "--data", "data", "--json")
    assert done.returncode == ExitCode.FAILURE
    answer = json.loads(done.stdout)
    assert (answer["done"], answer["failed"]) == (1, len(ODD_NAMES))
    assert all(row["error"].encode("utf-8") for row in answer["files"] if row["state"] == "failed")
    shown = meshtide("ingest", folder, "--data", "data")
    assert "\x1b[31mred" not in shown.stderr
    assert "\u202e" not in shown.stderr
