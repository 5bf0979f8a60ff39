from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from meshtide_client.commands.render import render as command
from meshtide_codec.command_line import ExitCode, exit_code
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from pictures import unpacked

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result


def render(*arguments: object) -> Result:
    """What the command answers."""
    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_the_picture_is_as_told_and_the_same_each_time(tmp_path: Path) -> None:
    save_mesh(grid(6), tmp_path / "a.ply")
    save_mesh(grid(9), tmp_path / "b.off")
    pictures = [tmp_path / "one.png", tmp_path / "two.png"]
    for path in pictures:
        result = render(tmp_path / "a.ply", tmp_path / "b.off", "--size", 64, "--edges", "--json", "-o", path)
        assert result.exit_code == 0, result.output
        answer = json.loads(result.stdout)
        assert unpacked(path.read_bytes()).shape == (answer["height"], answer["width"], 3)
        assert [mesh["vertices"] for mesh in answer["meshes"]] == [36, 81]
    assert pictures[0].read_bytes() == pictures[1].read_bytes()


def test_distances_are_coloured(tmp_path: Path) -> None:
    save_mesh(grid(6), tmp_path / "a.ply")
    plain, coloured = tmp_path / "plain.png", tmp_path / "coloured.png"
    assert render(tmp_path / "a.ply", "--size", 64, "-o", plain).exit_code == 0
    result = render(tmp_path / "a.ply", "--size", 64, "--distance-from", "spot", "-o", coloured)
    assert result.exit_code == 0
    assert "1 meshes" in result.stdout
    images = [unpacked(path.read_bytes())[:64] for path in (plain, coloured)]
    assert np.not_equal(*images).any()


def test_a_picture_replaces_nothing_unless_it_is_said(tmp_path: Path) -> None:
    save_mesh(grid(6), tmp_path / "[bold]\udcff.ply")
    mesh, picture = tmp_path / "[bold]\udcff.ply", tmp_path / "a.png"
    picture.write_text("mine")
    for arguments in ([mesh], [mesh, "--overwrite", "--distance-from", picture], [picture, "--overwrite"]):
        result = render(*arguments, "--size", 64, "-o", picture)
        assert isinstance(result.exception, OptionError)
        assert picture.read_text() == "mine"
    result = render(mesh, "--size", 64, "-o", picture, "--overwrite")
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["spot", "-o", "picture.jpg"], ExitCode.USAGE), (["missing.ply", "-o", "picture.png"], ExitCode.DISK)],
)
def test_what_cannot_be_drawn_leaves_no_picture(
    arguments: list[str], code: ExitCode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = render(*arguments)
    assert result.exception is not None
    assert exit_code(result.exception) is code
    assert not list(tmp_path.iterdir())
