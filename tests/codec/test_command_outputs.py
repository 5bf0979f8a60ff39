"""What `encode` and `decode` write over, and what not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshtide_codec.decoder import decode
from meshtide_codec.errors import OptionError, StreamError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from click.testing import Result

QUICK = ("--profile", "classic", "--bits", 8, "--coarsest-vertices", 12)


@pytest.fixture(name="mesh_file")
def _mesh_file(tmp_path: Path) -> Path:
    path = tmp_path / "real.ply"
    save_mesh(grid(8), path)
    return path


def encode(*arguments: object) -> Result:
    return meshtide("encode", *arguments, *QUICK)


def refused(result: Result) -> str:
    assert isinstance(result.exception, OptionError), result.output
    return str(result.exception)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_encode_and_decode_by_their_default_names_keep_the_mesh(mesh_file: Path) -> None:
    original = mesh_file.read_bytes()
    assert encode(mesh_file).exit_code == 0
    assert meshtide("decode", mesh_file.with_suffix(".tide")).exit_code == 0
    assert mesh_file.read_bytes() == original
    assert set(contents(mesh_file.parent)) == {"real.ply", "real.tide", "real.decoded.ply"}


def test_a_stream_is_made_anew_of_its_own_mesh_only(mesh_file: Path) -> None:
    stream = mesh_file.with_suffix(".tide")
    assert encode(mesh_file).exit_code == 0
    first = stream.read_bytes()
    assert meshtide("encode", mesh_file, "--profile", "classic", "--bits", 10).exit_code == 0
    second = stream.read_bytes()
    assert second != first
    other = mesh_file.parent / "other"
    other.mkdir()
    save_mesh(grid(5), other / "real.ply")
    for output in (stream, mesh_file.parent / "other" / ".." / "real.tide"):
        assert "not a whole stream of this very mesh" in refused(encode(other / "real.ply", "-o", output))
    assert stream.read_bytes() == second
    assert encode(other / "real.ply", "-o", stream, "--overwrite").exit_code == 0
    assert stream.read_bytes() not in {first, second}


def test_a_stream_on_a_chosen_grid_is_made_anew_of_its_own_mesh_only(mesh_file: Path) -> None:
    chosen = ("--origin", "-9,-9,-9", "--extent", 20)
    stepped = ("--profile", "classic", "--step", 0.1)
    stream = mesh_file.with_name("tile.tide")
    for output in ((), ("-o", stream)):
        assert encode(mesh_file, *output, *chosen).exit_code == 0
        assert encode(mesh_file, *output, *chosen).exit_code == 0
        assert meshtide("encode", mesh_file, *output, *stepped).exit_code == 0
    save_mesh(Mesh(grid(8).vertices, grid(8).faces[:-1]), mesh_file)
    assert "not a whole stream of this very mesh" in refused(meshtide("encode", mesh_file, "-o", stream, *stepped))
    assert meshtide("encode", mesh_file, *stepped).exit_code == 0  # worked on: the stream of its name is made anew


def test_two_meshes_with_one_default_name_are_refused(mesh_file: Path) -> None:
    save_mesh(grid(8), mesh_file.with_suffix(".obj"))
    assert encode(mesh_file).exit_code == 0
    before = contents(mesh_file.parent)
    message = refused(encode(mesh_file.with_suffix(".obj")))
    assert "real.ply" in message
    assert "real.obj" in message
    assert contents(mesh_file.parent) == before


@pytest.mark.parametrize("overwrite", [(), ("--overwrite",)])
def test_the_input_is_never_written(mesh_file: Path, overwrite: tuple[str, ...]) -> None:
    encode(mesh_file)
    folder, stream = mesh_file.parent, mesh_file.with_suffix(".tide")
    (folder / "soft.tide").symlink_to(stream)
    (folder / "soft.ply").symlink_to(mesh_file)
    os.link(mesh_file, folder / "hard.ply")
    before = contents(folder)
    for output in (mesh_file, folder / "soft.ply", folder / "hard.ply", folder / ".." / folder.name / "real.ply"):
        assert "is what is read" in refused(encode(mesh_file, "-o", output, *overwrite))
    for output in (stream, folder / "soft.tide"):
        assert "is what is read" in refused(meshtide("decode", stream, "-o", output, *overwrite))
    assert contents(folder) == before


def test_other_files_are_replaced_only_when_it_is_said(mesh_file: Path) -> None:
    stream, decoded = mesh_file.with_suffix(".tide"), mesh_file.with_name("real.decoded.ply")
    stream.write_text("notes on the tide")
    assert "add --overwrite" in refused(encode(mesh_file))
    assert stream.read_text() == "notes on the tide"
    assert encode(mesh_file, "--overwrite").exit_code == 0
    decoded.write_text("a mesh that was worked on")
    assert "add --overwrite" in refused(meshtide("decode", stream))
    assert decoded.read_text() == "a mesh that was worked on"
    assert meshtide("decode", stream, "--overwrite").exit_code == 0
    assert len(load_mesh(decoded).vertices) == 64


def test_places_that_cannot_be_written_are_told_before_the_mesh_is_read(tmp_path: Path) -> None:
    missing = tmp_path / "never-read.ply"
    assert "is a folder" in refused(encode(missing, "-o", tmp_path))
    assert "there is no folder" in refused(encode(missing, "-o", tmp_path / "no" / "a.tide"))
    assert "is a folder" in refused(meshtide("decode", tmp_path / "never-read.tide", "-o", tmp_path))
    nameless = meshtide("decode", tmp_path / "never-read.tide", "-o", tmp_path / "nameless").exception
    assert isinstance(nameless, OptionError)
    foreign = meshtide("decode", tmp_path / "never-read.tide", "-o", tmp_path / "a.xyz").exception
    assert isinstance(foreign, OptionError)
    assert str(foreign).startswith(f"cannot write {tmp_path}/a.xyz: its name must end with one of .obj, .ply, ")
    kind = meshtide("decode", tmp_path / "never-read.tide", "--format", "xyz").exception
    assert isinstance(kind, OptionError)
    assert "xyz is none of the formats obj, ply, " in str(kind)
    assert list(tmp_path.iterdir()) == []


def test_links_are_followed_and_pipes_written_in_place(mesh_file: Path) -> None:
    folder = mesh_file.parent
    (folder / "link.tide").symlink_to("elsewhere.tide")
    assert encode(mesh_file, "-o", folder / "link.tide").exit_code == 0
    assert (folder / "link.tide").is_symlink()
    pipe = folder / "pipe.tide"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    assert encode(mesh_file, "-o", pipe).exit_code == 0
    reader.join(10)
    assert read == [(folder / "elsewhere.tide").read_bytes()]
    assert pipe.is_fifo()


@pytest.mark.parametrize("side", [8, 60])  # less than a pipe holds, and more
def test_a_pipe_is_read_once_and_from_its_start(tmp_path: Path, side: int) -> None:
    save_mesh(grid(side), tmp_path / "real.obj")
    assert encode(tmp_path / "real.obj").exit_code == 0
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    command = [sys.executable, "-m", "meshtide_client.main", "encode", str(pipe), "--format", "obj", "-o", "piped.tide"]
    with subprocess.Popen([*command, *map(str, QUICK)], cwd=tmp_path, stdout=subprocess.DEVNULL) as encoding:
        pipe.write_bytes((tmp_path / "real.obj").read_bytes())
        assert encoding.wait(60) == 0
    assert (tmp_path / "piped.tide").read_bytes() == (tmp_path / "real.tide").read_bytes()


@pytest.mark.parametrize("place", ["-", "/dev/stdout"])
def test_standard_output_holds_the_stream_and_nothing_else(mesh_file: Path, place: str) -> None:
    command = [sys.executable, "-m", "meshtide_client.main"]
    options = [str(option) for option in QUICK]
    encoded = subprocess.run([*command, "encode", mesh_file, "-o", place, *options], capture_output=True, check=True)
    assert len(decode(encoded.stdout).vertices) == 64
    assert b"bits per vertex" in encoded.stderr
    (mesh_file.parent / "real.tide").write_bytes(encoded.stdout)
    decoding = [*command, "decode", "real.tide", "-o", place]
    decoded = subprocess.run(decoding, capture_output=True, check=True, cwd=mesh_file.parent)
    assert decoded.stdout.startswith(b"ply\n")
    assert b"64 vertices" in decoded.stderr
    (mesh_file.parent / "real.tide").unlink()
    assert set(contents(mesh_file.parent)) == {"real.ply"}


def test_a_mesh_goes_to_standard_output_in_the_format_that_is_asked_for(mesh_file: Path) -> None:
    encode(mesh_file)
    stream = mesh_file.with_suffix(".tide")
    plain = meshtide("decode", stream, "-o", "-", "--json")
    assert plain.stdout_bytes.startswith(b"ply\n")
    assert json.loads(plain.stderr)["vertices"] == 64
    formatted = meshtide("decode", stream, "-o", "-", "--format", "obj")
    assert formatted.stdout_bytes.count(b"\nv ") + formatted.stdout_bytes.startswith(b"v ") == 64
    assert "64 vertices" in formatted.stderr
    assert meshtide("decode", stream, "-o", mesh_file.with_name("a.txt"), "--format", "off").exit_code == 0
    assert mesh_file.with_name("a.txt").read_bytes().startswith(b"OFF")


@pytest.mark.parametrize("name", ["[bold]x[red]", "caf\udce9", "a\nb", "\x1b[31mred", "\u202eylp"])
def test_any_name_of_a_file_works_and_is_shown_escaped(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.ply"
    save_mesh(grid(8), path)
    result = encode(path)
    assert result.exit_code == 0, result.output
    last = result.stdout.splitlines()[-1]
    assert "\x1b" not in last
    assert "\u202e" not in last
    assert ".tide: " in last
    answer = json.loads(meshtide("decode", path.with_suffix(".tide"), "--json").stdout)
    answer["output"].encode("utf-8")
    assert path.with_suffix(".decoded.ply").exists()


def test_a_path_to_a_file_that_is_called_hyphen_is_a_file(mesh_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(mesh_file.parent)
    assert encode(mesh_file, "-o", "./-").exit_code == 0
    stream = Path("./-").read_bytes()
    assert len(decode(stream).vertices) == 64
    Path("./-").write_bytes(mesh_file.read_bytes())
    assert encode("./-", "--format", "ply").exit_code == 0  # beside it, and not from standard input
    assert Path("-.tide").read_bytes() == stream
    assert meshtide("decode", "./-.tide", "-o", ".//-", "--format", "obj", "--overwrite").exit_code == 0
    assert len(load_mesh(Path.cwd() / "-", kind="obj").vertices) == 64


def test_a_file_beside_a_gltf_file_is_not_replaced_and_told_before_anything_is_written(tmp_path: Path) -> None:
    save_mesh(grid(4), tmp_path / "patch.ply")
    assert meshtide("encode", tmp_path / "patch.ply").exit_code == 0
    (tmp_path / "m.bin").write_text("mine")
    refused = meshtide("decode", tmp_path / "patch.tide", "-o", tmp_path / "m.gltf")
    assert isinstance(refused.exception, OptionError)
    assert "m.bin is there already" in str(refused.exception)
    assert (tmp_path / "m.bin").read_text() == "mine"
    assert not (tmp_path / "m.gltf").exists()


def test_the_default_name_of_a_decoded_mesh_ends_as_its_format_asks(tmp_path: Path) -> None:
    save_mesh(grid(4), tmp_path / "patch.ply")
    assert meshtide("encode", tmp_path / "patch.ply").exit_code == 0
    assert meshtide("decode", tmp_path / "patch.tide", "--format", "obj").exit_code == 0
    assert (tmp_path / "patch.decoded.obj").read_bytes().startswith(b"#")
    assert not (tmp_path / "patch.decoded.ply").exists()


def test_a_damaged_stream_tells_how_to_have_what_is_whole(tmp_path: Path) -> None:
    save_mesh(grid(4), tmp_path / "patch.ply")
    assert meshtide("encode", tmp_path / "patch.ply").exit_code == 0
    (tmp_path / "cut.tide").write_bytes((tmp_path / "patch.tide").read_bytes()[:-3])
    cut = meshtide("decode", tmp_path / "cut.tide")
    assert isinstance(cut.exception, StreamError)
    assert "--partial" in cut.stderr


def test_streams_are_read_from_pipes(tmp_path: Path) -> None:
    save_mesh(grid(4), tmp_path / "patch.ply")
    assert meshtide("encode", tmp_path / "patch.ply").exit_code == 0
    whole = (tmp_path / "patch.tide").read_bytes()
    assert json.loads(meshtide("info", "-", "--json", given=whole).stdout)["bytes"] == len(whole)
    assert meshtide("decode", "-", "-o", tmp_path / "piped.ply", given=whole).exit_code == 0
    assert load_mesh(tmp_path / "piped.ply").faces.shape == grid(4).faces.shape
