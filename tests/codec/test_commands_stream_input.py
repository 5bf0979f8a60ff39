from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshtide_codec.command_line import ExitCode, exit_code
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import encode as encode_mesh
from meshtide_codec.errors import (
    LimitError,
    MeshFileError,
    StreamError,
    TruncatedError,
    VersionError,
)
from meshtide_codec.stream.container import write_container
from meshtide_codec.testing import grid
from streams import MadeUpStream

if TYPE_CHECKING:
    from pathlib import Path


def test_files_that_are_not_what_is_asked_for(stream_file: Path, mesh_file: Path) -> None:
    assert isinstance(meshtide("decode", mesh_file).exception, StreamError)
    assert isinstance(meshtide("encode", stream_file, "-o", stream_file.with_name("x")).exception, MeshFileError)
    assert isinstance(meshtide("encode", stream_file.with_name("nowhere.ply")).exception, FileNotFoundError)


@pytest.mark.parametrize("command", ["decode", "info"])
def test_a_stream_of_an_older_format_is_refused_by_name(command: str, tmp_path: Path) -> None:
    stream = MadeUpStream()
    data = write_container(stream.header, stream.packet_bytes)
    (tmp_path / "a.tide").write_bytes(data[:8] + b"\2\0" + data[10:])
    error = meshtide(command, tmp_path / "a.tide").exception
    assert isinstance(error, VersionError)
    assert (
        str(error) == f"{tmp_path / 'a.tide'}: the stream was written by an older meshtide (format 2): encode it again"
    )
    assert exit_code(error) == ExitCode.BAD_STREAM


def test_few_bytes_that_claim_millions_need_an_option(tmp_path: Path) -> None:
    encoded = encode_mesh(grid(9), CompactOptions(bits=8, previews=()))
    last = replace(encoded.header.levels[-1], vertices=1 << 22)
    header = replace(encoded.header, levels=(*encoded.header.levels[:-1], last))
    path = tmp_path / "claims.tide"
    path.write_bytes(write_container(header, encoded.packet_bytes))
    for command in ("info", "decode"):
        assert isinstance(meshtide(command, path).exception, LimitError)
    assert meshtide("info", path, "--max-vertices", 1 << 23).exit_code == 0
    assert isinstance(meshtide("info", path, "--max-vertices", 1000).exception, LimitError)


def test_a_stream_is_not_encoded_again(stream_file: Path, tmp_path: Path) -> None:
    for name in ("grid.tide", "renamed.ply"):
        (tmp_path / "renamed.ply").write_bytes(stream_file.read_bytes())
        path = tmp_path / name
        refused = meshtide("encode", path, "-o", tmp_path / "again.tide").exception
        assert isinstance(refused, MeshFileError)
        assert "a .tide stream" in str(refused)
        assert "encoded already" in str(refused)
        assert "meshtide decode" in str(refused)
    assert not (tmp_path / "again.tide").exists()


@pytest.mark.parametrize("name", ["a.ply", "a.obj", "a.off", "a.stl", "a.glb", "a.ply.gz", "a.tide", "a"])
def test_an_empty_file_is_told_by_its_name(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.touch()
    commands = ["decode", "info"] if name == "a.tide" else ["encode"]
    for command in commands:
        error = meshtide(command, path).exception
        assert isinstance(error, TruncatedError if name == "a.tide" else MeshFileError)
        assert str(path) in str(error)
        assert "is empty" in str(error)


def test_messages_about_levels_name_the_file(stream_file: Path) -> None:
    error = meshtide("decode", stream_file, "--level", 50).exception
    assert str(error).startswith(f"{stream_file} has levels 0 to ")
    assert str(error).endswith("; there is no level 50")
