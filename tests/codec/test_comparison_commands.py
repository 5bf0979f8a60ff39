from __future__ import annotations

import csv
import json
import sys
from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshes import grid
from meshtide_codec.errors import MeshError, MeshtideError, OptionError
from meshtide_codec.mesh_files import save_mesh

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
    save_mesh(grid(12), tmp_path / "grid.obj")
    output = tmp_path / "out" / "put"
    result = meshtide("compare", tmp_path, "--bits", 9, "-B", 10, "--output", output)
    assert result.exit_code == 0, result.output
    assert "whole files" in result.stdout
    assert "B = 9" in result.stdout
    assert "broken: " in result.stdout
    with (output / "sizes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["mesh"], row["bits"]) for row in rows] == [
        ("grid", "9"), ("grid", "10"), ("grid-2", "9"), ("grid-2", "10")
    ]  # fmt: skip
    assert {path.name for path in output.iterdir()} == {
        "sizes.csv", "targets.csv", "states.csv", "comparison.json",
        "grid-9.png", "grid-10.png", "grid-2-9.png", "grid-2-10.png",
    }  # fmt: skip
    assert len(json.loads((output / "comparison.json").read_text())["summaries"]) == 2


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
    assert str(error) == "this needs DracoPy: pip install 'meshtide[bench]'"


def test_encode_prints_a_report(mesh_file: Path) -> None:
    result = meshtide("encode", mesh_file, "--report", "-")
    assert result.exit_code == 0, result.output
    assert "bytes by level and layer" in result.stdout
    assert "RMS / diagonal" in result.stdout
    answer = json.loads(meshtide("encode", mesh_file, "--report", "-", "--json").stdout)
    assert sum(answer["bytes_by_layer"].values()) == answer["bytes"]
    assert answer["report_files"] == []
    assert "bytes_by_layer" not in json.loads(meshtide("encode", mesh_file, "--json").stdout)


def test_encode_writes_a_report(mesh_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots come with the extra bench")
    result = meshtide("encode", mesh_file, "--report", tmp_path / "reports")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "reports" / "grid-report.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "reports" / "grid-report.html").read_text().startswith("<!DOCTYPE html>")


def test_a_report_of_another_kind_is_refused_before_the_work(mesh_file: Path, tmp_path: Path) -> None:
    assert isinstance(meshtide("encode", mesh_file, "--report", tmp_path / "a.pdf").exception, MeshtideError)
    assert not mesh_file.with_suffix(".tide").exists()
