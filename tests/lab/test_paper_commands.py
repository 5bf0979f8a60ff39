from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import pytest
import typer
from typer.testing import CliRunner

from meshtide_codec.command_line import ExitCode, exit_code
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from meshtide_lab.paper.commands import register
from pictures import unpacked

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

SMALL = ("--bits", 8, "--coarsest-vertices", 30, "--processes", 1)


def paper(*arguments: object) -> Result:
    """What the command answers."""
    app = typer.Typer()
    register(app)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of one small mesh, made with --json; the answer lies beside it."""
    base: Path = tmp_path_factory.mktemp("paper")
    save_mesh(grid(14), base / "patch.ply")
    result = paper(base / "patch.ply", *SMALL, "--json", "-o", base / "report")
    assert result.exit_code == 0, result.output
    (base / "answer.json").write_text(result.stdout)
    return base


def test_the_folder_holds_report_tables_and_pictures(folder: Path) -> None:
    answer = json.loads((folder / "answer.json").read_text())
    files = {path.name for path in (folder / "report").iterdir()}
    assert {path.rpartition("/")[2] for path in answer["files"]} == files
    assert {"report.html", "results.json", "rates.csv", "norms.csv", "histograms.csv", "patch-errors.png"} <= files
    for name in ("rates", "norms", "conclusions"):
        with (folder / "report" / f"{name}.csv").open(newline="") as file:
            assert len(list(csv.DictReader(file))) == len(answer[name])
    assert unpacked((folder / "report" / "patch-predictions.png").read_bytes()).ndim == 3
    assert json.loads((folder / "report" / "results.json").read_text())["rates"] == answer["rates"]


def test_an_earlier_report_is_replaced_only_when_told(folder: Path) -> None:
    before = (folder / "report" / "report.html").read_bytes()
    again = [folder / "patch.ply", *SMALL, "-o", folder / "report"]
    result = paper(*again)
    assert result.exception is not None
    assert exit_code(result.exception) is ExitCode.USAGE
    assert "--overwrite" in str(result.exception)
    result = paper(*again, "--overwrite")
    assert result.exit_code == 0
    assert "report.html" in result.stdout
    assert (folder / "report" / "report.html").read_bytes() == before


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for target in ([tmp_path], [tmp_path / "notes.txt"], [tmp_path / "notes.txt", "--overwrite"]):
        result = paper("sphere", *SMALL, "-o", *target)
        assert result.exception is not None
        assert exit_code(result.exception) is ExitCode.USAGE
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_two_meshes_of_one_name_are_refused_before_the_work(folder: Path, tmp_path: Path) -> None:
    result = paper(folder / "patch.ply", "round-table", tmp_path / "Patch.obj", *SMALL, "-o", tmp_path / "report")
    assert isinstance(result.exception, OptionError)
    assert "patch.ply and " in str(result.exception)
    assert "Patch.obj would both become Patch" in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_nothing_to_analyse_is_an_error(tmp_path: Path) -> None:
    result = paper(tmp_path / "missing.ply", *SMALL, "-o", tmp_path / "report")
    assert result.exception is not None
    assert exit_code(result.exception) is ExitCode.BAD_MESH
    assert "missing.ply" in str(result.exception)
