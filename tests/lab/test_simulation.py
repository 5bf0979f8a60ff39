"""Sweeps: the same files whatever the processes, resumption, refusals, failures, statistics."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from meshtide_client.commands.application import build
from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from meshtide_lab.simulation import output, worker
from meshtide_lab.simulation.journal import DEFINITION, RUNS
from meshtide_lab.simulation.summary import mean_interval, summarize
from meshtide_lab.simulation.sweep import Sweep, SweepResults, run_sweep
from meshtide_lab.simulation.variants import make_variants, parse_norm

LOSSES = ("none", "gilbert:loss=0.2,burst=2", "noise:relative=1")


@pytest.fixture(name="mesh")
def _mesh(tmp_path: Path) -> Path:
    path = tmp_path / "patch.ply"
    save_mesh(grid(18), path)
    return path


def sweep(*meshes: Path | str, losses: tuple[str, ...] = LOSSES, seeds: int = 3) -> Sweep:
    variants = make_variants(["classic", "compact"], ["zeroth", "degree-2"], [2.0], [0], [1, 4], 10)
    return Sweep(tuple(map(str, meshes)), tuple(variants), losses, range(seeds))


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def simulated(what: Sweep, folder: Path, processes: int = 1) -> SweepResults:
    results = run_sweep(what, folder, processes=processes)
    output.write_results(results, folder)
    return results


def test_the_files_do_not_depend_on_processes_or_interruptions(mesh: Path, tmp_path: Path) -> None:
    results = simulated(sweep(mesh), tmp_path / "one")
    simulated(sweep(mesh), tmp_path / "two", processes=2)
    whole = files(tmp_path / "one")
    assert files(tmp_path / "two") == whole
    assert len(results.runs) == 4 * 3 * 3
    assert {"runs.csv", "levels.parquet", "summary.csv", "loss-distortion.png", "rate-distortion.png"} <= set(whole)

    journal = tmp_path / "two" / RUNS
    journal.write_bytes(journal.read_bytes()[: len(journal.read_bytes()) // 2])
    resumed = simulated(sweep(mesh), tmp_path / "two")
    assert 0 < resumed.resumed < len(results.runs)
    assert files(tmp_path / "two") == whole


def test_a_resumed_sweep_does_only_what_is_left(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulated(sweep(mesh), tmp_path / "out")

    def refuse(*_: Any) -> Any:
        raise AssertionError("nothing is left to do")

    monkeypatch.setattr(worker, "receive", refuse)
    monkeypatch.setattr(worker, "encode", refuse)
    assert simulated(sweep(mesh), tmp_path / "out").resumed == 36


def test_other_sweeps_and_other_versions_are_not_touched(mesh: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    simulated(sweep(mesh), folder)
    before = files(folder)
    with pytest.raises(OptionError, match="another sweep \\(it differs in seeds\\)"):
        run_sweep(sweep(mesh, seeds=4), folder)
    save_mesh(grid(19), mesh)
    with pytest.raises(OptionError, match="differs in meshes"):
        run_sweep(sweep(mesh), folder)
    save_mesh(grid(18), mesh)
    definition = json.loads(before[DEFINITION])
    for key, value in (("meshtide", "0.0.1"), ("results", 0)):
        (folder / DEFINITION).write_text(json.dumps(definition | {key: value}))
        with pytest.raises(OptionError, match="holds results of meshtide"):
            run_sweep(sweep(mesh), folder)
    (folder / DEFINITION).write_text("[]")
    with pytest.raises(OptionError, match="not that of a sweep"):
        run_sweep(sweep(mesh), folder)
    (folder / DEFINITION).write_bytes(before[DEFINITION])
    assert files(folder) == before
    with pytest.raises(OptionError, match="other files"):
        run_sweep(sweep(mesh), tmp_path)


def test_another_sweep_is_replaced_when_it_is_said(mesh: Path, tmp_path: Path) -> None:
    simulated(sweep(mesh), tmp_path / "expected")
    folder = tmp_path / "out"
    (folder / "streams").mkdir(parents=True)
    (folder / "notes.txt").write_text("kept")
    (folder / "runs.jsonl").write_text("{}")
    for stream in (tmp_path / "expected" / "streams").iterdir():
        (folder / "streams" / stream.name).write_text("the stream of an earlier sweep")
    with pytest.raises(OptionError, match="holds other files"):
        run_sweep(sweep(mesh), folder)
    results = run_sweep(sweep(mesh), folder, overwrite=True)
    output.write_results(results, folder)
    assert files(folder) == files(tmp_path / "expected") | {"notes.txt": b"kept"}
    with pytest.raises(OptionError, match="add --overwrite"):
        run_sweep(sweep(mesh, seeds=1), folder)
    assert len(run_sweep(sweep(mesh, seeds=1), folder, overwrite=True).runs) == 4 * 3
    assert run_sweep(sweep(mesh, seeds=1), folder, overwrite=True).resumed == 4 * 3


def test_meshes_of_a_sweep_are_told_apart_and_left_alone(mesh: Path, tmp_path: Path) -> None:
    twin = tmp_path / "twin" / mesh.name
    twin.parent.mkdir()
    save_mesh(grid(5), twin)
    with pytest.raises(OptionError, match=f"{mesh} and {twin} would both become {mesh.stem}"):
        run_sweep(sweep(mesh, twin), tmp_path / "out")
    assert not (tmp_path / "out").exists()
    (tmp_path / "out" / "streams").mkdir(parents=True)
    stream = tmp_path / "out" / "streams" / "0-patch-0.tide"
    whole = encode(grid(12)).to_bytes()
    stream.write_bytes(whole)
    (tmp_path / "patch.tide").symlink_to(stream)
    with pytest.raises(OptionError, match="is what is read"):
        run_sweep(sweep(tmp_path / "patch.tide"), tmp_path / "out", overwrite=True)
    assert files(tmp_path / "out") == {"streams/0-patch-0.tide": whole}


def test_a_mesh_that_fails_is_told_and_the_sweep_goes_on(mesh: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.obj"
    broken.write_text("v 0 0 nan\nf 1 1 1\n")
    results = simulated(sweep(broken, tmp_path / "missing.ply", mesh), tmp_path / "out")
    assert len(results.runs) == 36
    assert str(tmp_path / "missing.ply") in results.failures
    assert sum(name.startswith("broken") for name in results.failures) == 4
    assert "broken" in (tmp_path / "out" / "failures.csv").read_text()
    with pytest.raises(MeshError, match="none of the meshes"):
        run_sweep(sweep(broken), tmp_path / "other")


def test_a_run_that_fails_is_told_and_tried_again(mesh: Path, tmp_path: Path) -> None:
    losses = ("loss:rate=0.5", "drop:kind=param")  # Param, which degree-2 alone has, is protected
    results = simulated(sweep(mesh, losses=losses), tmp_path / "out")
    assert (len(results.runs), len(results.failures)) == (21, 3)
    assert all("protected" in reason for reason in results.failures.values())
    assert simulated(sweep(mesh, losses=losses), tmp_path / "out").resumed == 21


def test_streams_are_taken_as_they_are(tmp_path: Path) -> None:
    stream = tmp_path / "patch.tide"
    stream.write_bytes(encode(grid(12)).to_bytes())
    results = simulated(sweep(stream), tmp_path / "out")
    assert {row["stream"] for row in results.runs} == {"compact 1 slice"}
    assert len(results.runs) == 9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"losses": ()}, "has no losses"),
        ({"seeds": range(0)}, "has no seeds"),
        ({"meshes": ()}, "has no meshes"),
        ({"variants": ()}, "has no variants"),
        ({"losses": ("none", "none")}, "twice"),
        ({"losses": ("los",)}, "no link model"),
        ({"unprotected": "everything"}, "no kind of packet"),
    ],
)
def test_sweeps_that_are_refused(change: dict[str, Any], message: str) -> None:
    good = {"meshes": ("spot",), "variants": sweep("spot").variants, "losses": LOSSES, "seeds": range(2)}
    with pytest.raises(OptionError, match=message):
        Sweep(**(good | change))  # type: ignore[arg-type]


def test_variants_that_are_refused_or_alike() -> None:
    with pytest.raises(OptionError, match="profile 'modern'"):
        make_variants(["modern"], ["zeroth"], [2.0], [0], [1], 12)
    with pytest.raises(OptionError, match="filter 'cubic'"):
        make_variants(["classic"], ["cubic"], [2.0], [0], [1], 12)
    with pytest.raises(OptionError, match="norm"):
        parse_norm("three")
    alike = make_variants(["classic"], ["zeroth", "degree-1"], [1.0, 2.0, math.inf], [0, 2], [1], 12)
    assert [variant.label for variant in alike if "zeroth" in variant.filter] == [
        "classic zeroth",
        "classic zeroth S=2",
    ]
    assert len(alike) == 2 + 6


def test_intervals_hold_the_mean_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(2000):
        mean, half = mean_interval(rng.normal(3.0, 2.0, 6).tolist())
        held += abs(mean - 3.0) < half
    assert held / 2000 == pytest.approx(0.95, abs=0.016)
    assert math.isnan(mean_interval([])[0])
    assert mean_interval([4.0])[0] == 4.0


def test_nothing_shown_is_counted() -> None:
    base = dict.fromkeys(("mesh", "profile", "filter", "S", "slices", "stream", "loss"), "x")
    measures = dict.fromkeys(
        ("l2_per_vertex", "l_infinity", "vertex_rms", "rms", "hausdorff", "normal_deviation"), math.nan
    )
    row = base | measures | {"received_bytes": 9, "levels_missing": 3, "level": -1, "diffs": 4, "lost_diffs": 4}
    (summary,) = summarize([row, row | {"level": 0, "rms": 0.5, "lost_diffs": 0}])
    assert (summary["runs"], summary["shown"], summary["rms"], summary["lost_share"]) == (2, 1, 0.5, 0.5)


def test_the_command(mesh: Path, tmp_path: Path) -> None:
    arguments = ["simulate", str(mesh), "--loss", "loss:rate=0.5", "--seeds", "2", "--processes", "1"]
    arguments += ["-o", str(tmp_path / "out"), "--no-plots"]
    done = CliRunner().invoke(build(), [*arguments, "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert (answer["runs"], answer["failures"]) == (2, {})
    assert answer["summary"][0]["lost_share"] > 0
    again = CliRunner().invoke(build(), arguments)
    assert "2 runs, 2 of them done before, 0 failures" in again.stdout
    empty = CliRunner().invoke(build(), ["simulate", str(mesh)])
    assert isinstance(empty.exception, OptionError)
