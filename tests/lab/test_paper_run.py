from __future__ import annotations

from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.errors import MeshError, MeshFileError, MeshtideError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.sphere import PAPER_FILTERS
from meshtide_codec.testing import grid, shapes
from meshtide_lab.paper import run, tables
from meshtide_lab.paper.report import report_page
from meshtide_lab.paper.run import named_mesh, run_paper
from paper_results import OPTIONS

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def patch(tmp_path: Path) -> Path:
    save_mesh(grid(14), tmp_path / "patch.ply")
    return tmp_path / "patch.ply"


def test_results_do_not_depend_on_the_number_of_processes(patch: Path) -> None:
    one, two = (run_paper([str(patch)], OPTIONS, processes=count) for count in (1, 2))
    assert list(one.meshes[0].filters) == list(PAPER_FILTERS)
    for rows in (tables.rate_rows, tables.accuracy_rows, tables.norm_rows, tables.noise_rows, tables.histogram_rows):
        assert rows(one.meshes[0]) == rows(two.meshes[0])


def test_a_mesh_that_cannot_be_read_is_listed_and_the_others_go_on(patch: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.ply").write_bytes(b"no mesh")
    results = run_paper([str(tmp_path / "bad.ply"), str(tmp_path / "missing.ply"), str(patch)], OPTIONS)
    assert [mesh.name for mesh in results.meshes] == ["patch"]
    assert list(results.failures) == [str(tmp_path / "bad.ply"), str(tmp_path / "missing.ply")]


def test_a_mesh_that_fails_in_the_middle_is_listed(patch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> None:
        raise MeshError("cannot be fitted")

    monkeypatch.setattr(run, "run_norm", failing)
    results = run_paper([str(patch)], OPTIONS)
    assert not results.meshes
    assert "cannot be fitted" in results.failures["patch"]


def test_a_process_that_is_ended_from_outside_is_told(patch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def ended(*_: object) -> Future[object]:
        future: Future[object] = Future()
        future.set_exception(BrokenProcessPool("gone"))
        return future

    monkeypatch.setattr(ProcessPoolExecutor, "submit", ended)
    with pytest.raises(MeshtideError, match="--processes"):
        run_paper([str(patch)], OPTIONS, processes=2)


@pytest.mark.parametrize("name", sorted(shapes()))
def test_any_mesh_can_be_analysed_and_reported(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "named_mesh", lambda *_: ("shape", "a test", shapes()[name]()))
    drawn = dict.fromkeys(("levels", "predictions", "rates", "histograms", "errors"), b"")
    results = run_paper([name], ClassicOptions(bits=8, coarsest_vertices=10))
    assert not results.failures
    assert "shape" in report_page(results, {"shape": drawn})


def test_progress_grows_to_the_end(patch: Path) -> None:
    stages: list[tuple[str, float]] = []
    run_paper([str(patch)], OPTIONS, progress=lambda stage, fraction: stages.append((stage, fraction)))
    fractions = [fraction for _, fraction in stages]
    assert fractions == sorted(fractions)
    assert fractions[-1] > 0.9


def test_names_are_told_apart(patch: Path, tmp_path: Path) -> None:
    assert named_mesh(str(patch), ["patch"])[0] == "patch-2"
    save_mesh(grid(3), tmp_path / "sphere.ply")
    assert named_mesh(str(tmp_path / "sphere.ply"), [])[0] == "sphere-file"  # not the paper's
    assert named_mesh("sphere", [])[0] == "sphere"
    assert len(named_mesh("piping", [])[2].vertices) > 10000
    assert len(named_mesh("spot", [])[2].vertices) == 2930
    with pytest.raises((MeshFileError, OSError)):
        named_mesh("nothing.ply", [])


def test_a_mesh_of_one_level_can_be_analysed(tmp_path: Path) -> None:
    save_mesh(grid(4), tmp_path / "tiny.ply")
    (mesh,) = run_paper([str(tmp_path / "tiny.ply")], OPTIONS).meshes
    assert mesh.level_vertices == (16,)
    assert {row["rms"] for row in tables.accuracy_rows(mesh)} == {0.0}
    assert np.isfinite([row["rate"] for row in tables.rate_rows(mesh)]).all()
