"""The figures of the codec in one table: python tests/bench/figures.py --meshes FOLDER [--before CHECKOUT].

Times are processor time, the least of several runs; all candidates take turns, mesh by mesh and run by run, so that a
machine that others use as well slows all of them: this checkout, DracoPy, and, with `--before`, another checkout in
processes of its own. Sizes are of whole streams without previews at B = 12 beside Draco's files. Each row says what the
project must and what it wants to reach; what goes beyond the first is marked.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from memory import MEBIBYTE, both
from start_up import start_up_rows
from wasm_speed import by_node, native_seconds

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.samples import load_sample

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[1]
BITS = 12
MADE_BITS = 16  # of a made mesh, since at 12 a million vertices would weld
TIMED = ("stanford-bunny", "armadillo", "beetle-alt")
UNTRAINED = ("stanford-bunny", "armadillo", "rocker-arm", "fandisk", "beetle-alt", "harley", "truck")
"""Meshes that nothing was ever trained on, of either effort."""
EFFORTS = tuple(Effort)
DRACO_TIMES = {TIMED[0]: (13.0, 8.0)}
"""How many times as long as Draco a mesh may take to decode, and should."""


@dataclass(frozen=True)
class Row:
    """One figure.

    Args:
        what: it is of.
        value: of it.
        must: the worst value that is good enough; None where nothing is asked for.
        reach: the value that is wanted.
        unit: behind the number.
        more: whether more is better.
    """

    what: str
    value: float
    must: float | None = None
    reach: float | None = None
    unit: str = ""
    more: bool = False

    @property
    def missed(self) -> bool:
        """Whether it is worse than it must be."""
        return self.must is not None and (self.value < self.must if self.more else self.value > self.must)


class Worker:
    """A process that encodes and decodes with one checkout.

    Args:
        checkout: whose packages it uses.
        python: the interpreter.
    """

    def __init__(self, checkout: Path, python: str) -> None:
        packages = [str(checkout / part) for part in ("codec", "server", "client")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(packages)}
        if checkout.resolve() != REPOSITORY:
            environment.pop("MESHTIDE_CORE", None)  # it names a core for this one
        self._process = subprocess.Popen(
            [python, HERE / "codec_worker.py"],
            cwd=checkout,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def ask(self, what: str, name: str, bits: int, effort: str = "default") -> float:
        """The answer of `codec_worker.py`."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        question = {"what": what, "name": name, "bits": bits, "effort": effort}
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"the worker ended at {question}")
        return float(json.loads(line)["value"])


@dataclass(frozen=True)
class Timed:
    """A mesh to be timed with, at its B."""

    label: str
    name: str
    bits: int
    large: bool = False


Times = dict[tuple[str, str], float]
"""Least seconds by who and what: ("now", "decode default")."""


def mesh_files(folder: Path) -> dict[str, str]:
    """Paths of the folder's meshes by their names."""
    suffixes = {".obj", ".off", ".ply"}
    return {path.stem: str(path.resolve()) for path in sorted(folder.iterdir()) if path.suffix in suffixes}


def times_of(mesh: Timed, now: Worker, before: Worker | None, runs: int) -> Times:
    """Least times of all that is done with one mesh, everybody taking turns."""
    work = [("decode", "default"), ("decode", "high"), ("encode", "default")]
    tasks = [(("now", f"{what} {effort}"), now, what, effort) for what, effort in work]
    tasks += [(("draco", what), now, f"draco {what}", "default") for what in ("decode", "encode")]
    if before is not None:
        tasks += [(("before", f"{what} {effort}"), before, what, effort) for what, effort in work]
    least: Times = {}
    for run in range(runs):
        for key, worker, what, effort in tasks:
            slow = mesh.large and what in {"encode", "draco encode"} and run > 0
            if slow:
                continue  # once: it takes as long as all else
            least[key] = min(least.get(key, math.inf), worker.ask(what, mesh.name, mesh.bits, effort))
    return least


def time_rows(times: dict[str, Times]) -> list[Row]:
    """The rows of what took how long, by the labels of meshes."""
    rows = []
    asked = {"decode default": (2.2, 3.5), "decode high": (3.0, 6.0), "encode default": (4.0, 10.0)}
    if all(("before", what) in each for each in times.values() for what in asked):
        for what, (least, wanted) in asked.items():
            faster = {label: each["before", what] / each["now", what] for label, each in times.items()}
            rows.append(Row(f"{what}, against before", mean(faster.values()), least, wanted, " x faster", more=True))
            rows += [Row(f"- {label}", value, unit=" x faster", more=True) for label, value in faster.items()]
    for label, each in times.items():
        must, reach = DRACO_TIMES.get(label, (None, None))
        against = each["now", "decode default"] / each["draco", "decode"]
        rows.append(Row(f"decode default against Draco, {label}", against, must, reach, " x its time"))
        against = each["now", "encode default"] / each["draco", "encode"]
        rows.append(Row(f"encode default against Draco, {label}", against, unit=" x its time"))
    for label, each in times.items():
        rows += [Row(f"{who} {what}, {label}", 1000 * value, unit=" ms") for (who, what), value in each.items()]
    return rows


def size_rows(meshes: dict[str, str], now: Worker, before: Worker | None) -> list[Row]:
    """The rows of sizes against Draco's, and against those of the checkout before."""
    rows = []
    for effort, must, reach in (("default", 0.925, 0.90), ("high", 0.858, 0.84)):
        ratios, growth = {}, {}
        for name, path in meshes.items():
            size = now.ask("size", path, BITS, effort)
            ratios[name] = size / now.ask("draco size", path, BITS)
            if before is not None:
                growth[name] = size / before.ask("size", path, BITS, effort)
        about = f"size / Draco, effort {effort}"
        rows.append(Row(f"{about}, all {len(ratios)}", mean(ratios.values()), must, reach))
        untrained = [ratios[name] for name in UNTRAINED if name in ratios]
        rows.append(Row(f"{about}, the {len(untrained)} never trained on", mean(untrained), must, reach))
        if growth:
            worst = max(growth, key=lambda name: growth[name])
            rows.append(Row(f"size against before, effort {effort}, worst: {worst}", growth[worst], 1.03, 1.0))
        rows += [Row(f"- {name}", ratio) for name, ratio in ratios.items()]
    return rows


def memory_rows(vertices: int) -> list[Row]:
    """The rows of peak memory."""
    encoding, decoding = both(vertices)
    asked = vertices == 1_000_000
    return [
        Row(
            f"peak memory beyond interpreter and input, {what}, {vertices} vertices",
            work.beyond / MEBIBYTE,
            must if asked else None,
            reach if asked else None,
            " MiB",
        )
        for what, work, must, reach in (("decode", decoding, 256, 160), ("encode", encoding, 768, 384))
    ]


def start_rows() -> list[Row]:
    """The rows of what starting costs."""
    asked = ((0.1, 0.05), (0.1, 0.05), (None, None), (1.5, 0.6))
    return [
        Row(f"{row.name}, beyond {row.beyond}", row.more, must, reach, " s")
        for row, (must, reach) in zip(start_up_rows(), asked, strict=True)
    ]


def wasm_rows(runs: int) -> list[Row]:
    """The rows of decoding in Node against the native core."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bunny.tide"
        for effort in EFFORTS:
            file.write_bytes(encode(load_sample(TIMED[0]), CompactOptions(effort=effort)).to_bytes())
            data = file.read_bytes()
            native = min(native_seconds(data) for _ in range(runs))
            node, _ = by_node(file, runs)
            native = min(native, *(native_seconds(data) for _ in range(runs)))
            rows.append(
                Row(f"WebAssembly in Node against native, bunny, {effort}", node / native, 2.0, 1.5, " x its time")
            )
    return rows


def mean(values: Iterable[float]) -> float:
    """Geometric."""
    logarithms = [math.log(value) for value in values]
    return math.exp(sum(logarithms) / len(logarithms)) if logarithms else math.nan


def table(rows: Sequence[Row]) -> str:
    """The rows as Markdown."""
    lines = ["| what | value | must | reach | |", "|---|---:|---:|---:|---|"]
    for row in rows:
        word = "" if row.must is None else "MISSED" if row.missed else "yes"
        asked = [("" if each is None else f"{each:g}") for each in (row.must, row.reach)]
        lines.append(f"| {row.what} | {row.value:.4g}{row.unit} | {asked[0]} | {asked[1]} | {word} |")
    return "\n".join(lines)


def arguments_given() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=Path, required=True, help="a folder with the twelve meshes")
    parser.add_argument("--before", type=Path, help="a checkout to compare with")
    parser.add_argument("--before-python", default=sys.executable, help="an interpreter with what that one needs")
    parser.add_argument("--runs", type=int, default=5, help="of everything that is timed")
    parser.add_argument("--vertices", type=int, default=1_000_000, help="of the made mesh; 0: none")
    parser.add_argument("--only", nargs="*", default=PARTS, choices=PARTS, help="parts of the table")
    parser.add_argument("--json", type=Path, help="a file for the rows")
    return parser.parse_args()


PARTS = ("times", "sizes", "memory", "start", "wasm")


def main() -> int:
    """Measure and print; the exit code says whether a figure is missed."""
    arguments = arguments_given()
    files = mesh_files(arguments.meshes)
    rows: list[Row] = []
    with ExitStack() as open_workers:
        now = open_workers.enter_context(Worker(REPOSITORY, sys.executable))
        before = None
        if arguments.before is not None:
            before = open_workers.enter_context(Worker(arguments.before, arguments.before_python))
        if "times" in arguments.only:
            timed = [Timed(name, files[name], BITS) for name in TIMED]
            if arguments.vertices:
                timed.append(Timed("made", f"torus:{arguments.vertices}", MADE_BITS, large=True))
            rows += time_rows({mesh.label: times_of(mesh, now, before, arguments.runs) for mesh in timed})
        if "sizes" in arguments.only:
            rows += size_rows(files, now, before)
    if "memory" in arguments.only and arguments.vertices:
        rows += memory_rows(arguments.vertices)
    if "start" in arguments.only:
        rows += start_rows()
    if "wasm" in arguments.only:
        rows += wasm_rows(arguments.runs)
    print(table(rows))
    if arguments.json is not None:
        told: list[dict[str, Any]] = [{**asdict(row), "missed": row.missed} for row in rows]
        arguments.json.write_text(json.dumps(told, indent=1) + "\n")
    return int(any(row.missed for row in rows))


if __name__ == "__main__":
    sys.exit(main())
