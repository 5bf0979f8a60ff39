"""No command compiles anything while it runs: no JIT is loaded and no compiler started, whatever the options."""

from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import certifi
import pytest
import typer

from dask_cluster import running_cluster
from meshtide_client.commands.application import build
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from watched_processes import reported, watching

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

JITS = {"numba", "llvmlite", "numexpr", "jax", "torch", "pythran", "cffi", "Cython", "pyximport", "weave", "taichi"}
COMPILERS = {
    *("cc", "c++", "gcc", "g++", "c99", "clang", "clang++", "tcc", "icx", "cl", "nvcc", "rustc", "zig", "as", "ld"),
    *("cmake", "make", "ninja", "meson", "pip", "pip3"),
}
WRITER = "a-token-for-writing-0123456789"
MESHTIDE = (sys.executable, "-m", "meshtide_client.main")

PREPARE = ("encode patch.ply", "encode patch.ply -o classic.tide --profile classic --coarsest-vertices 9")
NETWORK = "--timeout 60 --token-file token --ca-file {certificates}"
RUNS = {
    "encode": (
        (
            "encode patch.ply -o a.tide --profile compact -B 9 --origin -9,-9,-9 --extent 60 --previews 8,2 --slices 2"
            " --effort high --threads 2 --strict --format ply --keep-unreferenced --store-order --report report"
            " --overwrite --json"
        ),
        "encode patch.ply -o b.tide --step 0.25",
        (
            "encode patch.ply -o c.tide --profile classic -K 2 --minimum-ratio 1.2 --coarsest-vertices 9"
            " --filter polynomial --degree 2 --basis chebyshev --norm 1.5 -S 2"
        ),
        "encode patch.ply -o d.tide --profile classic --filter rational --coarsest-vertices 9 --diff-levels 0",
    ),
    "decode": (
        (
            "decode a.tide -o a.obj --format obj --level 0 --partial --input-order --overwrite"
            " --max-vertices 10000 --max-faces 20000 --json"
        ),
        "decode classic.tide --level 1",
    ),
    "info": (
        "info classic.tide --statistics --max-vertices 10000 --max-faces 20000 --json",
        "info patch.tide",
    ),
    "sphere": ("sphere --json",),
    "compare": ("compare patch.ply -B 10 --profile compact --effort high -o comparison --overwrite --json",),
    "render": (
        (
            "render patch.tide patch.ply -o picture.png --all-levels --distance-from patch.ply --size 64 --columns 2"
            " --turn 10 --tilt 20 --smooth --edges --each-fits --overwrite --max-vertices 10000 --max-faces 20000"
            " --json"
        ),
        "render spot -o dots.png",
    ),
    "paper": (
        (
            "paper patch.ply -o paper -B 9 -K 2 --minimum-ratio 1.2 --coarsest-vertices 30 --processes 2 --overwrite"
            " --json"
        ),
    ),
    "simulate": (
        (
            "simulate patch.ply --loss noise:kind=gaussian,relative=0.5 --seeds 2 --first-seed 3 --profile classic"
            " --profile compact --filter taubin --filter degree-2 --norm 1.5 -S 2 --slices 2 -B 9 --unprotected param"
            " -o simulation --processes 2 --parquet --plots --overwrite --json"
        ),
    ),
    "demo": ("demo -o demo --mesh spot --rate 1e6 --wait 300 --picture --overwrite",),
    "fetch": (
        (
            "fetch {url}/meshes/patch -o f.ply --format ply --until-level 0 --max-bytes 1000000 --max-error 0"
            " --keep-levels levels --stream-file kept.tide --retries 1 --rate 1e7 --transport http --overwrite"
            " --max-vertices 10000 --max-faces 20000 --json {network}"
        ),
        "fetch {url}/meshes/patch -o g.ply --loss noise:relative=0.5 --seed 2 --unprotected map-conn",
    ),
    "ingest": (
        (
            "ingest patch.ply --server {url} -B 9 --profile compact --effort high --tag clay --licence CC0 --replace"
            " --parallel 2 --json {network}"
        ),
        "ingest patch.ply --data kept --workers 1",
        "ingest patch.ply --store store --database sqlite:///catalogue.db --distributed {scheduler}",
    ),
    "meshes": (
        (
            "meshes {url} --search patch --tag clay --licence CC0 --status ready --smallest 1 --largest 1000000"
            " --fewest-vertices 1 --most-vertices 10000 --fewest-levels 1 --most-levels 40 --created-after 2020-01-01"
            " --created-before 2999-01-01 --box -99 -99 -99 99 99 99 --after a --limit 5 --json {network}"
        ),
        "meshes {url}",
    ),
    "edit": (
        "edit {url}/meshes/patch-ply --name vase --tag clay --licence CC0 --json {network}",
        "edit {url}/meshes/patch-ply --no-tags {network}",
    ),
    "tags": ("tags {url} --limit 3 --json {network}",),
    "export": (
        "export patch.ply --static site -B 9 --profile compact --effort high --overwrite --json {network}",
        "export {url} --static copy",
    ),
    "delete": ("delete {url}/meshes/patch-ply --yes --json {network}",),
    "copy-store": ("copy-store store backup --json",),
    "check-store": ("check-store backup --json",),
}
"""Of each command, in this order, lines that have all of its options between them."""
SERVE = (
    "serve hosted --host 127.0.0.1 --port 0 --data published --store other-store --cache cache -B 9 --profile compact"
    " --effort high --allow-origin https://museum.example --allow-method GET --allow-header range --ticket-seconds 9"
    " --hello-timeout 9 --stall-timeout 90 --recursive --rescan-seconds 1 --connections-per-client 9"
    " --bytes-per-second 99999999 --writes-per-minute 99 --unlimited-client 127.0.0.0/8 --trusted-proxy 10.0.0.0/8"
    " --drain-timeout 1 --log-level warning --log-format json --access-log --metrics open --set max_upload=1000000"
    " --settings settings.toml --announce --ready-file ready"
)
SERVE_SAMPLES = "serve --samples --port 0 --cache cache --announce"


@dataclass
class House:
    """A folder in which commands are run, and what watches them."""

    folder: Path
    reports: Path
    environment: dict[str, str]
    places: dict[str, str] = field(default_factory=lambda: {"certificates": certifi.where()})

    def words(self, line: str) -> list[str]:
        network = NETWORK.format(**self.places)
        return [*MESHTIDE, *shlex.split(line.format(network=network, **self.places))]

    def run(self, line: str) -> None:
        done = subprocess.run(
            self.words(line), cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"

    @contextmanager
    def serving(self, line: str) -> Iterator[str]:
        with subprocess.Popen(
            self.words(line), cwd=self.folder, env=self.environment, stdout=subprocess.PIPE
        ) as process:
            try:
                assert process.stdout is not None
                yield json.loads(process.stdout.readline())["url"]
            finally:
                process.send_signal(signal.SIGTERM)
                process.wait(60)


@pytest.fixture(scope="module", name="house")
def _house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    """Meshes, streams, a server and a cluster; all processes but the cluster's own are watched."""
    folder = tmp_path_factory.mktemp("house")
    (folder / "hosted").mkdir()
    (folder / "cluster").mkdir()
    save_mesh(grid(12), folder / "patch.ply")
    save_mesh(grid(12), folder / "hosted" / "patch.ply")
    (folder / "token").write_text(WRITER)
    (folder / "settings.toml").write_text('write_tokens_file = "token"\n')
    reports = folder / "reports"
    house = House(folder, reports, watching(reports))
    for line in PREPARE:
        house.run(line)
    with house.serving(SERVE) as url, running_cluster(1, folder / "cluster") as cluster:
        house.places.update(url=url, scheduler=cluster.address)
        yield house


@pytest.fixture(scope="module", name="commands")
def _commands() -> dict[str, Any]:
    group: Any = typer.main.get_command(build())
    return dict(group.commands)


@pytest.mark.parametrize("command", RUNS)
def test_nothing_is_compiled_by(command: str, house: House) -> None:
    for path in house.reports.glob("*.txt"):
        path.unlink()
    for line in RUNS[command]:
        house.run(line)
    check(house, processes=len(RUNS[command]))


def test_nothing_is_compiled_by_a_server_and_its_encoders(tmp_path: Path) -> None:
    house = House(tmp_path, tmp_path / "reports", watching(tmp_path / "reports"))
    with house.serving(SERVE_SAMPLES) as url:
        house.places.update(url=url)
        house.run("fetch {url}/meshes/spot -o spot.ply")
    check(house, processes=3)


def check(house: House, *, processes: int) -> None:
    """Hold what so many processes, or more, have told against what none may do."""
    packages = reported(house.reports, "package")
    assert sum("meshtide_codec" in names for names in packages) >= processes
    for names in packages:
        assert not names & JITS
    programs = {name for names in reported(house.reports, "program") for name in names}
    assert not {name for name in programs if name in COMPILERS or name.rpartition("-")[2] in COMPILERS}


def test_the_watch_sees_packages_and_programs(tmp_path: Path) -> None:
    program = "import ctypes, os, subprocess, json\nsubprocess.run(['true'])\nos.system('false -o x')"
    subprocess.run([sys.executable, "-c", program], env=watching(tmp_path / "reports"), check=True)
    (packages,) = reported(tmp_path / "reports", "package")
    assert {"ctypes", "json", "subprocess"} <= packages
    assert reported(tmp_path / "reports", "program") == [{"true", "false"}]


def test_every_option_of_every_command_is_tried(commands: dict[str, Any]) -> None:
    tried = {**RUNS, "serve": (SERVE, SERVE_SAMPLES)}
    assert set(tried) == set(commands)
    for name, lines in tried.items():
        words = set(shlex.split(" ".join(lines).replace("{network}", NETWORK)))
        for parameter in commands[name].params:
            known = {*parameter.opts, *parameter.secondary_opts}
            assert parameter.param_type_name == "argument" or known & words, f"meshtide {name} {parameter.opts}"
