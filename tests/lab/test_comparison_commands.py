from __future__ import annotations

import csv
import json
import sys
from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshtide_codec.errors import MeshError, MeshtideError, OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    path = tmp_path / "grid.ply"
    save_mesh(grid(16), path)
    return path


@pytest.fixture
def peers() -> None:
    for library in ("DracoPy", "fast_simplification", "matplotlib"):
        pytest.importorskip(library, reason=f"{library} comes with the extra bench")


@pytest.mark.usefixtures("peers", "mesh_file")
def test_compare_writes_tables_and_plots(tmp_path: Path) -> None:
    (tmp_path / "broken.off").write_text("no mesh")
    save_mesh(grid(12), tmp_path / "patch.obj")
    output = tmp_path / "out" / "put"
    result = meshtide("compare", tmp_path, "--bits", 9, "-B", 10, "--output", output)
    assert result.exit_code == 0, result.output
    assert "whole files" in result.stdout
    assert "B = 9" in result.stdout
    assert "broken: " in result.stdout
    with (output / "sizes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["mesh"], row["bits"]) for row in rows] == [
        ("grid", "9"), ("grid", "10"), ("patch", "9"), ("patch", "10")
    ]  # fmt: skip
    assert {path.name for path in output.iterdir()} == {
        "sizes.csv", "targets.csv", "states.csv", "comparison.json",
        "grid-9.png", "grid-10.png", "patch-9.png", "patch-10.png",
    }  # fmt: skip
    assert len(json.loads((output / "comparison.json").read_text())["summaries"]) == 2


@pytest.mark.usefixtures("peers")
def test_compare_replaces_no_file_and_mixes_no_meshes_up(mesh_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    output.mkdir()
    (output / "grid-9.png").write_text("a picture of mine")
    refused = meshtide("compare", mesh_file, "-B", 9, "-o", output).exception
    assert isinstance(refused, OptionError)
    assert "grid-9.png is there already" in str(refused)
    assert [path.name for path in output.iterdir()] == ["grid-9.png"]
    save_mesh(grid(12), tmp_path / "grid.obj")
    refused = meshtide("compare", tmp_path, "-o", tmp_path / "new").exception
    assert isinstance(refused, OptionError)
    assert "grid.obj and " in str(refused)
    assert "grid.ply would both become grid" in str(refused)
    assert not (tmp_path / "new").exists()
    assert isinstance(meshtide("compare", mesh_file, "-o", mesh_file).exception, OptionError)
    result = meshtide("compare", mesh_file, "-B", 9, "-o", output, "--overwrite", "--profile", "classic")
    assert result.exit_code == 0, result.output
    assert (output / "grid-9.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("peers")
def test_compare_shows_names_as_they_are(tmp_path: Path) -> None:
    save_mesh(grid(8), tmp_path / "[bold]\x1b[31m\udcff$\\x$.ply")
    output = tmp_path / "out"
    result = meshtide("compare", tmp_path, "-B", 8, "--profile", "classic", "-o", output)
    assert result.exit_code == 0, result.output
    assert r"[bold]\x1b[31m\udcff$\x$" in result.stdout
    assert r"[bold]\u001b[31m\\udcff$\\x$" in (output / "comparison.json").read_text()
    assert r"\udcff" in (output / "sizes.csv").read_text("utf-8")


@pytest.mark.usefixtures("peers")
def test_compare_answers_in_json(mesh_file: Path) -> None:
    answer = json.loads(meshtide("compare", mesh_file, "--profile", "classic", "--json").stdout)
    assert answer["meshes"][0]["mesh"] == "grid"
    assert answer["meshes"][0]["exact"] is True
    assert answer["refused"] == {}


@pytest.mark.usefixtures("peers")
def test_compare_fails_if_there_is_nothing_to_compare(tmp_path: Path) -> None:
    assert isinstance(meshtide("compare", tmp_path).exception, OptionError)
    (tmp_path / "broken.off").write_text("no mesh")
    result = meshtide("compare", tmp_path)
    assert isinstance(result.exception, MeshError)
    assert "broken: " in result.stdout


def test_compare_without_draco_tells_what_to_install(mesh_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    error = meshtide("compare", mesh_file).exception
    assert isinstance(error, MeshtideError)
    assert str(error) == "this needs DracoPy, which is not installed: pip install 'meshtide[bench]'"


@pytest.mark.usefixtures("peers")
def test_a_comparison_of_nothing_writes_nothing(tmp_path: Path) -> None:
    (tmp_path / "broken.off").write_text("no mesh")
    failed = meshtide("compare", tmp_path / "broken.off", "-o", tmp_path / "out")
    assert isinstance(failed.exception, MeshError)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("peers")
def test_a_plot_that_fails_leaves_no_table(mesh_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_arguments: object) -> bytes:
        raise KeyboardInterrupt

    monkeypatch.setattr("meshtide_lab.comparison.plots.comparison_plot", fails)
    assert meshtide("compare", mesh_file, "-B", 8, "-o", tmp_path / "out").exit_code != 0
    assert not (tmp_path / "out").exists()
