from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshtide_codec.errors import MeshtideError, OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    path = tmp_path / "grid.ply"
    save_mesh(grid(16), path)
    return path


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
    page = tmp_path / "reports" / "grid-report.html"
    assert page.read_text().startswith("<!DOCTYPE html>")
    page.write_text("mine")
    before = mesh_file.with_suffix(".tide").stat().st_mtime_ns
    assert isinstance(meshtide("encode", mesh_file, "--report", tmp_path / "reports").exception, OptionError)
    assert isinstance(meshtide("encode", mesh_file, "--report", mesh_file).exception, OptionError)
    both = tmp_path / "both.png"
    assert isinstance(meshtide("encode", mesh_file, "-o", both, "--report", both).exception, OptionError)
    assert (page.read_text(), both.exists()) == ("mine", False)
    assert mesh_file.with_suffix(".tide").stat().st_mtime_ns == before
    assert meshtide("encode", mesh_file, "--report", tmp_path / "reports", "--overwrite").exit_code == 0
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_a_report_of_another_kind_is_refused_before_the_work(mesh_file: Path, tmp_path: Path) -> None:
    assert isinstance(meshtide("encode", mesh_file, "--report", tmp_path / "a.pdf").exception, MeshtideError)
    assert not mesh_file.with_suffix(".tide").exists()
